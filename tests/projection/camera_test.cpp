// The conventions of projection/camera.h, and cameras recovered from what was recorded.
#include "projection/camera.h"

#include "projection/base/error.h"
#include "projection/fit_pinhole.h"
#include "projection/undistort.h"
#include "tests/support/says.h"
#include "tests/support/scenes.h"

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <random>
#include <thread>

namespace scanshade {
namespace {

using tests::ball_on_floor, tests::says, tests::test_camera, tests::tilted_plane, tests::with_holes;

// The very text that the GPU runs, checked by the C++ compiler: a pixel lifted to a depth falls back onto itself.
constexpr shared::Pinhole gpu_camera{512, 480, 319.5F, 239.5F};
constexpr shared::vec3 lifted = shared::unproject(gpu_camera, {63.5F, 359.5F}, 2);
static_assert(lifted.x == -1 && lifted.y == 0.5F && lifted.z == 2);
static_assert(shared::project(gpu_camera, lifted).x == 63.5F && shared::project(gpu_camera, lifted).y == 359.5F);

// Kinect colour, a wide lens, a strong barrel and a decentred one, as calibrations report them.
const Distortion lenses[] = {{0.2624, -0.9531, -0.0054, 0.0026, 1.1633},
                             {-0.265, -0.047, 0.0018, -0.0003, 0.252},
                             {-0.28, 0.07, 0, 0, 0},
                             {0.01, 0, 0.02, -0.015, 0}};

Camera camera_with(const Distortion& lens) { return {{525, 520, 310.5, 245.25, {640, 480}}, lens, "test"}; }

TEST(Camera, PixelLiftedToAnyDepthFallsBackOntoItself) {
    const shared::Pinhole camera = camera_with({}).pinhole.on_gpu();
    for (float v = 0; v < 480; v += 7)
        for (float u = 0; u < 640; u += 7)
            for (const float z : {0.3F, 2.0F, 100.0F}) {
                const shared::vec2 pixel = shared::project(camera, shared::unproject(camera, {u, v}, z));
                EXPECT_NEAR(pixel.x, u, 2e-4); // single precision at 640 pixels
                EXPECT_NEAR(pixel.y, v, 2e-4);
            }
}

TEST(Camera, WithoutDistortionTheLensIsTheSharedPinhole) {
    const Eigen::Vector2d straight(0.31, -0.27);
    EXPECT_EQ(distorted({}, straight), straight); // exactly: undistorted captures must not change by a bit
    const Pinhole pinhole = camera_with({}).pinhole;
    const shared::vec2 pixel = shared::project(pinhole.on_gpu(), {0.31F * 2, -0.27F * 2, 2});
    EXPECT_NEAR(pixel.x, pinhole.fx * straight.x() + pinhole.cx, 1e-4);
    EXPECT_NEAR(pixel.y, pinhole.fy * straight.y() + pinhole.cy, 1e-4);
}

TEST(Camera, DistortionFollowsOpenCvsFormula) {
    // By hand at (0.5, 0.25): r2 = 0.3125, radial = 1 + 0.1 r2 + 0.01 r2^2 + 0.001 r2^3.
    const double radial = 1 + 0.03125 + 0.0009765625 + 0.000030517578125;
    const Eigen::Vector2d bent = distorted({0.1, 0.01, 0.002, 0.003, 0.001}, {0.5, 0.25});
    EXPECT_NEAR(bent.x(), 0.5 * radial + 2 * 0.002 * 0.125 + 0.003 * (0.3125 + 0.5), 1e-15);
    EXPECT_NEAR(bent.y(), 0.25 * radial + 0.002 * (0.3125 + 0.125) + 2 * 0.003 * 0.125, 1e-15);
}

TEST(Camera, RaysAndPointsAreTheTextbookFormulaToTheBit) {
    const Pinhole camera{523.7, 519.3, 311.9, 241.3, {640, 480}};
    for (const double u : {-0.5, 0.0, 17.0, 311.9, 639.5})
        for (const double v : {-0.5, 0.0, 241.0, 479.5}) {
            const double x = (u - camera.cx) / camera.fx, y = (v - camera.cy) / camera.fy;
            EXPECT_EQ(camera.ray(u, v), Eigen::Vector3d(x, y, 1));
            EXPECT_EQ(camera.point(u, v, 1.7), Eigen::Vector3d(x * 1.7, y * 1.7, 1.7));
        }
}

TEST(Camera, UndistortingReversesDistortingAllOverTheImage) {
    for (const Distortion& lens : lenses) {
        const Camera camera = camera_with(lens);
        const Pinhole& pinhole = camera.pinhole;
        for (int v = 0; v < pinhole.size.height; v += 8)
            for (int u = 0; u < pinhole.size.width; u += 8) {
                const Eigen::Vector2d bent = pinhole.ray(u, v).head<2>();
                const auto straight = undistorted(lens, bent);
                if (!straight)
                    continue; // beyond the lens's fold, see below
                const Eigen::Vector2d miss = distorted(lens, *straight) - bent;
                EXPECT_LT(std::hypot(miss.x() * pinhole.fx, miss.y() * pinhole.fy), 1e-6)
                    << "at pixel " << u << ", " << v;
            }
        EXPECT_TRUE(undistorted(lens, {0.3, 0.2})) << "the middle of the image must be reachable";
    }
}

TEST(Camera, NothingIsSeenBeyondWhereTheLensModelFoldsBack) {
    // r (1 - 0.5 r^2) grows up to r = 0.8165, where it is 0.544: no direction lands farther out.
    const Distortion folding{-0.5, 0, 0, 0, 0};
    EXPECT_TRUE(undistorted(folding, {0.54, 0}));
    EXPECT_FALSE(undistorted(folding, {0.55, 0}));
    // The target pixel at r = 1.2 would bend to 0.336, into the image: a ghost unless it is left out.
    const Camera wide{{100, 100, 160, 120, {320, 240}}, folding, "test"};
    const Undistortion maps(wide);
    const int row = cvRound(maps.straight_camera().cy), middle = cvRound(maps.straight_camera().cx);
    EXPECT_EQ(maps.recorded_pixel()(row, middle + 120), -1);
    EXPECT_NE(maps.recorded_pixel()(row, middle + 70), -1);
}

TEST(Camera, DirectionsBeyondTheFoldAreNoAnswer) {
    // r (1 - 0.3 r^2) grows up to r = 1.054, where it is 0.703: no direction bends farther out. The polynomial has such
    // values again at r = -2 and beyond, where Newton's method ends; they are no directions of a lens.
    const Distortion barrel{-0.3, 0, 0, 0, 0};
    for (double bent = 0; bent < 1.5; bent += 0.01) {
        const auto straight = undistorted(barrel, {bent, 0});
        EXPECT_EQ(straight.has_value(), bent < 0.7027) << bent;
        if (straight) {
            EXPECT_LT(straight->norm(), 1.055) << bent;
            EXPECT_GE(straight->x(), bent);
        }
    }
    // r (1 - 0.8 r^2 + 0.2 r^4) grows up to r = 0.733, where it is 0.460, and again from 1.365 on: 0.914 at 1.8.
    const Distortion twice{-0.8, 0.2, 0, 0, 0};
    for (double bent = 0; bent < 2; bent += 0.01)
        EXPECT_EQ(undistorted(twice, {bent, 0}).has_value(), bent < 0.4601) << bent;
}

TEST(Camera, RecordedPixelsFindTheUndistortedPixelThatShowsThem) {
    for (const Distortion& lens : lenses) {
        const Undistortion maps(camera_with(lens));
        const int width = maps.straight_camera().size.width;
        int shown = 0, same = 0;
        for (int v = 0; v < 480; ++v)
            for (int u = 0; u < 640; ++u)
                if (const int target = maps.undistorted_pixel()(v, u); target >= 0) {
                    const int back = maps.recorded_pixel()(target / width, target % width);
                    if (back < 0)
                        continue; // at the rim rounding may leave the image
                    ++shown;
                    same += back == v * 640 + u;
                    EXPECT_LE(std::abs(back % 640 - u), 2);
                    EXPECT_LE(std::abs(back / 640 - v), 2);
                }
        EXPECT_GT(same, 0.75 * shown); // where the lens shrinks the image, some recorded pixels are shown by none
        EXPECT_GT(shown, 0.99 * 640 * 480);
    }
}

TEST(Camera, TheUndistortedImageShowsTheWholeRecordedOne) {
    for (const Distortion& lens : lenses) {
        const Undistortion maps(camera_with(lens));
        EXPECT_EQ(cv::countNonZero(maps.undistorted_pixel() < 0), 0);
    }
    // A Kinect's colour image is a pincushion: the straight image lies within it, and needs no more pixels.
    EXPECT_EQ(Undistortion(camera_with({0.1, 0, 0, 0, 0})).straight_camera().size, cv::Size(640, 480));
    const Undistortion barrel(camera_with(lenses[2]));
    const Pinhole& straight = barrel.straight_camera();
    EXPECT_EQ(straight.fx, 525);
    for (const cv::Point corner : {cv::Point(0, 0), cv::Point(639, 0), cv::Point(0, 479), cv::Point(639, 479)}) {
        const cv::Vec2f ray = barrel.direction()(corner);
        const int index = barrel.undistorted_pixel()(corner);
        EXPECT_NEAR(straight.fx * ray[0] + straight.cx, index % straight.size.width, 1.5);
        EXPECT_NEAR(straight.fy * ray[1] + straight.cy, index / straight.size.width, 1.5);
    }
}

TEST(Camera, AFisheyesUndistortedImageEndsSomewhere) {
    const Camera wide{{160, 160, 255.5, 255.5, {512, 512}}, kannala_brandt({0, 0, 0, 0}), "92 degrees at the rim"};
    const Undistortion maps(wide);
    EXPECT_EQ(maps.straight_camera().size, cv::Size(1024, 1024));
    EXPECT_NEAR(maps.straight_camera().cx, 255.5 + 256, 1e-12);
    int beyond = 0;
    for (int v = 0; v < 512; ++v)
        for (int u = 0; u < 512; ++u) {
            const cv::Vec2f ray = maps.direction()(v, u);
            const bool in_reach = std::max(std::abs(ray[0]), std::abs(ray[1])) < 511 / 160.0; // not for NaN
            beyond += maps.undistorted_pixel()(v, u) < 0;
            EXPECT_TRUE(!in_reach || maps.undistorted_pixel()(v, u) >= 0) << u << ", " << v;
        }
    EXPECT_GT(beyond, 0);
}

TEST(Camera, AFisheyeBendsAnglesAndIsUndoneUpToItsEdge) {
    const Distortion fisheye = kannala_brandt({0.05, -0.01, 0.002, -0.0003});
    // By hand at 45 degrees: theta = pi / 4, theta^2 = 0.61685; theta (1 + 0.05 t - 0.01 t^2 + 0.002 t^3 - 0.0003 t^4).
    const double t = CV_PI * CV_PI / 16;
    const double bent = CV_PI / 4 * (1 + t * (0.05 + t * (-0.01 + t * (0.002 + t * -0.0003))));
    EXPECT_NEAR(distorted(fisheye, {1, 0}).x(), bent, 1e-12);
    EXPECT_EQ(distorted(fisheye, {0, 0}), Eigen::Vector2d(0, 0));
    for (double degrees = 0; degrees < 88; degrees += 1)
        for (const double around : {0.0, 0.7, 2.5}) {
            const double r = std::tan(degrees * CV_PI / 180);
            const Eigen::Vector2d straight(r * std::cos(around), r * std::sin(around));
            const auto back = undistorted(fisheye, distorted(fisheye, straight));
            ASSERT_TRUE(back) << degrees;
            EXPECT_LT((*back - straight).norm(), 1e-8 * (1 + r * r)) << degrees;
        }
    EXPECT_FALSE(undistorted(fisheye, {1.7, 0})); // 1.7 rad is behind a pinhole's image
}

// Azure Kinect's depth camera, a colour camera of it (k4 .. k6 without sign in common), a wide lens by OpenCV.
const Distortion rational_lenses[] = {
    {0.4321, 0.0187, -0.0000893, -0.0000521, 0.00098, 0.7718, 0.1184, 0.0064},
    {0.5142, -2.6613, 0.0007, -0.0002, 1.5243, 0.3967, -2.4834, 1.4516},
    {5.83, 3.89, 0.0002, -0.0004, 0.21, 6.15, 5.38, 1.02},
};

TEST(Camera, ARationalLensIsOpenCvsBothWays) {
    const cv::Matx33d k(525, 0, 310.5, 0, 520, 245.25, 0, 0, 1);
    for (const Distortion& lens : rational_lenses) {
        const std::vector<double> eight = coefficients(lens);
        ASSERT_EQ(eight.size(), 8U);
        const double edge = std::min(1.2, 0.95 * std::sqrt(fold_r2(lens)));
        std::vector<cv::Point3d> points;
        for (double x = -edge; x <= edge; x += edge / 12)
            for (double y = -edge; y <= edge; y += edge / 12)
                if (std::hypot(x, y) < edge)
                    points.emplace_back(3 * x, 3 * y, 3);
        std::vector<cv::Point2d> pixels;
        cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), k, eight, pixels);
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Eigen::Vector2d straight(points[i].x / 3, points[i].y / 3), bent = distorted(lens, straight);
            EXPECT_NEAR(525 * bent.x() + 310.5, pixels[i].x, 1e-9);
            EXPECT_NEAR(520 * bent.y() + 245.25, pixels[i].y, 1e-9);
            const auto back = undistorted(lens, bent);
            ASSERT_TRUE(back) << straight.transpose();
            EXPECT_LT((*back - straight).norm(), 1e-7) << straight.transpose();
        }
        // OpenCV's fixed-point iteration, where it converges: in the inner half.
        std::vector<cv::Point2d> straight;
        cv::undistortPoints(pixels, straight, k, eight, cv::noArray(), cv::noArray(),
                            cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-12));
        for (std::size_t i = 0; i < points.size(); ++i)
            if (std::hypot(points[i].x, points[i].y) < 3 * edge / 2) {
                const Eigen::Vector2d bent((pixels[i].x - 310.5) / 525, (pixels[i].y - 245.25) / 520);
                const auto found = undistorted(lens, bent);
                ASSERT_TRUE(found);
                EXPECT_NEAR(found->x(), straight[i].x, 1e-7);
                EXPECT_NEAR(found->y(), straight[i].y, 1e-7);
            }
    }
}

