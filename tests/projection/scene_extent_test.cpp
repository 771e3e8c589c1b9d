// How large the scene of a depth image is: ranks of its depths.
#include "projection/scene_extent.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <vector>

namespace scanshade {
namespace {

/// Depths in no order, a tenth of them holes.
DepthImage image(cv::Size size) {
    DepthImage depth{{500, 400, 0, 0, size}, cv::Mat1f(size), {}};
    cv::RNG random(5);
    for (float& z : depth.z_m)
        z = random.uniform(0, 10) == 0 ? 0 : random.uniform(0.5F, 6.0F);
    return depth;
}

TEST(SceneExtent, has_the_ranks_of_sorted_depths) {
    for (const cv::Size size : {cv::Size(97, 61), cv::Size(12, 4), cv::Size(7, 1)}) {
        const DepthImage depth = image(size);
        std::vector<float> sorted = sampled_depths(depth.z_m);
        std::ranges::sort(sorted);
        if (sorted.size() < 3)
            continue;
        const auto at = [&](double share) {
            return double{sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))]};
        };
        const SceneExtent scene = scene_extent(depth);
        EXPECT_EQ(scene.near_m, at(0.01)) << size;
        EXPECT_EQ(scene.middle_m, at(0.5)) << size;
        EXPECT_EQ(scene.far_m, at(0.99)) << size;
        EXPECT_NEAR(scene.diagonal_m,
                    std::hypot(at(0.5) * size.width / 500, at(0.5) * size.height / 400, at(0.99) - at(0.01)), 1e-9);
    }
}

TEST(SceneExtent, samples_every_third_row_and_column_without_holes) {
    cv::Mat1f z_m(7, 8, 0.0F);
    z_m(0, 0) = 1;
    z_m(3, 6) = 2;
    z_m(4, 6) = 3; // between
    z_m(6, 3) = 4;
    EXPECT_EQ(sampled_depths(z_m), (std::vector<float>{1, 2, 4}));
    EXPECT_TRUE(sampled_depths(cv::Mat1f()).empty());
    EXPECT_EQ(scene_extent({{500, 500, 0, 0, {8, 7}}, cv::Mat1f(7, 8, 0.0F), {}}).diagonal_m, 0);
}

} // namespace
} // namespace scanshade
