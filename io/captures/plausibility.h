// Checks whether a depth image is plausible. A file does not name its encoding, so the assumed one is checked against
// the range and smoothness of real sensors.
#pragma once

#include "io/images/image_file.h"

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace scanshade {

/// Sentences about what looks wrong in `depth_m` (decoded from `stored` with `encoding`): no valid depth, a range that
/// no depth sensor has, noise in place of surfaces, values that are all multiples (each says what other encodings would
/// give), rows that are copies of others.
[[nodiscard]] std::vector<std::string> doubts_about(const cv::Mat1f& depth_m, const cv::Mat& stored,
                                                    const DepthEncoding& encoding);

} // namespace scanshade