TEST(Camera, WithoutADenominatorARationalLensIsThePolynomialToTheBit) {
    for (const Distortion& lens : lenses) {
        const double x = 0.31, y = -0.27, r2 = x * x + y * y;
        const double radial = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
        const Eigen::Vector2d bent = distorted(lens, {x, y});
        EXPECT_EQ(bent.x(), x * radial + 2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x));
        EXPECT_FALSE(lens.rational());
        EXPECT_EQ(coefficients(lens).size(), 5U);
        EXPECT_EQ(brown_conrady(coefficients(lens)), lens);
    }
    for (const Distortion& lens : rational_lenses)
        EXPECT_EQ(brown_conrady(coefficients(lens)), lens);
    const Distortion lower{.k5 = 0.1};
    EXPECT_TRUE(lower.any());
    EXPECT_TRUE(lower.rational());
}

TEST(Camera, ARationalLensEndsWhereItFoldsOrHasAPole) {
    // r / (1 + r^2) grows up to r = 1, where it is 1/2.
    const Distortion folding{.k4 = 1};
    EXPECT_NEAR(fold_r2(folding), 1, 1e-12);
    EXPECT_TRUE(undistorted(folding, {0.499, 0}));
    EXPECT_FALSE(undistorted(folding, {0.501, 0}));
    // r / (1 - r^2 / 4) grows without bound towards r = 2: every pixel sees a direction before it.
    const Distortion pole{.k4 = -0.25};
    EXPECT_NEAR(fold_r2(pole), 4, 1e-12);
    const auto far = undistorted(pole, {100, 0});
    ASSERT_TRUE(far);
    EXPECT_NEAR(far->x() / (1 - far->x() * far->x() / 4), 100, 1e-6);
    EXPECT_LT(far->x(), 2);
    // Numerator and denominator alike: no lens, up to the sign change of both, where a quotient has no value.
    EXPECT_NEAR(fold_r2({.k1 = -0.5, .k4 = -0.5}), 2, 1e-6);
    // Azure's wide modes see 60 degrees off the axis.
    EXPECT_GT(fold_r2(rational_lenses[0]), 3);
    for (const Distortion& lens : rational_lenses) {
        const double end = std::min(fold_r2(lens), 100.0);
        double last = 0;
        for (double r = 0.01; r * r < end; r += 0.01) {
            const double bent = distorted({lens.k1, lens.k2, 0, 0, lens.k3, lens.k4, lens.k5, lens.k6}, {r, 0}).x();
            EXPECT_GT(bent, last) << "grows up to its fold, at " << r << " of " << std::sqrt(end);
            last = bent;
        }
        const double beyond = std::sqrt(end) + 1e-3;
        if (end < 100) {
            EXPECT_LT(distorted({lens.k1, lens.k2, 0, 0, lens.k3, lens.k4, lens.k5, lens.k6}, {beyond + 1e-3, 0}).x(),
                      distorted({lens.k1, lens.k2, 0, 0, lens.k3, lens.k4, lens.k5, lens.k6}, {beyond, 0}).x());
        }
    }
}

