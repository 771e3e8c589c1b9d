// Whether a cloud's coordinates were rounded so coarsely that its surfaces are steps.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace scanshade {

struct CoordinateSteps {
    int axis = 0;                  ///< the one of the largest step
    double step = 0;               ///< the distance between neighbouring values
    bool single_precision = false; ///< as floats of 32 bits round coordinates of that size
    bool in_all = false;           ///< the same step along all axes, as of a grid of voxels
};

/// Nothing where steps are fine for points that are `spacing` apart. A grid of heights has steps along two axes, and a
/// scanner that moves from profile to profile along one; both are as they should be.
[[nodiscard]] std::optional<CoordinateSteps> coarse_steps(std::span<const Eigen::Vector3d> points, double spacing);

} // namespace scanshade
