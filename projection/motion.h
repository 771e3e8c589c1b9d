// The motion of a camera between two poses.
#pragma once

#include <Eigen/Geometry>

namespace scanshade {

/// Velocity of a camera in its own coordinates. Zero if unknown.
struct Motion {
    Eigen::Vector3d rotation_per_s = Eigen::Vector3d::Zero();    ///< axis times angle, radians
    Eigen::Vector3d translation_per_s = Eigen::Vector3d::Zero(); ///< metres
    [[nodiscard]] bool any() const { return rotation_per_s.norm() > 0 || translation_per_s.norm() > 0; }
};

/// Between two poses (camera to world) `seconds` apart, in the coordinates of `at`, a pose between them.
[[nodiscard]] Motion motion_between(const Eigen::Isometry3d& before, const Eigen::Isometry3d& after, double seconds,
                                    const Eigen::Isometry3d& at);

/// Interpolates two poses, `share` 0 .. 1: translation linearly, rotation spherically.
[[nodiscard]] Eigen::Isometry3d pose_between(const Eigen::Isometry3d& before, const Eigen::Isometry3d& after,
                                             double share);

} // namespace scanshade
