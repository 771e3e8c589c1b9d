// Whether two depth images agree with the motion between their poses, or would if all depths were multiplied, or if the
// poses were read in another way.
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

/// What poses may have been written as, in place of world_from_camera with y down and z forward.
enum class PoseReading {
    recorded,
    inverse,      ///< camera_from_world
    y_up,         ///< of a camera with y up and z backward, as OpenGL, Blender and ARKit have it
    inverse_y_up, ///< both
    w_first,      ///< quaternions as w x y z
    contradicted  ///< none of these: views agree better if the camera is thought to stand still
};

/// How poses must be read so that both views show the same surfaces. Nothing where they do not tell.
[[nodiscard]] std::optional<PoseReading> pose_reading(const PosedDepth& a, const PosedDepth& b);

} // namespace scanshade
