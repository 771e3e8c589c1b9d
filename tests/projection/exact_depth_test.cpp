// Exact depth that looks noisy, as renderers and their files leave it: nothing of it is dropped or smoothed.
#include "projection/noise.h"
#include "tests/support/noisy.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <Eigen/Core>
#include <functional>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;

/// A floor 1.5 m below a level camera, and a wall.
DepthImage level_room(cv::Size size, double wall_m) {
    DepthImage room{test_camera(size), cv::Mat1f(size), {}};
    for (int y = 0; y < size.height; ++y) {
        const double down = (y + 0.25 - room.camera.cy) / room.camera.fy;
        room.z_m.row(y) = static_cast<float>(down > 1.5 / wall_m ? 1.5 / down : wall_m);
    }
    return room;
}

/// A plane that is turned about both axes of the image: no row and no column is at one depth.
DepthImage slope(cv::Size size, double z_m, double along, double down) {
    DepthImage plane{test_camera(size), cv::Mat1f(size), {}};
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            plane.z_m(y, x) = static_cast<float>(z_m / (1 + along * (x - plane.camera.cx) / plane.camera.fx +
                                                        down * (y - plane.camera.cy) / plane.camera.fy));
    return plane;
}

std::vector<DepthImage> slopes(cv::Size size = {640, 480}) {
    return {slope(size, 2.5, 0.6, 0.35), slope(size, 4, -0.3, 0.5), slope(size, 1.2, 0.2, -0.7)};
}

std::vector<DepthImage> held(std::vector<DepthImage> images, const std::function<double(double)>& as) {
    for (DepthImage& image : images)
        for (float& z : image.z_m)
            z = static_cast<float>(as(static_cast<double>(z)));
    return images;
}

std::vector<DepthImage> with_noise(std::vector<DepthImage> images, const DepthNoise& noise) {
    for (std::size_t i = 0; i < images.size(); ++i)
        images[i] = noisy(images[i], noise, 0, static_cast<unsigned>(i));
    return images;
}

TEST(exact_depth, rows_of_a_floor_before_a_level_camera_are_no_steps) {
    for (const cv::Size size : {cv::Size(640, 480), cv::Size(320, 240)})
        for (const double unit : {0.0, 1000.0}) {
            const auto stored = [&](double z) { return unit > 0 ? std::round(z * unit) / unit : z; };
            const DepthNoise measured = measure_noise(held({level_room(size, 6)}, stored));
            EXPECT_EQ(measured.at(2), 0) << size << ", " << unit << " a metre: " << describe(measured);
        }
}

TEST(exact_depth, few_digits_are_no_noise) {
    // As OpenEXR files hold it, in 11 binary digits, and as a renderer's depth buffer of 16 bits does, from 0.1 to 20
    // m.
    const auto half = [](double z) {
        return static_cast<double>(static_cast<float>(static_cast<Eigen::half>(static_cast<float>(z))));
    };
    const auto buffered = [](double z) { return 1 / (10 - std::round((10 - 1 / z) / 9.95 * 65535) / 65535 * 9.95); };
    for (const std::function<double(double)>& as : {std::function<double(double)>(half), {buffered}}) {
        const DepthNoise none = measure_noise(held(slopes(), as));
        EXPECT_EQ(none.at(2), 0) << describe(none);
        EXPECT_FALSE(none.flies()) << describe(none);
        const DepthNoise some = measure_noise(held(with_noise(slopes(), {0.002, 0.001}), as));
        EXPECT_NEAR(some.at(2), 0.006, 0.0012) << describe(some);
        EXPECT_LT(some.correlation_px, 1.4) << describe(some);
    }
}

TEST(exact_depth, steps_of_a_power_of_two_are_even_though_16_bit_floats_hold_them) {
    const DepthNoise measured = measure_noise(held(slopes(), [](double z) { return std::round(z * 256) / 256; }));
    EXPECT_NEAR(measured.step_m, 1.0 / 256, 1e-5) << describe(measured);
    EXPECT_FALSE(measured.flies()) << describe(measured);
}

TEST(exact_depth, few_pixels_are_not_noisy_for_that) {
    for (const cv::Size size : {cv::Size(64, 48), cv::Size(96, 72)}) {
        const DepthNoise measured = measure_noise(slopes(size));
        EXPECT_EQ(measured.at(2), 0) << size << ": " << describe(measured);
    }
}

} // namespace
} // namespace scanshade
