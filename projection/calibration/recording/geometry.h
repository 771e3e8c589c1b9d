// Small geometry of recordings: poses as six numbers, pixels as rays, pieces of recorded surface.
#pragma once

#include "projection/camera.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>

namespace scanshade::calibration {

/// From the centre of a surface's last pixel to its edge.
inline constexpr double expected_gap_px = 0.5;

/// A rigid transform as axis times angle, then translation.
void to_pose_parameters(const Eigen::Isometry3d& transform, double* pose);
[[nodiscard]] Eigen::Isometry3d pose_from_parameters(const double* pose);

/// The depth of a smooth surface at a pixel: the mean of 3x3, 0 where they do not agree.
[[nodiscard]] double depth_at(const cv::Mat1f& depth_m, const Eigen::Vector2d& pixel);

/// x and y at z = 1 of a pixel's ray, undistorted; still distorted where the lens cannot be inverted.
[[nodiscard]] Eigen::Vector2d undistorted_direction(const Camera& camera, const Eigen::Vector2d& pixel);
/// The same with its z = 1.
[[nodiscard]] Eigen::Vector3d ray_of(const Camera& camera, const Eigen::Vector2d& pixel);

struct SurfacePiece {
    Eigen::Vector3d centre, normal;
};
/// The plane through the 7x7 depths about the pixel of a point in camera space; none near edges and holes.
[[nodiscard]] std::optional<SurfacePiece> surface_at(const cv::Mat1f& depth_m, const Pinhole& camera,
                                                     const Eigen::Vector3d& point);

} // namespace scanshade::calibration
