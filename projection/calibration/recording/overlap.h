// How well the depths of different frames agree where they show the same surface.
#pragma once

#include "projection/calibration/model.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <vector>

namespace scanshade::calibration {

/// Mean distance of overlapping surfaces along the optical axis, millimetres. The model (camera and depth correction)
/// lifts each frame's depth; it is transformed into the frames 1, 4 and 10 later and compared with their depth.
/// Distances count as at most 5 % of the depth. A median would hardly react to a wrong focal length, since most
/// surfaces face the camera. `poses` are world_from_camera, one per image. NaN where nothing overlaps.
[[nodiscard]] double overlap_mm(const std::vector<cv::Mat1f>& depths_m, const Model& model,
                                const std::vector<Eigen::Isometry3d>& poses);

} // namespace scanshade::calibration