TEST(Camera, ARationalLensMapsWholeImages) {
    const Camera camera{{252, 252, 255.5, 255.5, {512, 512}}, rational_lenses[0], "Azure Kinect, wide"};
    const Undistortion maps(camera);
    std::vector<double> eight = coefficients(camera.distortion);
    const cv::Matx33d k(252, 0, 255.5, 0, 252, 255.5, 0, 0, 1);
    cv::Mat1f map_x, map_y;
    const Pinhole& to = maps.straight_camera();
    const cv::Matx33d straight(to.fx, 0, to.cx, 0, to.fy, to.cy, 0, 0, 1);
    cv::initUndistortRectifyMap(k, eight, cv::noArray(), straight, to.size, CV_32FC1, map_x, map_y);
    for (int v = 0; v < to.size.height; v += 5)
        for (int u = 0; u < to.size.width; u += 5)
            if (const cv::Vec2f at = maps.recorded_at()(v, u); !std::isnan(at[0])) {
                EXPECT_NEAR(at[0], map_x(v, u), 1e-3);
                EXPECT_NEAR(at[1], map_y(v, u), 1e-3);
            }
    EXPECT_NE(Undistortion::of(camera), Undistortion::of({camera.pinhole, {.k1 = 0.4321}, ""}));
    Camera other = camera;
    other.distortion.k6 += 1e-3;
    EXPECT_NE(Undistortion::of(camera), Undistortion::of(other)) << "all numbers tell lenses apart";
}

