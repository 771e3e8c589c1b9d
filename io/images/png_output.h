// Images as PNG files, the most common output.
#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace scanshade {

/// The file's bytes (W3C PNG, second edition): grey or BGR, 8 or 16 bits. Throws Error for anything else.
[[nodiscard]] std::string encoded_png(const cv::Mat& image);

} // namespace scanshade
