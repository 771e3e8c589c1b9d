// How a camera moves: what poses of neighbouring instants say of the time between them.
#pragma once

#include <Eigen/Geometry>

namespace scanshade {

/// What a camera does in a second, as seen by itself: axis times angle, metres. Zero where nothing is known.
struct Motion {
    Eigen::Vector3d turn_per_s = Eigen::Vector3d::Zero(), shift_per_s = Eigen::Vector3d::Zero();
    [[nodiscard]] bool any() const { return turn_per_s.norm() > 0 || shift_per_s.norm() > 0; }
};

/// Between two poses (camera to world) that lie `seconds` apart, seen from `at` between them.
[[nodiscard]] Motion motion_between(const Eigen::Isometry3d& before, const Eigen::Isometry3d& after, double seconds,
                                    const Eigen::Isometry3d& at);

/// A pose on the straight way between two, `share` 0 .. 1 (rotations by spherical interpolation).
[[nodiscard]] Eigen::Isometry3d pose_between(const Eigen::Isometry3d& before, const Eigen::Isometry3d& after,
                                             double share);

} // namespace scanshade
