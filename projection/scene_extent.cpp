#include "projection/scene_extent.h"

#include <algorithm>
#include <cmath>

namespace scanshade {

std::vector<float> sampled_depths(const cv::Mat1f& z_m) {
    constexpr int every = 3;
    const auto along = [](int count) { return static_cast<std::size_t>((count + every - 1) / every); };
    std::vector<float> depths(along(z_m.rows) * along(z_m.cols));
    std::size_t found = 0;
    for (int v = 0; v < z_m.rows; v += every) {
        const float* row = z_m[v];
        for (int u = 0; u < z_m.cols; u += every) {
            depths[found] = row[u];
            found += row[u] > 0;
        }
    }
    depths.resize(found);
    return depths;
}

SceneExtent scene_extent(const DepthImage& depth) {
    std::vector<float> depths = sampled_depths(depth.z_m);
    constexpr std::size_t fewest = 3;
    if (depths.size() < fewest)
        return {};
    // The middle first: then the others have only their halves to search, without it.
    const auto rank = [&](double share) {
        return depths.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(depths.size() - 1));
    };
    const auto near = rank(0.01), middle = rank(0.5), far = rank(0.99);
    std::nth_element(depths.begin(), middle, depths.end());
    std::nth_element(depths.begin(), near, middle);
    if (far != middle)
        std::nth_element(middle + 1, far, depths.end());
    SceneExtent scene{*near, *middle, *far};
    const Pinhole& camera = depth.camera;
    scene.diagonal_m = std::hypot(scene.middle_m * camera.size.width / camera.fx,
                                  scene.middle_m * camera.size.height / camera.fy, scene.far_m - scene.near_m);
    return scene;
}

} // namespace scanshade
