// Light on synthetic scenes whose parts are known: albedo, ambient light and direct light with cast shadows.
#pragma once

#include "apps/scenes/world/scene.h"
#include "projection/base/parameters.h"

#include <string>

namespace scanshade::scene {

enum class LightKind { soft, ambient, overcast, sun };
inline constexpr std::array light_words{Named{"soft", LightKind::soft}, Named{"ambient", LightKind::ambient},
                                        Named{"overcast", LightKind::overcast}, Named{"sun", LightKind::sun}};

/// What lights a scene. Soft light is that of render_colour(), whose parts nobody knows.
struct SceneLight {
    LightKind kind = LightKind::soft;
    Eigen::Vector3d towards{0.45, -0.35, 0.82}; ///< a sun's, in the world
    double ratio = 1.5;                         ///< direct / ambient light, of a surface that faces the sun
    bool occluded = true;                       ///< ambient light is multiplied by true visibility

    [[nodiscard]] bool has_sun() const { return kind == LightKind::sun; }
    /// Of ambient light over normals: 1 + gradient . n.
    [[nodiscard]] Eigen::Vector3d gradient() const;
};

/// Linear light, red, green, blue at pixel centres. A photograph is ambient * visibility + direct.
struct LitImages {
    cv::Mat3f albedo, ambient, direct;
};

/// A sun shines through whatever bounds the scene: floor, walls and ceiling of a room, since inside one it would be
/// dark. Everything else casts shadows. Ambient and direct light together are 1.1 on a surface that faces the sun, so
/// that the brightest albedo is not clipped.
[[nodiscard]] LitImages render_lit(const World& world, const Optics& camera, const Eigen::Isometry3d& world_from_camera,
                                   const SceneLight& light);

/// Light that arrives at each pixel's exact surface from others: linear light, red, green, blue, and their share of the
/// hemisphere's complement.
struct Bounce {
    cv::Mat3f indirect;
    cv::Mat1f visibility; ///< of the same rays; NaN where no surface is
};

/// One diffuse bounce: the mean over the cosine-weighted hemisphere of what leaves the first surface within the radius,
/// and of nothing where a ray meets none. This is irradiance / pi. Where all surfaces send B, it is B (1 - visibility).
/// Surfaces send what a photograph without occlusion shows of them: albedo times unoccluded ambient light, and direct
/// light with cast shadows. `light.occluded` has no say.
[[nodiscard]] Bounce true_bounce(const World& world, const Optics& camera, const Eigen::Isometry3d& world_from_camera,
                                 const SceneLight& light, const TruthOptions& options);

/// The photograph: 8 bits of sRGB, blue first. `visibility` multiplies ambient light; NaN or empty = 1.
[[nodiscard]] cv::Mat3b photograph(const LitImages& lit, const cv::Mat1f& visibility);

/// Linear light as it is stored: blue, green, red.
[[nodiscard]] cv::Mat3b stored_light(const cv::Mat3f& linear);

} // namespace scanshade::scene