TEST(Camera, ThreadsShareOneCamerasMaps) {
    std::vector<std::shared_ptr<const Undistortion>> maps(8);
    std::vector<std::thread> threads;
    for (auto& slot : maps)
        threads.emplace_back([&slot] { slot = Undistortion::of(camera_with(lenses[0])); });
    for (auto& thread : threads)
        thread.join();
    for (const auto& slot : maps)
        EXPECT_EQ(slot, maps[0]);
    EXPECT_NE(Undistortion::of(camera_with(lenses[1])), maps[0]);
}

TEST(Camera, ResizingKeepsTheFieldOfView) {
    const Pinhole full = camera_with({}).pinhole, half = scaled(full, {320, 240});
    // The image covers [-0.5, width - 0.5]: its borders keep their directions.
    EXPECT_DOUBLE_EQ(full.ray(-0.5, 0).x(), half.ray(-0.5, 0).x());
    EXPECT_DOUBLE_EQ(full.ray(639.5, 0).x(), half.ray(319.5, 0).x());
    EXPECT_DOUBLE_EQ(full.ray(0, 479.5).y(), half.ray(0, 239.5).y());
    const Pinhole again = scaled(half, {640, 480});
    EXPECT_DOUBLE_EQ(again.fx, full.fx);
    EXPECT_DOUBLE_EQ(again.cy, full.cy);
}

