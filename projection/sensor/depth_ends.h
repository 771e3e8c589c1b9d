// One value at either end of an image's depths that is no surface: a file's mark of holes, or a cut-off range.
#pragma once

#include <opencv2/core.hpp>
#include <optional>

namespace scanshade {

/// A depth beyond which there is none, and that far more pixels hold than hold those next to it.
struct DepthEnd {
    float z_m = 0;
    double share = 0;   ///< of the valid pixels
    bool apart = false; ///< the others are far from it; else they come up to it
};

struct DepthEnds {
    std::optional<DepthEnd> nearest, farthest;
};

/// Of a depth image, 0 = hole. An end is told where depth has noise, for a wall that faces an ideal sensor holds one
/// value, too. Numbers by which programs mark holes are also told where they are apart from the others, or much of the
/// image.
[[nodiscard]] DepthEnds depth_ends(const cv::Mat1f& z_m);

} // namespace scanshade
