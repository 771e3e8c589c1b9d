// Noise measured from depth: its law, its correlation, and the sensor's steps.
#include "ao/fit_plane/fit_plane.h"
#include "ao/gpu/device.h"
#include "projection/base/error.h"
#include "tests/support/noisy.h"
#include "tests/support/says.h"
#include "tests/support/scenes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

namespace scanshade {
namespace {

using namespace tests;

gpu::Device& device() {
    static gpu::Device opened;
    return opened;
}

TEST(noise, clean_depth_has_none) {
    // Second differences of 1/z vanish on planes; what a scene's edges and curves add is the far tail.
    const std::vector<DepthImage> images{tilted_plane(test_camera({320, 240}), 40),
                                         ball_on_floor(test_camera({320, 240}))};
    EXPECT_FALSE(measure_noise(images).any()) << describe(measure_noise(images));
}

TEST(noise, areas_of_one_value_do_not_hide_it) {
    // One frame of two that is all 1 m, and all beyond 2 m written as 2 m: the sensor has its noise all the same.
    const DepthNoise kinect{0.0015, 0.0018};
    const DepthImage seen = noisy(tilted_plane(test_camera({320, 240}), 60), kinect, 0.0028),
                     other = noisy(ball_on_floor(test_camera({320, 240})), kinect, 0.0028, 2);
    const DepthNoise measured = measure_noise(std::vector{seen, other});
    ASSERT_TRUE(measured.any());
    const DepthImage constant{seen.camera, cv::Mat1f(seen.z_m.size(), 1.0F), {}};
    DepthImage clipped{seen.camera, {}, {}};
    cv::min(seen.z_m, 2.0, clipped.z_m);
    const float near = 1.5F, far = 2.5F;
    for (const auto& images : {std::vector{seen, other, constant}, std::vector{clipped, other}}) {
        const DepthNoise found = measure_noise(images);
        EXPECT_NEAR(found.at(near), measured.at(near), 0.3 * measured.at(near)) << describe(found);
        EXPECT_NEAR(found.at(far), measured.at(far), 0.3 * measured.at(far)) << describe(found);
    }
}

TEST(noise, clutter_is_not_noise) {
    // Blocks of 16 pixels, each its own slanted plane: half of all differences over 4 + 4 pixels straddle an edge.
    const Pinhole camera = test_camera({320, 240});
    DepthImage blocks{camera, cv::Mat1f(camera.size), {}};
    std::mt19937 random(7);
    std::uniform_real_distribution<double> depth(0.8, 4), slope(-1, 1);
    for (int v = 0; v < 240; v += 16)
        for (int u = 0; u < 320; u += 16) {
            const double w = 1 / depth(random), along = slope(random) * w / 500, down = slope(random) * w / 500;
            for (int y = v; y < v + 16; ++y)
                for (int x = u; x < u + 16; ++x)
                    blocks.z_m(y, x) = static_cast<float>(1 / (w + along * (x - u) + down * (y - v)));
        }
    EXPECT_FALSE(measure_noise(std::vector{blocks}).any()) << describe(measure_noise(std::vector{blocks}));
}

TEST(noise, a_known_law_is_measured) {
    const Pinhole camera = test_camera({320, 240});
    const DepthNoise kinect{0.001, 0.0018};
    std::vector<DepthImage> images;
    for (const double z : {1.0, 2.0, 3.0, 4.0})
        images.push_back(noisy(tilted_plane(camera, 35, z), kinect));
    const DepthNoise measured = measure_noise(images);
    for (const double z : {1.0, 2.0, 3.0, 4.0})
        EXPECT_NEAR(measured.at(z), kinect.at(z), 0.2 * kinect.at(z)) << z << " m";
}

TEST(noise, disparity_steps_count_as_noise) {
    // Steps of q without noise have a deviation of q / sqrt(12) on a slope.
    const Pinhole camera = test_camera({320, 240});
    const std::vector<DepthImage> images{noisy(tilted_plane(camera, 30, 2), {}, 2.85e-3)};
    const double q = 2.85e-3 * 4;
    EXPECT_NEAR(measure_noise(images).at(2), q / std::sqrt(12.0), 0.5 * q / std::sqrt(12.0));
}

TEST(noise, correlation_length_is_that_of_the_sensors_window) {
    // White noise under a Gaussian window of deviation d correlates by exp(-x^2 / 4 d^2), whose integral is 2 d
    // sqrt(pi).
    const Pinhole camera = test_camera({320, 240});
    const DepthImage clean = tilted_plane(camera, 35, 2);
    const DepthImage white = noisy(clean, {0.01, 0});
    EXPECT_NEAR(measure_noise(std::vector{white}).correlation_px, 1, 0.3);
    for (const double deviation : {0.8, 1.2}) {
        DepthImage grained{camera, {}, {}};
        cv::GaussianBlur(white.z_m - clean.z_m, grained.z_m, {11, 11}, deviation);
        const double correlation_px = 2 * deviation * std::sqrt(std::numbers::pi);
        // The blur divided the deviation by the correlation length, once along either axis.
        grained.z_m = clean.z_m + correlation_px * grained.z_m;
        const DepthNoise measured = measure_noise(std::vector{grained});
        EXPECT_NEAR(measured.correlation_px, correlation_px, 0.15 * correlation_px);
        EXPECT_NEAR(measured.at(2), 0.01, 0.0015);
    }
}

/// A Kinect whose driver smooths: on the steps of disparity hardly anything differs, and between them much.
TEST(noise, smoothed_steps_hide_none_of_it) {
    const Pinhole camera = test_camera({320, 240});
    constexpr double step_per_z2 = 2.85e-3;
    std::vector<DepthImage> images;
    double squares = 0, count = 0; // of the errors in z^2
    for (const double z : {1.5, 2.5, 4.0, 5.5}) {
        const DepthImage clean = tilted_plane(camera, 20, z);
        cv::Mat1f disparity = noisy(clean, {0, 2.5 * step_per_z2}, 0, static_cast<unsigned>(z * 10)).z_m;
        disparity = 1 / disparity - 1 / clean.z_m; // white, then in waves, then in steps, then smoothed
        cv::GaussianBlur(disparity, disparity, {}, 2.5);
        disparity += 1 / clean.z_m;
        for (float& w : disparity)
            w = static_cast<float>(std::round(w / step_per_z2) * step_per_z2);
        cv::GaussianBlur(disparity, disparity, {}, 1);
        DepthImage recorded{camera, cv::Mat1f(1 / disparity), {}};
        for (float& m : recorded.z_m)
            m = std::round(m * 1000) / 1000;
        for (int y = 10; y < 230; ++y)
            for (int x = 10; x < 310; ++x) {
                const double error = (recorded.z_m(y, x) - clean.z_m(y, x)) / std::pow(clean.z_m(y, x), 2);
                squares += error * error, ++count;
            }
        images.push_back(recorded);
    }
    const DepthNoise measured = measure_noise(images);
    const double per_z2 = std::sqrt(squares / count);
    EXPECT_NEAR(measured.at(4) / 16, per_z2, 0.25 * per_z2) << describe(measured);
    EXPECT_GT(measured.correlation_px, 5) << describe(measured);
}

/// Depth of a Kinect: disparity that errs by `sigma` steps, alike within some pixels (by exp(-d^2 / 4 blur^2)), and
/// comes in whole steps. `errors` gains what it errs by, in z^2.
DepthImage in_disparity_steps(const DepthImage& clean, double sigma, double step_per_z2, unsigned seed,
                              std::vector<double>& errors, double blur_px = 2.3) {
    const DepthImage white = noisy({clean.camera, cv::Mat1f(clean.z_m.size(), 1.0F), {}}, {1, 0}, 0, seed);
    cv::Mat1f waves;
    cv::GaussianBlur(white.z_m - 1, waves, {}, blur_px);
    waves *= sigma * step_per_z2 * 2 * blur_px * std::sqrt(std::numbers::pi);
    DepthImage recorded{clean.camera, clean.z_m.clone(), {}};
    for (int y = 0; y < waves.rows; ++y)
        for (int x = 0; x < waves.cols; ++x) {
            const double z = clean.z_m(y, x), w = std::round((1 / z + waves(y, x)) / step_per_z2) * step_per_z2;
            recorded.z_m(y, x) = static_cast<float>(1 / w);
            errors.push_back((1 / w - z) / (z * z));
        }
    return recorded;
}

double root_mean_square(const std::vector<double>& values) {
    double squares = 0;
    for (const double value : values)
        squares += value * value;
    return std::sqrt(squares / static_cast<double>(values.size()));
}

TEST(noise, whole_steps_hide_none_of_it) {
    // Half of the second differences over 4 pixels are 0, and over 8 still a third: what grows from lag to lag, and
    // then no longer, is noise. By differences over 4 pixels alone it is less than two thirds of what it is.
    std::vector<DepthImage> images;
    std::vector<double> errors;
    for (const double z : {1.2, 1.8, 2.6, 3.6})
        images.push_back(in_disparity_steps(tilted_plane(test_camera({320, 240}), 15, z), 0.5, 2.85e-3,
                                            static_cast<unsigned>(10 * z), errors));
    const DepthNoise measured = measure_noise(images);
    for (const double z : {1.2, 2.0, 3.0})
        EXPECT_NEAR(measured.at(z) / (z * z), root_mean_square(errors), 0.2 * root_mean_square(errors))
            << z << " m: " << describe(measured);
}

TEST(noise, jumps_between_steps_do_not_hide_that_disparity_comes_from_windows) {
    std::vector<DepthImage> images;
    std::vector<double> errors;
    for (const double z : {1.2, 1.8, 2.6, 3.6})
        images.push_back(in_disparity_steps(tilted_plane(test_camera({320, 240}), 15, z), 0.2, 2.85e-3,
                                            static_cast<unsigned>(10 * z), errors, 1));
    EXPECT_GE(measure_noise(images).correlation_px, 2.8) << "2.6 by adjacent pixels";
    // Steps far below the noise hide nothing: depth of a 16-bit buffer, and pixels that err each by itself.
    DepthImage buffered = noisy(tilted_plane(test_camera({320, 240}), 30, 2), {0.004, 0});
    for (float& z : buffered.z_m)
        z = static_cast<float>(1 / (std::round(1 / z / 1.5e-4) * 1.5e-4));
    EXPECT_LT(measure_noise(std::vector{buffered}).correlation_px, 1.4)
        << describe(measure_noise(std::vector{buffered}));
}

TEST(noise, surfaces_that_bend_add_nothing_to_noise_over_more_pixels) {
    // Waves of curtains, 60 pixels long: second differences over 4 pixels are mostly noise, over 12 mostly waves.
    std::vector<DepthImage> images;
    std::vector<double> errors;
    for (const double z : {1.4, 1.9, 2.5, 3.2}) {
        DepthImage curtain{test_camera({320, 240}), cv::Mat1f(240, 320), {}};
        for (int y = 0; y < 240; ++y)
            for (int x = 0; x < 320; ++x)
                curtain.z_m(y, x) =
                    static_cast<float>(z + 0.002 * y + 0.01 * z * z * std::sin(x * std::numbers::pi / 30));
        images.push_back(in_disparity_steps(curtain, 0.6, 2.85e-3, static_cast<unsigned>(10 * z), errors));
    }
    const DepthNoise measured = measure_noise(images);
    for (const double z : {1.5, 2.0, 3.0})
        EXPECT_NEAR(measured.at(z) / (z * z), root_mean_square(errors), 0.25 * root_mean_square(errors))
            << z << " m: " << describe(measured);
}

TEST(noise, relief_is_no_correlation_of_pixels_that_err_by_themselves) {
    // Brickwork: rows of 28 pixels, and joints of 4 that lie 15 mm deeper. Over 4 pixels it looks like noise whose
    // pixels correlate over 1.4 pixels, and 1.3 times as large.
    const DepthNoise tof{0.004, 0};
    DepthImage wall{test_camera({320, 240}), cv::Mat1f(240, 320), {}};
    for (int y = 0; y < 240; ++y)
        for (int x = 0; x < 320; ++x) {
            const bool joint = y % 32 < 4 || (x + y / 32 % 2 * 32) % 64 < 4;
            wall.z_m(y, x) = static_cast<float>(2.5 + 0.001 * x + (joint ? 0.015 : 0));
        }
    const DepthNoise measured = measure_noise(std::vector{noisy(wall, tof)});
    EXPECT_LT(measured.correlation_px, 1.25) << describe(measured);
    EXPECT_NEAR(measured.at(2.6), 0.004, 0.0006) << describe(measured);
}

TEST(noise, bands_of_one_value_have_no_say) {
    // Two marks of what is beyond the range, far apart and alike in size.
    const DepthNoise tof{0.003, 0.001};
    DepthImage marked = noisy(tilted_plane(test_camera({320, 240}), 30, 2), tof);
    marked.z_m.rowRange(0, 60) = 9;
    marked.z_m.rowRange(60, 120) = 20;
    EXPECT_NEAR(measure_noise(std::vector{marked}).at(2), tof.at(2), 0.2 * tof.at(2))
        << describe(measure_noise(std::vector{marked}));
}

TEST(noise, a_wall_on_few_steps_has_no_say_where_others_tell) {
    // Five steps across the wall, with hardly a jump on any.
    std::vector<DepthImage> images;
    std::vector<double> errors, none;
    for (const double z : {1.2, 1.8, 2.6, 4.4})
        images.push_back(in_disparity_steps(tilted_plane(test_camera({320, 240}), 15, z), 0.8, 2.85e-3,
                                            static_cast<unsigned>(10 * z), errors));
    for (unsigned seed = 1; seed <= 4; ++seed)
        images.push_back(in_disparity_steps(tilted_plane(test_camera({320, 240}), 3, 4.4), 0.02, 2.85e-3, seed, none));
    const DepthNoise measured = measure_noise(images);
    for (const double z : {1.5, 2.5, 4.4})
        EXPECT_NEAR(measured.at(z) / (z * z), root_mean_square(errors), 0.25 * root_mean_square(errors))
            << z << " m: " << describe(measured);
}

/// The farthest wall of a Kinect's picture shows one value or two; its depth is not exact for that.
TEST(noise, is_no_smaller_than_a_step_explains) {
    const Pinhole camera = test_camera({320, 240});
    std::vector<DepthImage> walls;
    for (int k = 0; k < 60; ++k)
        walls.push_back(noisy(tilted_plane(camera, 0, 1 + 0.07 * k), {0, 0.0002}, 0.003));
    EXPECT_GT(measure_noise(walls).at(5), 25 * 0.003 / std::sqrt(12.0) * 0.7);
}

TEST(noise, steps_are_told_and_nothing_is_taken_for_one) {
    const Pinhole camera = test_camera({320, 240});
    const DepthImage slope = tilted_plane(camera, 50, 2), unquantised = noisy(slope, {0.002, 0.001});
    const DepthNoise disparity = measure_noise(std::vector{noisy(slope, {0.0012, 0.0018}, 2.85e-3)});
    EXPECT_NEAR(disparity.step_per_z2, 2.85e-3, 0.05 * 2.85e-3);
    EXPECT_EQ(disparity.step_m, 0);
    for (const double step_m : {0.001, 0.0002}) {
        DepthImage stored{camera, unquantised.z_m.clone(), {}};
        for (float& z : stored.z_m)
            z = static_cast<float>(std::round(z / step_m) * step_m);
        const DepthNoise even = measure_noise(std::vector{stored});
        EXPECT_NEAR(even.step_m, step_m, 0.05 * step_m);
        EXPECT_EQ(even.step_per_z2, 0);
    }
    const DepthNoise none = measure_noise(std::vector{unquantised});
    EXPECT_EQ(none.step_m + none.step_per_z2, 0) << describe(none);
}

TEST(noise, steps_that_grow_are_told_in_a_file_of_millimetres) {
    // Near the camera they are below a millimetre; farther away they are two to six.
    std::vector<DepthImage> images;
    for (const double z : {0.5, 0.6, 0.8, 1.2})
        images.push_back(noisy(tilted_plane(test_camera({320, 240}), 30, z), {0, 0.0009}, 1.6e-3));
    for (DepthImage& image : images)
        for (float& z : image.z_m)
            z = std::round(z * 1000) / 1000;
    const DepthNoise measured = measure_noise(images);
    EXPECT_NEAR(measured.step_per_z2, 1.6e-3, 0.1 * 1.6e-3) << describe(measured);
    EXPECT_EQ(measured.step_m, 0) << describe(measured);
}

/// Blocks of 40 pixels, each its own slanted plane.
DepthImage blocks_of_planes(double far_m) {
    const Pinhole camera = test_camera({320, 240});
    DepthImage blocks{camera, cv::Mat1f(camera.size), {}};
    std::mt19937 random(5);
    std::uniform_real_distribution<double> depth(0.4 * far_m, far_m), slope(-1, 1);
    for (int v = 0; v < 240; v += 40)
        for (int u = 0; u < 320; u += 40) {
            const double w = 1 / depth(random), along = slope(random) * w / 500, down = slope(random) * w / 500;
            for (int y = v; y < v + 40; ++y)
                for (int x = u; x < u + 40; ++x)
                    blocks.z_m(y, x) = static_cast<float>(1 / (w + along * (x - u) + down * (y - v)));
        }
    return blocks;
}

DepthImage stored_in_steps(const DepthImage& exact, double step_m) {
    DepthImage stored{exact.camera, exact.z_m.clone(), {}};
    for (float& z : stored.z_m)
        z = static_cast<float>(std::round(z / step_m) * step_m);
    return stored;
}

TEST(noise, exact_depth_in_steps_has_none) {
    // 1 mm at a metre tilts the surface between adjacent pixels by 1 mm / (z / f), some 20 degrees at most.
    const DepthNoise fine = measure_noise(std::vector{stored_in_steps(blocks_of_planes(3), 0.001)});
    EXPECT_NEAR(fine.step_m, 0.001, 5e-5);
    EXPECT_FALSE(fine.needs_preparation()) << describe(fine);
    const DepthNoise far = measure_noise(std::vector{stored_in_steps(blocks_of_planes(40), 0.01)});
    EXPECT_FALSE(far.needs_preparation()) << describe(far);
}

TEST(noise, coarse_steps_are_smoothed_and_no_pixel_is_dropped) {
    const double step_m = 0.02;
    const DepthImage exact = blocks_of_planes(3), stored = stored_in_steps(exact, step_m);
    const DepthNoise noise = measure_noise(std::vector{stored});
    EXPECT_NEAR(noise.at(1), step_m / std::sqrt(12.0), 1e-3) << describe(noise);
    EXPECT_EQ(noise.per_z2, 0);
    EXPECT_FALSE(noise.flies());
    FitPlane fit(device(), noise);
    const cv::Mat1f fitted = fit.compute(stored).depth.z_m;
    EXPECT_EQ(cv::countNonZero(fitted), static_cast<int>(fitted.total()));
    EXPECT_LT(cv::norm(fitted, exact.z_m, cv::NORM_L1), 0.7 * cv::norm(stored.z_m, exact.z_m, cv::NORM_L1));
}

TEST(noise, steps_hide_no_noise) {
    const DepthImage exact = blocks_of_planes(3);
    const DepthNoise one_step = measure_noise(std::vector{stored_in_steps(noisy(exact, {0.001, 0}), 0.001)});
    EXPECT_GT(one_step.at(2), 0.0009) << describe(one_step);
    EXPECT_LT(one_step.at(2), 0.0016) << describe(one_step);
    EXPECT_TRUE(one_step.flies());
    // Noise that the sensor has smoothed is even from pixel to pixel, and large over a few.
    DepthImage smooth = noisy(exact, {0.03, 0});
    cv::GaussianBlur(smooth.z_m - exact.z_m, smooth.z_m, {13, 13}, 2);
    smooth.z_m += exact.z_m;
    const DepthNoise bumps = measure_noise(std::vector{stored_in_steps(smooth, 0.001)});
    EXPECT_GT(bumps.at(2), 0.002) << describe(bumps);
}

TEST(noise, resized_depth_is_smeared_and_loses_what_belongs_to_no_surface) {
    const DepthImage exact = blocks_of_planes(3);
    EXPECT_EQ(measure_noise(std::vector{exact}).jumps, Jumps::sharp);
    DepthImage resized{exact.camera, {}, {}};
    cv::resize(exact.z_m, resized.z_m, {80, 60}, 0, 0, cv::INTER_NEAREST);
    cv::resize(resized.z_m, resized.z_m, {320, 240}, 0, 0, cv::INTER_LINEAR);
    const DepthNoise noise = measure_noise(std::vector{resized});
    ASSERT_EQ(noise.jumps, Jumps::smeared) << describe(noise);
    EXPECT_FALSE(noise.any()) << describe(noise);
    ASSERT_TRUE(noise.needs_preparation());
    FitPlane fit(device(), noise);
    ASSERT_FALSE(fit.planes());
    const cv::Mat1f kept = fit.compute(resized).depth.z_m;
    int between = 0, left = 0, even = 0, lost = 0;
    for (int y = 8; y < kept.rows - 8; ++y)
        for (int x = 8; x < kept.cols - 8; ++x) {
            const cv::Mat1f around = resized.z_m(cv::Rect(x - 3, y - 3, 7, 7));
            double nearest = 0, farthest = 0;
            cv::minMaxLoc(around, &nearest, &farthest);
            const double z = resized.z_m(y, x), jump = farthest - nearest;
            const bool belongs = jump < 0.1;
            const bool flies = jump > 0.5 && z > nearest + 0.3 * jump && z < farthest - 0.3 * jump;
            between += flies;
            left += flies && kept(y, x) > 0;
            even += belongs;
            lost += belongs && !(kept(y, x) > 0);
        }
    EXPECT_GT(between, 500);
    EXPECT_LT(left, between / 4);
    EXPECT_GT(even, 20000);
    EXPECT_EQ(lost, 0);
}

TEST(noise, text_is_checked) {
    EXPECT_FALSE(noise_from_text("none").any());
    EXPECT_DOUBLE_EQ(noise_from_text("0.001,0.002").at(2), 0.009);
    EXPECT_DOUBLE_EQ(noise_from_text("0.001,0.002,2.5").correlation_px, 2.5);
    for (const char* wrong : {"", "much", "1", "0.1,", "0.1,0.2x", "-1,0", "nan,0", "0,5", "0,0,0.5", "0,0,"})
        EXPECT_TRUE(says(refusal([&] { (void)noise_from_text(wrong); }), "FLOOR,PER_Z2")) << wrong;
}

} // namespace
} // namespace scanshade
