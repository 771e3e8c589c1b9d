// Whether two depth images agree with the motion between their poses, or would if all depths were multiplied.
#pragma once

#include "projection/maps.h"

#include <Eigen/Geometry>
#include <optional>

namespace scanshade {

struct PosedDepth {
    DepthImage depth;
    Eigen::Isometry3d world_from_camera;
};

/// The factor for all depths with which both views show the same surfaces: 1 where they do as recorded. Nothing where
/// the motion is too small to tell, the views hardly overlap, or no factor makes them agree (wrong poses or cameras).
[[nodiscard]] std::optional<double> depth_factor_by_poses(const PosedDepth& a, const PosedDepth& b);

} // namespace scanshade
