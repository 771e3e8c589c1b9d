// Copies images and poses to and from a program's buffers.
#pragma once

#include "projection/camera.h"
#include "shaders/shared/neighbour.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <span>

namespace scanshade::gpu {

/// Rows of `image` without gaps; `to` holds as many bytes.
void upload(const cv::Mat& image, std::span<std::byte> to);
/// Depth in metres. Invalid values (not finite, not positive, beyond single precision) become holes here, so shaders
/// only test z > 0.
void upload_depth(const cv::Mat1f& z_m, cv::Mat1f to);
inline void upload_depth(const cv::Mat1f& z_m, std::span<float> to) {
    upload_depth(z_m, cv::Mat1f(z_m.rows, z_m.cols, to.data()));
}
/// A program's buffer as an image, without a copy.
template <class Pixel>
[[nodiscard]] cv::Mat_<Pixel> image_on(std::span<std::byte> buffer, cv::Size size) {
    return cv::Mat_<Pixel>(size.height, size.width, reinterpret_cast<Pixel*>(buffer.data()));
}
[[nodiscard]] shared::NeighbourPlace place_of(const Pinhole& camera, const Eigen::Isometry3d& here_from_there);
[[nodiscard]] cv::Mat1f downloaded(std::span<const float> from, cv::Size size);

} // namespace scanshade::gpu
