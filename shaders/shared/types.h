// What GLSL's vector types are to C++, and the words that let one text serve both. GLSL has no templates: Number is
// float.
#ifdef __cplusplus
#pragma once
#define SHARED_BEGIN namespace scanshade::shared {
#define SHARED_END }
#define SHARED_FN constexpr
#define SHARED_NUMBER_FN                                                                                               \
    template <class Number>                                                                                            \
    constexpr Number // a function in the precision of its caller
#include <cstdint>
namespace scanshade::shared {
using uint = std::uint32_t;
struct vec2 {
    float x = 0, y = 0;
    constexpr vec2() = default;
    constexpr vec2(float x_, float y_) : x(x_), y(y_) {}
};
struct vec3 {
    float x = 0, y = 0, z = 0;
    constexpr vec3() = default;
    constexpr vec3(float x_, float y_, float z_) : x(x_), y(y_), z(z_) {}
};
struct vec4 {
    float x = 0, y = 0, z = 0, w = 0;
    constexpr vec4() = default;
    constexpr vec4(float x_, float y_, float z_, float w_) : x(x_), y(y_), z(z_), w(w_) {}
};
struct ivec2 {
    std::int32_t x = 0, y = 0;
    constexpr ivec2() = default;
    constexpr ivec2(std::int32_t x_, std::int32_t y_) : x(x_), y(y_) {}
};
} // namespace scanshade::shared
#else
#define SHARED_BEGIN
#define SHARED_END
#define SHARED_FN
#define SHARED_NUMBER_FN float
#define Number float
#endif
