// Small geometry of recordings: poses as six numbers, pixels as rays, pieces of recorded surface.
#pragma once

#include "projection/camera.h"
#include "projection/motion.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace scanshade::calibration {

/// Between the centre of a surface's last pixel and its edge.
inline constexpr double expected_gap_px = 0.5;
inline constexpr int pose_unknowns = 6, point_unknowns = 3;

/// A rigid transform as axis times angle, then translation.
void to_six(const Eigen::Isometry3d& transform, double* six);
[[nodiscard]] Eigen::Isometry3d from_six(const double* six);

/// The depth of a smooth piece of surface about a pixel: the mean of 3x3, 0 where they do not agree.
[[nodiscard]] double depth_at(const cv::Mat1f& depth_m, const Eigen::Vector2d& pixel);

/// The direction in which a pixel looks as x and y at z = 1; still bent where the lens cannot be undone there.
[[nodiscard]] Eigen::Vector2d straight_of(const Camera& camera, const Eigen::Vector2d& pixel);
/// The same with its z = 1.
[[nodiscard]] Eigen::Vector3d ray_of(const Camera& camera, const Eigen::Vector2d& pixel);

struct SurfacePiece {
    Eigen::Vector3d centre, normal;
};
/// The plane through the 7x7 depths about the pixel that a point (in camera space) falls on; none beside edges and
/// holes.
[[nodiscard]] std::optional<SurfacePiece> surface_at(const cv::Mat1f& depth_m, const Pinhole& camera,
                                                     const Eigen::Vector3d& point);

/// NaN where there are no values.
[[nodiscard]] double median_of(std::vector<double> values);

} // namespace scanshade::calibration
