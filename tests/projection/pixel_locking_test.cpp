// Disparities that a stereo matcher pulls towards whole pixels are told from even ones, and how far they are pulled.
#include "projection/sensor/noise.h"
#include "projection/sensor/pixel_locking.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

namespace scanshade {
namespace {

using namespace tests;

constexpr double disparity_px_m = 40, steps_per_px = 16; // 0.075 m between cameras of 533 pixels

/// 1/z as a matcher finds it that pulls disparities by up to `pull_px` towards the next whole one.
double matched(double inverse_m, double pull_px) {
    const double disparity = inverse_m * disparity_px_m,
                 pulled = disparity - pull_px * std::sin(2 * std::numbers::pi * disparity);
    return std::round(pulled * steps_per_px) / steps_per_px / disparity_px_m;
}

/// Two slanted walls, from 1 to 4 m.
DepthImage walls(double pull_px) {
    DepthImage image{test_camera({640, 480}), cv::Mat1f(480, 640), {}};
    for (int y = 0; y < 480; ++y)
        for (int x = 0; x < 640; ++x)
            image.z_m(y, x) =
                static_cast<float>(1 / matched(0.25 + 0.75 * std::abs(x - 320) / 320.0 + 0.0002 * y, pull_px));
    return image;
}

std::vector<float> inverse_depths(double low, double high, double pull_px) {
    std::vector<float> inverse_m;
    for (int i = 0; i < 5000; ++i)
        inverse_m.push_back(static_cast<float>(matched(low + (high - low) * i / 5000, pull_px)));
    return inverse_m;
}

constexpr double step = 1 / disparity_px_m / steps_per_px;

TEST(pixel_locking, deviation_is_that_of_the_pull) {
    for (const double pull_px : {0.1, 0.15})
        EXPECT_NEAR(locking_of(inverse_depths(0.25, 1, pull_px), step) * disparity_px_m, pull_px / std::sqrt(2.0),
                    0.2 * pull_px)
            << pull_px;
}

TEST(pixel_locking, a_step_need_not_be_exact) {
    const double exact = locking_of(inverse_depths(0.25, 1, 0.15), step);
    for (const double factor : {0.96, 1.04})
        EXPECT_NEAR(locking_of(inverse_depths(0.25, 1, 0.15), factor * step), exact, 0.1 * exact) << factor;
}

TEST(pixel_locking, even_disparities_and_walls_at_one_distance_have_none) {
    EXPECT_EQ(locking_of(inverse_depths(0.25, 1, 0), step), 0);
    EXPECT_EQ(locking_of(inverse_depths(0.4, 0.41, 0.15), step), 0) << "too few pixels of disparity to tell";
    EXPECT_EQ(locking_of(inverse_depths(0.4, 0.4, 0), step), 0);
    EXPECT_EQ(locking_of({}, step), 0);
}

TEST(pixel_locking, areas_of_one_value_and_walls_at_several_distances_have_none) {
    const std::vector<float> even = inverse_depths(0.25, 1, 0);
    const auto with_walls = [&even](const std::vector<double>& disparities) {
        std::vector<float> inverse_m = even;
        for (const double disparity : disparities)
            inverse_m.insert(inverse_m.end(), 3000, static_cast<float>(matched(disparity / disparity_px_m, 0)));
        return inverse_m;
    };
    EXPECT_EQ(locking_of(with_walls({20}), step), 0);
    EXPECT_EQ(locking_of(with_walls({12, 31}), step), 0);
    EXPECT_EQ(locking_of(with_walls({11.1, 20.9, 34.1}), step), 0);
}

TEST(pixel_locking, adds_to_the_noise_of_disparity) {
    const auto sigma = [](double pull_px) {
        const DepthImage image = walls(pull_px);
        return measure_noise({&image, 1}).per_z2 * disparity_px_m;
    };
    EXPECT_LT(sigma(0), 0.05);
    EXPECT_NEAR(sigma(0.15), 0.15 / std::sqrt(2.0), 0.04);
}

} // namespace
} // namespace scanshade
