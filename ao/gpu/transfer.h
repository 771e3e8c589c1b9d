// Images to and from a program's buffers, whatever rows of memory they have on the host.
#pragma once

#include <opencv2/core.hpp>
#include <span>

namespace scanshade::gpu {

/// Rows of `image` side by side; `to` holds as many bytes.
void upload(const cv::Mat& image, std::span<std::byte> to);
/// Depth in metres; what is none (not finite, not positive, beyond what single precision can tell) becomes a hole here, once,
/// so that shaders only ask z > 0.
void upload_depth(const cv::Mat1f& z_m, std::span<float> to);
[[nodiscard]] cv::Mat1f downloaded(std::span<const float> from, cv::Size size);

} // namespace scanshade::gpu
