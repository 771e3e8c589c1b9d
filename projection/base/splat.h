// A Gaussian about a point, as trained scenes have them (Kerbl et al., "3D Gaussian Splatting", 2023).
#pragma once

#include <Eigen/Geometry>

namespace scanshade {

/// Splats below this opacity are haze: trained scenes have them by the thousand in the air. They belong to no surface.
inline constexpr float haze_opacity = 0.05F;

/// Its covariance is R S^2 R^T with R the rotation and S the sigmas. At a distance of x sigmas from its middle it takes
/// the share opacity e^(-x^2 / 2) of the light.
struct Splat {
    Eigen::Quaternionf rotation = Eigen::Quaternionf::Identity(); ///< of its axes, unit
    Eigen::Vector3f sigma = Eigen::Vector3f::Zero();              ///< along the axes, in the unit of the points
    float opacity = 0;                                            ///< 0 .. 1; 0 where nothing of it can be used
};

} // namespace scanshade