std::string refusal(const Camera& camera) {
    return tests::refusal([&] { check(camera); });
}

TEST(Camera, ImpossibleCamerasAreRefusedByNameValueAndOrigin) {
    const auto broken = [](auto&& change) {
        Camera camera = camera_with({});
        camera.origin = "room/camera.json";
        change(camera);
        return refusal(camera);
    };
    EXPECT_EQ(broken([](Camera&) {}), "");
    const std::string negative = broken([](Camera& c) { c.pinhole.fx = -525; });
    EXPECT_TRUE(says(negative, "fx is -525"));
    EXPECT_TRUE(says(negative, "room/camera.json"));
    EXPECT_TRUE(says(broken([](Camera& c) { c.pinhole.fy = 0; }), "fy is 0"));
    EXPECT_TRUE(says(broken([](Camera& c) { c.pinhole.cx = NAN; }), "cx is nan"));
    EXPECT_TRUE(says(broken([](Camera& c) { c.pinhole.cy = 5000; }), "cy is 5000"));
    EXPECT_TRUE(says(broken([](Camera& c) { c.pinhole.size = {640, 0}; }), "640x0"));
    EXPECT_TRUE(says(broken([](Camera& c) { c.distortion.k3 = INFINITY; }), "k3 is inf"));
    EXPECT_EQ(broken([](Camera& c) { c.pinhole.cx = -40; }), "") << "a cropped image's principal point may lie outside";
}

