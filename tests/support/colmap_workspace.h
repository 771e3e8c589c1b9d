// A small dense workspace as COLMAP leaves it, in any unit.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

namespace scanshade::tests {

/// WIDTH&HEIGHT&1& and the floats.
[[nodiscard]] std::string colmap_map(const cv::Mat1f& map);

struct ColmapWorkspace {
    int frames = 3;
    double unit = 1;                     ///< units for a metre of corner_depth()
    bool text = false;                   ///< lists as text; else binary
    double noise = 0;                    ///< sigma of depth, as a share of it
    int image_scale = 1;                 ///< images have so many times the depth maps' sides
    std::string images_in = {};          ///< "left/": the images' folder below images/
    const char* kind = ".geometric.bin"; ///< of the depth maps
};

/// Frames of one corner, each camera 1 cm further to the left, in `folder`: 0.jpg, 1.jpg and on.
void write_colmap(const std::filesystem::path& folder, const ColmapWorkspace& workspace = {});

} // namespace scanshade::tests
