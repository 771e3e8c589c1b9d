// Pictures as JPEG files, where size counts more than exact pixels.
#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace scanshade {

/// The file's bytes; `quality` 1 .. 100 as libjpeg counts. Throws Error for anything but 8-bit BGR.
[[nodiscard]] std::string encoded_jpeg(const cv::Mat3b& picture, int quality);

} // namespace scanshade
