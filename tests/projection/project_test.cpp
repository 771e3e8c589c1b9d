// Frame -> DepthImage: what is kept, what becomes a hole, which point a pixel shows.
#include "projection/project.h"

#include "projection/base/error.h"
#include "projection/undistort.h"
#include "tests/support/says.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <gtest/gtest.h>
#include <random>
#include <set>

namespace scanshade {
namespace {

using tests::ball_on_floor, tests::refusal, tests::says, tests::test_camera, tests::tilted_plane, tests::with_holes;

Frame frame_of(const DepthImage& depth) {
    Frame frame;
    frame.camera = {depth.camera, {}, "test"};
    frame.depth_m = depth.z_m;
    return frame;
}

Frame cloud_frame(std::vector<Eigen::Vector3d> points, cv::Size grid = {}) {
    Frame frame;
    if (grid.empty())
        grid = {static_cast<int>(points.size()), 1};
    frame.cloud = Cloud{grid, std::move(points), {}, {}};
    return frame;
}

Frame organised_frame(const DepthImage& depth) {
    std::vector<Eigen::Vector3d> points;
    for (int v = 0; v < depth.z_m.rows; ++v)
        for (int u = 0; u < depth.z_m.cols; ++u) {
            const double z = depth.z_m(v, u);
            points.push_back(z > 0 ? depth.camera.point(u, v, z) : Eigen::Vector3d::Constant(NAN));
        }
    return cloud_frame(std::move(points), depth.z_m.size());
}

// ---------------------------------------------------------------------------------------------------- depth images

TEST(ProjectDepth, CleanImagesAreNotEvenCopied) {
    const Frame frame = frame_of(with_holes(ball_on_floor(test_camera()), 0.1));
    const DepthImage depth = project(frame);
    EXPECT_EQ(depth.z_m.data, frame.depth_m.data);
    EXPECT_TRUE(depth.source.empty());
    EXPECT_EQ(depth.camera.size, frame.depth_m.size());
}

TEST(ProjectDepth, WhatNoSensorMeasuresBecomesAHole) {
    Frame frame = frame_of(tilted_plane(test_camera(), 0));
    const float odd[] = {NAN, INFINITY, -INFINITY, -1.0F, 1e-4F, 1e6F, 65535.0F};
    frame.depth_m = frame.depth_m.clone();
    for (int i = 0; i < 7; ++i)
        frame.depth_m(3, i) = odd[i];
    const DepthImage depth = project(frame);
    for (int i = 0; i < 7; ++i)
        EXPECT_EQ(depth.z_m(3, i), 0) << odd[i];
    EXPECT_EQ(depth.z_m(3, 7), frame.depth_m(3, 7));
    EXPECT_TRUE(std::isnan(frame.depth_m(3, 0))) << "the recording itself stays as it is";
}

TEST(ProjectDepth, AnImageOfHolesIsAResult) {
    Frame frame = frame_of(tilted_plane(test_camera(), 0));
    frame.depth_m = cv::Mat1f(frame.depth_m.size(), 0.0F);
    EXPECT_EQ(cv::countNonZero(project(frame).z_m), 0);
}

TEST(ProjectDepth, UndistortedDepthIsThatOfTheStraightCamera) {
    // A plane as the lens records it: each recorded pixel looks along its own undistorted direction.
    const Pinhole pinhole = test_camera({320, 240});
    const Distortion lens{-0.2, 0.05, 0.001, -0.002, 0};
    const Eigen::Vector3d normal = Eigen::Vector3d(0.4, 0.2, -1).normalized();
    const auto depth_along = [&](const Eigen::Vector2d& p) {
        return -2 / normal.dot(Eigen::Vector3d(p.x(), p.y(), 1));
    };
    Frame frame;
    frame.camera = {pinhole, lens, "test"};
    frame.depth_m = cv::Mat1f(pinhole.size, 0.0F);
    for (int v = 0; v < pinhole.size.height; ++v)
        for (int u = 0; u < pinhole.size.width; ++u)
            if (const auto p = undistorted(lens, pinhole.ray(u, v).head<2>()))
                frame.depth_m(v, u) = static_cast<float>(depth_along(*p));

    const DepthImage depth = project(frame);
    EXPECT_EQ(depth.camera.fx, pinhole.fx);
    int seen = 0, exactly = 0;
    for (int v = 0; v < depth.z_m.rows; ++v)
        for (int u = 0; u < depth.z_m.cols; ++u)
            if (const float z = depth.z_m(v, u); z > 0) {
                ++seen;
                const double exact = depth_along(depth.camera.ray(u, v).head<2>());
                EXPECT_NEAR(z, exact, exact * 1.0 / pinhole.fx) << "nearest pixel: at most the slope over 0.7 px off";
                exactly += std::abs(z - exact) < 1e-4 * exact; // 1/z is linear between pixels but for the lens
            }
    EXPECT_GT(seen, static_cast<double>(pinhole.size.area())) << "a barrel's image is wider when straight";
    EXPECT_GT(exactly, 0.98 * seen) << "all but the image's rim: repeated pixels would be terraces";
}

TEST(ProjectDepth, UndistortingInventsNothingBetweenSurfaces) {
    const Pinhole pinhole = test_camera({320, 240});
    Frame frame;
    frame.camera = {pinhole, {-0.2, 0.05, 0, 0, 0}, "test"};
    frame.depth_m = cv::Mat1f(pinhole.size, 3.0F);
    for (int u = 0; u < 320; u += 16)
        frame.depth_m(cv::Rect(u, 0, 8, 240)) = 1.5F;
    const DepthImage depth = project(frame);
    for (const float z : depth.z_m)
        ASSERT_TRUE(z == 0 || z == 1.5F || z == 3.0F) << z;
}

TEST(ProjectDepth, ACameraOfAnotherSizeIsRefusedWithBothSizes) {
    Frame frame = frame_of(tilted_plane(test_camera(), 0));
    frame.camera.pinhole.size = {320, 240};
    const std::string why = refusal([&] { (void)project(frame); });
    EXPECT_TRUE(says(why, "320x240"));
    EXPECT_TRUE(says(why, "160x120"));
    frame.camera.pinhole.size = {};
    EXPECT_EQ(project(frame).camera.size, cv::Size(160, 120)) << "a camera without a size takes the image's";
}

TEST(ProjectDepth, NothingRecordedIsAnError) {
    EXPECT_TRUE(says(refusal([] { (void)project(Frame()); }), "neither depth nor points"));
    EXPECT_TRUE(says(refusal([] { (void)project(cloud_frame({})); }), "no points"));
}

// ---------------------------------------------------------------------------------------------------- organised clouds

TEST(ProjectCloud, AnOrganisedCloudKeepsItsGrid) {
    const DepthImage sensed = with_holes(ball_on_floor(test_camera()), 0.2);
    const Frame frame = organised_frame(sensed);
    const DepthImage depth = project(frame);
    ASSERT_EQ(depth.z_m.size(), sensed.z_m.size());
    EXPECT_EQ(cv::norm(depth.z_m, sensed.z_m, cv::NORM_INF), 0);
    for (int i = 0; i < sensed.z_m.size().area(); ++i)
        EXPECT_EQ(depth.source.ptr<int>()[i], sensed.z_m.ptr<float>()[i] > 0 ? i : -1);
    EXPECT_TRUE(says(camera_of(frame).origin, "recovered from the points, rms 0.0000 px"));
}

TEST(ProjectCloud, AGivenCameraIsNotRecoveredAgain) {
    Frame frame = organised_frame(ball_on_floor(test_camera()));
    Pinhole larger = scaled(test_camera(), {320, 240});
    frame.camera = {larger, {}, "--camera"};
    const DepthImage depth = project(frame);
    EXPECT_EQ(depth.z_m.size(), cv::Size(320, 240));
    EXPECT_EQ(camera_of(frame).origin, "--camera");
    // Each point lands on the pixel its coordinates say, although its grid is another.
    const double u = larger.fx * frame.cloud->points[5000].x() / frame.cloud->points[5000].z() + larger.cx;
    const double v = larger.fy * frame.cloud->points[5000].y() / frame.cloud->points[5000].z() + larger.cy;
    EXPECT_EQ(depth.source(static_cast<int>(std::lround(v)), static_cast<int>(std::lround(u))), 5000);
}

TEST(ProjectCloud, ACloudOfHolesIsAResult) {
    Frame frame = organised_frame(ball_on_floor(test_camera()));
    std::fill(frame.cloud->points.begin(), frame.cloud->points.end(), Eigen::Vector3d::Constant(NAN));
    const DepthImage depth = project(frame);
    EXPECT_EQ(depth.z_m.size(), cv::Size(160, 120));
    EXPECT_EQ(cv::countNonZero(depth.z_m), 0);
}

// ---------------------------------------------------------------------------------------------------- splatting

TEST(ProjectCloud, TheNearestPointWinsThenTheFirst) {
    const Pinhole camera = test_camera();
    Frame frame = cloud_frame({camera.point(20, 30, 3),
                               camera.point(20.2, 30.1, 2),
                               camera.point(19.8, 30, 2),
                               camera.point(50, 60, 1.5),
                               {0, 0, -1},
                               {NAN, NAN, NAN},
                               camera.point(500, 30, 2)});
    frame.camera = {camera, {}, "--camera"};
    const DepthImage depth = project(frame);
    EXPECT_EQ(depth.source(30, 20), 1) << "nearest, and of two equal ones the first";
    EXPECT_EQ(depth.z_m(30, 20), 2);
    EXPECT_EQ(depth.source(60, 50), 3);
    EXPECT_EQ(cv::countNonZero(depth.z_m), 2)
        << "behind, invalid and outside points are nowhere; lone points do not grow";
}

/// A wall of randomly strewn points, `per_pixel` of them per pixel of `camera`.
void strew_wall(std::vector<Eigen::Vector3d>& points, const Pinhole& camera, cv::Rect2d pixels, double z,
                double per_pixel) {
    std::mt19937 random(static_cast<unsigned>(points.size()) + 1);
    std::uniform_real_distribution<double> u(pixels.x, pixels.x + pixels.width), v(pixels.y, pixels.y + pixels.height);
    for (int i = 0; i < static_cast<int>(pixels.area() * per_pixel); ++i)
        points.push_back(camera.point(u(random), v(random), z));
}

TEST(ProjectCloud, WhatLiesBehindDoesNotShineThroughGaps) {
    const Pinhole camera = test_camera();
    std::vector<Eigen::Vector3d> points;
    strew_wall(points, camera, {0, 0, 160, 120}, 4, 1.5);
    strew_wall(points, camera, {40, 30, 80, 60}, 2, 1.0);
    Frame frame = cloud_frame(std::move(points));
    frame.camera = {camera, {}, "--camera"};
    const DepthImage depth = project(frame);
    const cv::Mat1f front = depth.z_m(cv::Rect(42, 32, 76, 56));
    const double through = cv::countNonZero(front == 4.0F), missing = cv::countNonZero(front == 0.0F);
    // By chance alone 37 % of the front wall's pixels stay empty, and 78 % of those show the back wall.
    EXPECT_LT(through / static_cast<double>(front.total()), 0.05);
    EXPECT_LT(missing / static_cast<double>(front.total()), 0.01);
    for (int v = 0; v < depth.z_m.rows; ++v)
        for (int u = 0; u < depth.z_m.cols; ++u) {
            const int source = depth.source(v, u);
            ASSERT_EQ(source >= 0, depth.z_m(v, u) > 0);
            if (source >= 0) {
                EXPECT_FLOAT_EQ(depth.z_m(v, u), static_cast<float>(frame.cloud->points[source].z()));
            }
        }
}

TEST(ProjectCloud, ACloudInFrontOfItsOriginIsFramed) {
    const Pinhole camera = test_camera({400, 300});
    std::vector<Eigen::Vector3d> points;
    strew_wall(points, camera, {100, 50, 200, 200}, 2, 1);
    const Frame frame = cloud_frame(points);
    const Camera chosen = camera_of(frame);
    EXPECT_TRUE(says(chosen.origin, "chosen to frame the cloud"));
    EXPECT_NEAR(chosen.pinhole.fx, camera.fx, 0.1 * camera.fx) << "one point per pixel";
    const DepthImage depth = project(frame);
    EXPECT_GT(cv::countNonZero(depth.z_m), 0.9 * 200 * 200);
    std::set<int> shown(depth.source.begin(), depth.source.end());
    EXPECT_GT(static_cast<double>(shown.size()), 0.55 * static_cast<double>(points.size()));
    EXPECT_LE(std::max(depth.z_m.cols, depth.z_m.rows), 1024);
}

TEST(ProjectCloud, TheCameraFoundMayBeKeptInTheFrame) {
    std::vector<Eigen::Vector3d>
        points; // a small dense thing 65 degrees to the side: the principal point lies far outside
    for (int i = 0; i < 40000; ++i)
        points.emplace_back(2.1 + 0.0005 * (i % 200), 0.0005 * std::floor(i / 200.0), 1);
    Frame frame = cloud_frame(std::move(points));
    const DepthImage before = project(frame);
    frame.camera = camera_of(frame);
    const DepthImage after = project(frame);
    EXPECT_EQ(cv::norm(before.z_m, after.z_m, cv::NORM_INF), 0);
    EXPECT_GT(cv::countNonZero(after.z_m), 30000);
}

TEST(ProjectCloud, TinyCloudsAreFramedToo) {
    EXPECT_EQ(cv::countNonZero(project(cloud_frame({{0.1, 0.2, 1.0}})).z_m), 1);
    const DepthImage line = project(cloud_frame({{0, 0, 1}, {0, 0.1, 1}, {0, 0.2, 1}}));
    EXPECT_EQ(cv::countNonZero(line.z_m), 3);
}

TEST(ProjectCloud, ACloudAroundItsOriginHasNoSingleCamera) {
    std::vector<Eigen::Vector3d> round;
    for (int i = 0; i < 360; ++i)
        round.emplace_back(std::cos(i * 0.0175), 0.1, std::sin(i * 0.0175));
    EXPECT_TRUE(says(refusal([&] { (void)project(cloud_frame(round)); }), "no single camera"));
    // Map coordinates: all in front, but far to the side of where the origin looks.
    EXPECT_TRUE(says(refusal([] {
                         (void)project(cloud_frame({{512000, 5403000, 300}, {512010, 5403010, 301}}));
                     }),
                     "no single camera"));
}

} // namespace
} // namespace scanshade
