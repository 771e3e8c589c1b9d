// How large the scene of a depth image is.
#pragma once

#include "projection/project.h"

#include <vector>

namespace scanshade {

/// Of every third row and column, those that are no holes; metres. Enough to judge by.
[[nodiscard]] std::vector<float> sampled_depths(const cv::Mat1f& z_m);

/// Depths of a view, and the size of what it shows.
struct SceneExtent {
    double near_m = 0, middle_m = 0, far_m = 0; ///< 1 %, half and 99 % of the depths are less
    double diagonal_m = 0; ///< of the box of the image at the middle depth, as deep as from near to far; 0 = no depth
};
[[nodiscard]] SceneExtent scene_extent(const DepthImage& depth);

} // namespace scanshade
