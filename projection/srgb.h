// sRGB's transfer curve (IEC 61966-2-1): stored colour <-> linear light, both 0 .. 1.
#pragma once

#include <array>
#include <cmath>

namespace scanshade {

[[nodiscard]] inline double linear_from_srgb(double stored) {
    return stored <= 0.04045 ? stored / 12.92 : std::pow((stored + 0.055) / 1.055, 2.4);
}

[[nodiscard]] inline double srgb_from_linear(double linear) {
    return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

/// Both curves for 8-bit colours. 4096 steps of linear light are fine enough that all 256 stored values come back
/// unchanged.
struct SrgbTables {
    static constexpr int linear_steps = 4096;
    std::array<float, 256> linear{}; ///< in units of the other table's index
    std::array<unsigned char, linear_steps> stored{};
};
[[nodiscard]] const SrgbTables& srgb_tables();

} // namespace scanshade
