// Noise measured from depth, and the plane fit that it steers: what is gained on noisy depth, and what must not be
// lost.
#include "ao/fit_plane/fit_plane.h"
#include "ao/frame.h"
#include "ao/gpu/device.h"
#include "ao/gpu/image_upload.h"
#include "projection/base/error.h"
#include "tests/support/says.h"
#include "tests/support/scenes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

namespace scanshade {
namespace {

using namespace tests;

constexpr double degrees = 180 / 3.14159265358979323846;

/// Independent Gaussian noise of the given law, then the disparity steps of a structured-light sensor.
DepthImage noisy(const DepthImage& clean, const DepthNoise& noise, double step_per_z2 = 0, unsigned seed = 1) {
    DepthImage image{clean.camera, clean.z_m.clone(), {}};
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (float& z : image.z_m) {
        if (z <= 0)
            continue;
        double value = z + noise.at(z) * normal(random);
        if (step_per_z2 > 0)
            value = 1 / (std::round(1 / (value * step_per_z2)) * step_per_z2);
        z = static_cast<float>(value);
    }
    return image;
}

gpu::Device& device() {
    static gpu::Device opened;
    return opened;
}

/// Angle between fitted normals and the plane's own, 8 pixels off the border, sorted.
std::vector<double> normal_errors(const cv::Mat3f& normals, const cv::Vec3d& truth) {
    std::vector<double> errors;
    for (int y = 8; y < normals.rows - 8; ++y)
        for (int x = 8; x < normals.cols - 8; ++x) {
            const cv::Vec3d n = normals(y, x);
            if (cv::norm(n) > 0)
                errors.push_back(degrees * std::acos(std::clamp(n.dot(truth), -1.0, 1.0)));
        }
    std::sort(errors.begin(), errors.end());
    return errors;
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

TEST(fit_plane, noise_no_longer_tilts_normals) {
    // Differences of neighbouring depths tilt by atan(sigma f / z), here 60 degrees; the fit must bring that to 5.
    const Pinhole camera = test_camera({320, 240});
    for (const double z : {1.0, 2.0, 3.0}) {
        const DepthNoise kinect{0.0012, 0.0018};
        FitPlane fit(device(), kinect);
        const FittedDepth fitted = fit.compute(noisy(tilted_plane(camera, 30, z), kinect));
        const double tilt = 30 / degrees;
        const auto errors = normal_errors(fitted.normals.normals, {std::sin(tilt), 0, -std::cos(tilt)});
        ASSERT_GT(errors.size(), 60000U);
        EXPECT_LT(errors[errors.size() / 2], 5) << z << " m";
        EXPECT_LT(errors[errors.size() * 95 / 100], 15) << z << " m";
    }
}

TEST(fit_plane, windows_grow_with_noise) {
    // Ten times a Kinect's noise, and windows of three times the usual width, as CACAO asks for: a radius of sqrt(1.8 *
    // 9 * 0.03
    // * 251 / 2) = 7.8 pixels. At the least radius, 1.5 pixels, half of the normals are off by more than 8.6 degrees.
    const Pinhole camera = test_camera({320, 240});
    const DepthNoise much{0.03, 0};
    FitPlane fit(device(), much, {.smoothing = 3});
    const FittedDepth fitted = fit.compute(noisy(tilted_plane(camera, 30, 2), much));
    const double tilt = 30 / degrees;
    const auto errors = normal_errors(fitted.normals.normals, {std::sin(tilt), 0, -std::cos(tilt)});
    EXPECT_LT(errors[errors.size() / 2], 4);
}

TEST(fit_plane, clean_planes_stay_where_they_are) {
    const Pinhole camera = test_camera({320, 240});
    const DepthImage plane = tilted_plane(camera, 60);
    FitPlane fit(device(), {0.001, 0.001});
    const FittedDepth fitted = fit.compute(plane);
    const double tilt = 60 / degrees;
    const auto errors = normal_errors(fitted.normals.normals, {std::sin(tilt), 0, -std::cos(tilt)});
    EXPECT_LT(errors.back(), 1);
    for (int y = 0; y < plane.z_m.rows; ++y)
        for (int x = 0; x < plane.z_m.cols; ++x)
            ASSERT_NEAR(fitted.depth.z_m(y, x), plane.z_m(y, x), 1e-3 * plane.z_m(y, x)) << x << ", " << y;
}

TEST(fit_plane, edges_stay_within_a_pixel) {
    // A step of 30 cm at 2 m is far beyond 4.5 sigma: no pixel may end up between the two surfaces.
    const Pinhole camera = test_camera({320, 240});
    DepthImage step{camera, cv::Mat1f(camera.size, 2.0F), {}};
    step.z_m.colRange(160, 320) = 2.3F;
    const DepthNoise kinect{0.0012, 0.0018};
    FitPlane fit(device(), kinect);
    const cv::Mat1f z = fit.compute(noisy(step, kinect)).depth.z_m;
    for (int y = 0; y < z.rows; ++y)
        for (int x = 0; x < z.cols; ++x)
            ASSERT_NEAR(z(y, x), x < 160 ? 2.0 : 2.3, 0.06) << x << ", " << y;
}

TEST(fit_plane, a_hole_that_few_other_frames_saw_is_filled_everywhere) {
    // A wall whose middle this frame has lost, and outlines of one pixel; the others stand 5 mm to the side.
    const Pinhole camera = test_camera({320, 240});
    const DepthNoise kinect{0.0012, 0.0018};
    const DepthImage wall = noisy({camera, cv::Mat1f(camera.size, 2.0F), {}}, kinect);
    DepthImage lost{camera, wall.z_m.clone(), {}};
    lost.z_m(cv::Rect(100, 60, 80, 100)) = 0;
    for (int i = 20; i < 80; ++i)
        lost.z_m(i, i) = lost.z_m(i, 300) = 0;
    gpu::ImageUpload upload(device());
    for (const int count : {1, 2, 3}) {
        std::vector<OtherDepth> others;
        for (int i = 0; i < count; ++i) {
            const DepthImage seen =
                noisy({camera, cv::Mat1f(camera.size, 2.0F), {}}, kinect, 0, 5U + static_cast<unsigned>(i));
            Eigen::Isometry3d aside = Eigen::Isometry3d::Identity();
            aside.translation().x() = i % 2 == 0 ? 0.005 : -0.005;
            others.push_back({camera, upload(seen.z_m), aside});
        }
        const cv::Mat1f z = FitPlane(device(), kinect).compute(lost, others).depth.z_m;
        const cv::Mat1b missing(z(cv::Rect(5, 5, 310, 230)) <= 0);
        EXPECT_LT(cv::countNonZero(missing), 10) << count << " others";
        const cv::Mat1b wrong((cv::abs(z - 2) > 0.05) & (z > 0));
        EXPECT_LT(cv::countNonZero(wrong), 10) << count << " others";
    }
}

TEST(fit_plane, a_surface_beyond_what_noise_explains_hardly_counts) {
    // Two exact walls, 22 mm apart with a sigma of 5 mm. The first round takes in what a slope of 45 degrees would
    // explain, so the other wall is just within its tolerance (at 25 mm it no longer is). Tukey's biweight, (1 - (r /
    // tolerance)^2)^2, is next to nothing there, and the second round drops the rest. Weights of one power less
    // leave 9.5 mm at the last column, equal weights 9.3 mm.
    const Pinhole camera = test_camera({320, 240});
    DepthImage step{camera, cv::Mat1f(camera.size, 1.0F), {}};
    step.z_m.colRange(160, 320) = 1.022F;
    FitPlane fit(device(), {0.005, 0});
    const cv::Mat1f z = fit.compute(step).depth.z_m;
    for (int u = 150; u < 160; ++u)
        EXPECT_NEAR(z(120, u), 1, 0.001) << u;
}

TEST(fit_plane, depth_gains_from_the_fit) {
    const Pinhole camera = test_camera({320, 240});
    const DepthImage plane = tilted_plane(camera, 20);
    const DepthNoise kinect{0.0012, 0.0018};
    const DepthImage recorded = noisy(plane, kinect);
    FitPlane fit(device(), kinect);
    const double before = cv::norm(recorded.z_m, plane.z_m),
                 after = cv::norm(fit.compute(recorded).depth.z_m, plane.z_m);
    EXPECT_LT(after, 0.5 * before);
}

TEST(fit_plane, holes_stay_holes_and_invent_nothing) {
    const DepthImage punched = with_holes(ball_on_floor(test_camera()), 0.2);
    FitPlane fit(device(), {0.001, 0.002}, {.drop_flying = false});
    const FittedDepth fitted = fit.compute(punched);
    for (int y = 0; y < punched.z_m.rows; ++y)
        for (int x = 0; x < punched.z_m.cols; ++x) {
            ASSERT_EQ(fitted.depth.z_m(y, x) == 0, punched.z_m(y, x) == 0);
            ASSERT_TRUE(std::isfinite(fitted.depth.z_m(y, x)));
        }
}

/// A near pane before a far one, the last column of either replaced by depths between them: what a time-of-flight pixel
/// reads that both fall into.
DepthImage two_panes(bool with_flying) {
    const Pinhole camera = test_camera({320, 240});
    DepthImage image{camera, cv::Mat1f(camera.size, 1.0F), {}};
    image.z_m.colRange(160, 320) = 1.4F;
    std::mt19937 random(3);
    std::uniform_real_distribution<float> between(1.05F, 1.35F);
    for (int y = 0; with_flying && y < image.z_m.rows; ++y)
        for (int x : {159, 160})
            if (random() % 5 < 3)
                image.z_m(y, x) = between(random);
    return image;
}

TEST(fit_plane, flying_pixels_are_dropped_and_nothing_else) {
    const DepthNoise tof{0.001, 0.0006};
    const DepthImage clean = two_panes(false), flown = two_panes(true);
    FitPlane fit(device(), tof);
    int flying = 0, left = 0, lost = 0;
    const cv::Mat1f kept = fit.compute(noisy(flown, tof)).depth.z_m;
    for (int y = 0; y < kept.rows; ++y)
        for (int x = 0; x < kept.cols; ++x) {
            const bool flies = flown.z_m(y, x) != clean.z_m(y, x);
            flying += flies;
            left += flies && kept(y, x) > 0;
            lost += !flies && !(kept(y, x) > 0);
        }
    EXPECT_GT(flying, 200);
    EXPECT_LT(left, flying / 20);
    EXPECT_LT(lost, flying / 4); // single pixels of a surface among flying ones
    EXPECT_EQ(cv::countNonZero(fit.compute(noisy(clean, tof)).depth.z_m), clean.z_m.total());
}

/// A floor below a level camera; `row_of` says which row of the sensor each image row shows.
template <class RowOf>
DepthImage floor_seen(double height_m, const RowOf& row_of) {
    const Pinhole camera = test_camera({320, 240});
    DepthImage image{camera, cv::Mat1f(camera.size, 0.0F), {}};
    for (int y = static_cast<int>(camera.cy) + 20; y < image.z_m.rows; ++y)
        image.z_m.row(y) = static_cast<float>(height_m * camera.fy / (row_of(y) - camera.cy));
    return image;
}

/// Alignment to a colour image of more rows doubles rows of depth, or interpolates them. On a floor, one row is as far
/// from the next as a surface from another.
TEST(fit_plane, floors_keep_their_rows_however_depth_was_resampled) {
    const DepthNoise noise{0.0005, 0.001};
    FitPlane fit(device(), noise);
    const auto doubled = [](int y) { return y - y % 2; };
    const auto interpolated = [](int y) { return y % 3 == 0 ? y + 0.5 : y; };
    for (const DepthImage& seen :
         {floor_seen(0.25, [](int y) { return y; }), floor_seen(0.25, doubled), floor_seen(0.25, interpolated)}) {
        const cv::Mat1f kept = fit.compute(noisy(seen, noise)).depth.z_m;
        const int top = static_cast<int>(seen.camera.cy) + 28; // where five rows above tell of the slope
        EXPECT_GT(cv::countNonZero(kept.rowRange(top, kept.rows)), 0.995 * 320 * (kept.rows - top));
    }
}

/// A sensor matches windows, so a value may belong half a pixel above or below. At a grazing angle that is far.
TEST(fit_plane, lateral_noise_does_not_tilt_a_floor) {
    const DepthNoise noise{0.0005, 0.001};
    FitPlane fit(device(), noise);
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    DepthImage seen = floor_seen(1, [](int y) { return y; });
    for (int y = 0; y < seen.z_m.rows; ++y)
        for (float& z : seen.z_m.row(y))
            if (z > 0)
                z = static_cast<float>(seen.camera.fy / (y + 0.5 * normal(random) - seen.camera.cy));
    const std::vector<double> errors = normal_errors(fit.compute(noisy(seen, noise)).normals.normals, {0, -1, 0});
    EXPECT_GT(errors.size(), 0.95 * 304 * (cv::countNonZero(seen.z_m) / 320.0 - 8));
    EXPECT_LT(errors[errors.size() / 2], 2.5);
    EXPECT_LT(errors[errors.size() * 19 / 20], 13);
}

TEST(fit_plane, a_wire_is_no_flying_pixel) {
    const Pinhole camera = test_camera({320, 240});
    DepthImage wires{camera, cv::Mat1f(camera.size, 2.0F), {}};
    wires.z_m.col(20).rowRange(0, 200) = 1.5F;
    wires.z_m.row(230) = 1.4F;
    for (int i = 0; i < 180; ++i)
        wires.z_m(10 + i, 60 + i) = 1.6F;
    FitPlane fit(device(), {0.001, 0.0005});
    const cv::Mat1f kept = fit.compute(wires).depth.z_m;
    EXPECT_EQ(cv::countNonZero(kept),
              kept.total() - 6); // the last pixel at either end of a wire has one neighbour only
}

TEST(fit_plane, without_smoothing_depth_is_as_recorded) {
    const DepthImage flown = two_panes(true);
    FitPlane fit(device(), {0.001, 0.0006}, {.smoothing = 0});
    const FittedDepth fitted = fit.compute(flown);
    EXPECT_TRUE(fitted.normals.normals.empty());
    for (int y = 0; y < flown.z_m.rows; ++y)
        for (int x = 0; x < flown.z_m.cols; ++x)
            ASSERT_TRUE(fitted.depth.z_m(y, x) == 0 || fitted.depth.z_m(y, x) == flown.z_m(y, x));
    EXPECT_LT(cv::countNonZero(fitted.depth.z_m), flown.z_m.total());
    for (const std::string& message : device().validation_messages())
        ADD_FAILURE() << message;
}

TEST(fit_plane, what_stays_on_the_device_is_what_the_host_would_have_sent) {
    const DepthNoise kinect{0.0015, 0.0018, 2};
    DepthImage depth = noisy(ball_on_floor(test_camera({321, 239})), kinect);
    depth.z_m(cv::Rect(40, 50, 9, 7)) = 0;
    for (const char* name : {"cacao", "hbao", "surfel", "raycast"}) {
        const auto method = method_named(name).setup()->make(device());
        FitPlane fit(device(), kinect);
        const FittedDepth fitted = fit.compute(depth);
        const cv::Mat1f by_host = method->compute({{fitted.depth, fitted.normals}, kinect, true}).visibility;
        FrameAo on_device(device(), *method, {.fill_holes = false}); // the host leaves holes open
        const cv::Mat1f stayed = on_device.compute(depth, kinect).visibility;
        EXPECT_EQ(std::memcmp(by_host.data, stayed.data, by_host.total() * 4), 0) << name;
        // And what the host sends next is not what stayed there.
        EXPECT_EQ(std::memcmp(method->compute({{fitted.depth, fitted.normals}, kinect, true}).visibility.data,
                              by_host.data, by_host.total() * 4),
                  0)
            << name;
    }
}

} // namespace
} // namespace scanshade
