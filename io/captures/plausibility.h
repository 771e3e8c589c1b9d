// Checks whether a depth image is plausible. A file does not name its encoding, so the assumed one is checked against
// the range and smoothness of real sensors.
#pragma once

#include "io/images/image_file.h"
#include "projection/base/finding.h"

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace scanshade {

/// Floats that are all negative, as z of cameras that look along -z (OpenGL, Blender), with their signs turned, and a
/// warning. A single number in all pixels is a mark of holes and stays; so does everything else.
[[nodiscard]] cv::Mat looking_along_z(const cv::Mat& stored, std::vector<std::string>& warnings);

/// How 16-bit depth values read in metres: 65536 of them, by value.
using DepthTable = cv::Mat1f;
[[nodiscard]] DepthTable depth_table(const DepthEncoding& encoding);

/// What looks wrong in `depth_m` (decoded from `stored` with `encoding`): no valid depth, a range that
/// no depth sensor has, noise in place of surfaces. Values that are all multiples, rows that are copies of others,
/// and images that were enlarged by copying pixels.
/// Doubts say what other encodings would give.
[[nodiscard]] Findings findings_about(const cv::Mat1f& depth_m, const cv::Mat& stored, const DepthEncoding& encoding);

/// The same without the image in metres. `largest_m`: of all pixels.
[[nodiscard]] Findings findings_about(const cv::Mat1w& stored, const DepthTable& table, float largest_m,
                                      const DepthEncoding& encoding);

} // namespace scanshade
