// A frame as the page shows it: small maps of depth, visibility and confidence with their values, and a small colour
// picture, in one script of some tens of kilobytes. A page opened from disk may read no pixels of images, so values
// under the pointer and points come from here.
#pragma once

#include "projection/camera.h"

#include <opencv2/core.hpp>
#include <string>
#include <string_view>

namespace scanshade::page {

/// What a preview is made of. Maps may be empty; those that are not have one size.
struct Preview {
    cv::Mat1f z_m;                 ///< metres or `unit`, 0 = hole
    cv::Mat1f visibility;          ///< 0 .. 1, NaN = none
    cv::Mat1f confidence = {};     ///< likewise
    cv::Mat1b confidence_map = {}; ///< in place of `confidence`: 0 = none, 1 .. 255 = 0 .. 1
    Pinhole camera = {};           ///< of the maps
    cv::Mat3b colour = {};         ///< may have another size than the maps
    bool colour_fits = false;      ///< it lies on the maps' pixels
    std::string unit = {};         ///< of depth; empty = metres
    cv::Mat1f reference = {};      ///< visibility that `visibility` is compared with
};

/// The longer side of a preview's maps, at most, and of its colour picture.
inline constexpr int map_side = 240, colour_side = 320;

/// The script's text. Maps are taken at every n-th pixel, without averages: an average over a depth edge is no depth.
/// Equal inputs give equal bytes.
[[nodiscard]] std::string preview_script(const Preview& preview);

/// How a depth is stored: 11 bits of the mantissa, so to 1 part in 2000, whatever the range.
inline constexpr int dropped_mantissa_bits = 12;

} // namespace scanshade::page
