#include "projection/scene_extent.h"

#include "projection/base/statistics.h"

#include <cmath>

namespace scanshade {

std::vector<double> sampled_depths(const cv::Mat1f& z_m) {
    std::vector<double> depths;
    for (int v = 0; v < z_m.rows; v += 3)
        for (int u = 0; u < z_m.cols; u += 3)
            if (z_m(v, u) > 0)
                depths.push_back(z_m(v, u));
    return depths;
}

SceneExtent scene_extent(const DepthImage& depth) {
    std::vector<double> depths = sampled_depths(depth.z_m);
    constexpr std::size_t fewest = 3;
    if (depths.size() < fewest)
        return {};
    SceneExtent scene{quantile(depths, 0.01), quantile(depths, 0.5), quantile(depths, 0.99)};
    const Pinhole& camera = depth.camera;
    scene.diagonal_m = std::hypot(scene.middle_m * camera.size.width / camera.fx,
                                  scene.middle_m * camera.size.height / camera.fy, scene.far_m - scene.near_m);
    return scene;
}

} // namespace scanshade
