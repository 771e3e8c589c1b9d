// How well the depths of different frames agree where they show the same surface.
#pragma once

#include "projection/calibration/model.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <vector>

namespace scanshade::calibration {

/// Mean distance of overlapping surfaces along the optical axis, millimetres: each frame's depth lifted by the model
/// (camera and depth correction), moved into frames 1, 4 and 10 later and compared with their depth; what lies farther
/// apart than 5 % of the depth counts as that. (A median hardly sees a wrong focal length: most surfaces face the
/// camera.) `poses` are world_from_camera, one per image. NaN where nothing overlaps.
[[nodiscard]] double overlap_mm(const std::vector<cv::Mat1f>& depths_m, const Model& model,
                                const std::vector<Eigen::Isometry3d>& poses);

/// What the model makes of a recorded depth.
[[nodiscard]] double corrected_m(const Model& model, double z_m);

} // namespace scanshade::calibration
