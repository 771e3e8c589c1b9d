// The pixels of PCL's compressed images (.pclzf): depth and colour as PCL's recorders write them.
#pragma once

#include "io/images/image_check.h"

#include <filesystem>
#include <opencv2/core.hpp>
#include <string_view>

namespace scanshade {

/// The image in bytes that check_image() has passed, `facts` being what it said: depth as CV_16UC1 with the numbers as
/// stored, colour of all kinds as CV_8UC3 in BGR. Throws Error naming `file` where the packed data are damaged.
[[nodiscard]] cv::Mat decoded_pclzf(std::string_view bytes, const ImageFacts& facts, const std::filesystem::path& file);

} // namespace scanshade