TEST(Camera, DescriptionStatesTheNumbersPeopleCompare) {
    EXPECT_EQ(describe(camera_with({})), "fx 525.00 fy 520.00 cx 310.50 cy 245.25 (640x480)");
    EXPECT_TRUE(says(describe(camera_with({-0.28, 0, 0, 0, 0})), "k1 -0.28"));
}

// ---------------------------------------------------------------------------------------------------- recovered
// cameras

/// What a depth sensor's driver makes of a depth image: one point per pixel, NaN in holes.
Cloud cloud_of(const DepthImage& depth, bool single_precision = true) {
    Cloud cloud{depth.z_m.size(), {}, {}, {}};
    for (int v = 0; v < depth.z_m.rows; ++v)
        for (int u = 0; u < depth.z_m.cols; ++u) {
            const double z = depth.z_m(v, u) > 0 ? depth.z_m(v, u) : NAN;
            const Eigen::Vector3d point = depth.camera.point(u, v, z);
            cloud.points.push_back(single_precision ? point.cast<float>().cast<double>().eval() : point);
        }
    return cloud;
}

TEST(FitPinhole, RecoversTheCameraFromItsOwnPoints) {
    const DepthImage depth = with_holes(ball_on_floor(test_camera()), 0.3);
    const PinholeFit fit = fit_pinhole(cloud_of(depth));
    EXPECT_NEAR(fit.camera.fx, depth.camera.fx, 1e-3);
    EXPECT_NEAR(fit.camera.fy, depth.camera.fy, 1e-3);
    EXPECT_NEAR(fit.camera.cx, depth.camera.cx, 1e-3);
    EXPECT_NEAR(fit.camera.cy, depth.camera.cy, 1e-3);
    EXPECT_EQ(fit.camera.size, depth.camera.size);
    EXPECT_LT(fit.rms_px, 1e-4);
    EXPECT_EQ(fit.points, cv::countNonZero(depth.z_m)) << "holes are not points";
}

TEST(FitPinhole, StraysDoNotBendTheCamera) {
    const DepthImage depth = ball_on_floor(test_camera());
    Cloud cloud = cloud_of(depth);
    std::mt19937 random(1);
    for (int i = 0; i < 100; ++i) // half a percent of the points, moved by some ten pixels
        cloud.points[random() % cloud.points.size()].x() += 0.3;
    const PinholeFit fit = fit_pinhole(cloud);
    EXPECT_NEAR(fit.camera.fx, depth.camera.fx, 0.01);
    EXPECT_NEAR(fit.camera.cx, depth.camera.cx, 0.01);
    EXPECT_LT(fit.points, static_cast<int>(cloud.points.size()) - 50);
}

std::string fit_refusal(const Cloud& cloud) {
    return tests::refusal([&] { (void)fit_pinhole(cloud); });
}

TEST(FitPinhole, SaysWhyPointsCannotTell) {
    const Cloud whole = cloud_of(tilted_plane(test_camera(), 20));
    const Eigen::Vector3d hole = Eigen::Vector3d::Constant(NAN);
    const int width = whole.grid.width;

    Cloud none = whole;
    std::fill(none.points.begin(), none.points.end(), hole);
    EXPECT_TRUE(says(fit_refusal(none), "0 valid points"));

    Cloud row = none, column = none;
    for (int i = 0; i < 50; ++i) {
        row.points[40 * width + i] = whole.points[40 * width + i];
        column.points[i * width + 7] = whole.points[i * width + 7];
    }
    EXPECT_TRUE(says(fit_refusal(row), "one row or one column"));
    EXPECT_TRUE(says(fit_refusal(column), "one row or one column"));

    Cloud shuffled = whole; // a grid that is none: points in random order
    std::shuffle(shuffled.points.begin(), shuffled.points.end(), std::mt19937(1));
    EXPECT_TRUE(says(fit_refusal(shuffled), "no camera can be recovered"));

    Cloud flipped = whole; // y up, as ICL-NUIM has it
    for (auto& point : flipped.points)
        point.y() = -point.y();
    EXPECT_TRUE(says(fit_refusal(flipped), "positive values expected"));

    Cloud list = whole;
    list.grid = {static_cast<int>(whole.points.size()), 1};
    EXPECT_TRUE(says(fit_refusal(list), "not in a grid"));
}

} // namespace
} // namespace scanshade
