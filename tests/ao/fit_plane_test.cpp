// Planes fitted to noisy depth: what is gained, and what must not be lost.
#include "ao/fit_plane/fit_plane.h"
#include "ao/frame.h"
#include "ao/gpu/device.h"
#include "ao/gpu/image_upload.h"
#include "tests/support/noisy.h"
#include "tests/support/scenes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <random>

namespace scanshade {
namespace {

using namespace tests;

constexpr double degrees = 180 / 3.14159265358979323846;

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

/// Of a joint's depth, what is left of it in the middle of its three pixels.
double joint_left(const DepthNoise& noise) {
    constexpr double deeper_m = 0.015;
    const auto is_joint = [](int x) { return x % 24 < 3; };
    DepthImage wall{test_camera({320, 240}), cv::Mat1f(240, 320), {}};
    for (int y = 0; y < 240; ++y)
        for (int x = 0; x < 320; ++x)
            wall.z_m(y, x) = static_cast<float>(2 + (is_joint(x) ? deeper_m : 0));
    FitPlane fit(device(), noise);
    const cv::Mat1f z_m = fit.compute(noisy(wall, noise)).depth.z_m;
    double left = 0, count = 0;
    for (int x = 24; x + 24 <= 320; x += 24, ++count)
        left += cv::mean(z_m.col(x + 1))[0] - cv::mean(z_m.col(x + 13))[0];
    return left / (deeper_m * count);
}

TEST(fit_plane, small_shapes_stay_where_each_pixel_errs_by_itself) {
    EXPECT_GT(joint_left({0.004, 0, 1}), 0.65);
    EXPECT_LT(joint_left({0.004, 0, 1.6}), 0.55); // noise over more pixels may be as large
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
