// Colour laid over depth and AO over colour: right where both cameras see the surface, nothing where one does not.
#include "apps/scenes/places/scenes.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/colour_view.h"
#include "projection/project.h"
#include "projection/undistort.h"
#include "tests/support/says.h"
#include "tests/support/scenes.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>

namespace scanshade {
namespace {

using tests::says;

/// A Kinect's two cameras, exaggerated: the colour camera 60 mm to the right, turned by two degrees, of another angle.
const Camera depth_camera{{292.5, 292.5, 159.5, 119.5, {320, 240}}, {}, "depth"};
const ColourCamera colour_camera{{{350, 350, 190, 150, {400, 300}}, {}, "colour"}, [] {
                                     Eigen::Isometry3d place = Eigen::Isometry3d::Identity();
                                     place.linear() =
                                         Eigen::AngleAxisd(0.035, Eigen::Vector3d(0.6, 0.8, 0)).toRotationMatrix();
                                     place.translation() = Eigen::Vector3d(-0.06, 0.005, 0.002);
                                     return place;
                                 }()};

/// What both cameras see of the office, exactly.
struct Views {
    const scene::World world{scene::scene_named("office")};
    const Eigen::Isometry3d world_from_depth = scene::world_from_camera(world.scene().walk, 3);
    const Eigen::Isometry3d world_from_colour = world_from_depth * colour_camera.colour_from_depth.inverse();
    const scene::Geometry depth = scene::render_geometry(world, depth_camera.pinhole, world_from_depth);
    const scene::Geometry beside = scene::render_geometry(world, colour_camera.camera.pinhole, world_from_colour);
    const cv::Mat3b colour = scene::render_colour(world, colour_camera.camera.pinhole, world_from_colour);
    const SurfaceInColour surface = surface_in_colour(depth.z_m, depth_camera, colour_camera);
};
const Views& views() {
    static const Views all;
    return all;
}

/// Whether something stands between the colour camera and a point of the depth camera's space.
bool hidden(const Eigen::Vector3d& in_depth) {
    const Eigen::Vector3d eye = views().world_from_colour.translation(), target = views().world_from_depth * in_depth;
    const scene::Hit hit = views().world.cast({eye, target - eye});
    constexpr double of_the_way = 0.98; // nearer than that it is another surface
    return hit.t < of_the_way;
}

TEST(ColourOnDepth, HasTheColourThatTheDepthCameraWouldHaveSeen) {
    const Views& all = views();
    const auto [colour, known, deep] =
        colour_on_depth(all.colour, all.depth.z_m, depth_camera, colour_camera, all.surface);
    const cv::Mat3b wanted = scene::render_colour(all.world, depth_camera.pinhole, all.world_from_depth);
    std::vector<double> warped, unwarped;
    double inside = 0, found = 0;
    for (int v = 0; v < known.rows; ++v)
        for (int u = 0; u < known.cols; ++u) {
            const Eigen::Vector3d p =
                colour_camera.colour_from_depth * depth_camera.pinhole.point(u, v, all.depth.z_m(v, u));
            const Pinhole& c = colour_camera.camera.pinhole;
            const double x = c.fx * p.x() / p.z() + c.cx, y = c.fy * p.y() / p.z() + c.cy;
            if (all.depth.z_m(v, u) > 0 && x > 0 && y > 0 && x < c.size.width - 1 && y < c.size.height - 1) {
                ++inside;
                found += known(v, u) > 0;
            }
            if (!known(v, u))
                continue;
            warped.push_back(cv::norm(cv::Vec3d(colour(v, u)) - cv::Vec3d(wanted(v, u))));
            unwarped.push_back(cv::norm(cv::Vec3d(all.colour(v, u)) - cv::Vec3d(wanted(v, u))));
        }
    std::printf("colour known for %.1f %% of what lies in view; median miss %.1f of 255, without the warp %.1f\n",
                100 * found / inside, median(warped), median(unwarped));
    EXPECT_GT(found / inside, 0.9); // an outline and its shadow are the price of never being wrong
    EXPECT_LT(median(warped), 3);
    EXPECT_LT(median(warped), 0.2 * median(unwarped));
}

TEST(ColourOnDepth, WhatIsHiddenFromTheColourCameraGetsNoColour) {
    const Views& all = views();
    const auto [colour, known, deep] =
        colour_on_depth(all.colour, all.depth.z_m, depth_camera, colour_camera, all.surface);
    int hidden_pixels = 0, wrong = 0, coloured = 0;
    for (int v = 0; v < known.rows; ++v)
        for (int u = 0; u < known.cols; ++u) {
            const double z = all.depth.z_m(v, u);
            if (z <= 0)
                continue;
            const bool is_hidden = hidden(depth_camera.pinhole.point(u, v, z));
            hidden_pixels += is_hidden;
            coloured += known(v, u) > 0;
            wrong += is_hidden && known(v, u);
        }
    std::printf("%d pixels hidden, %d of %d coloured ones wrongly\n", hidden_pixels, wrong, coloured);
    EXPECT_GT(hidden_pixels, 500); // otherwise this says nothing
    // What hides them may stand outside the depth image, or between its pixels.
    EXPECT_LT(wrong, 0.002 * coloured);
}

TEST(SurfaceInColour, LiesWhereTheColourCameraSeesIt) {
    const Views& all = views();
    std::vector<double> misses;
    int in_front = 0, seen = 0;
    for (int v = 0; v < all.surface.z_m.rows; ++v)
        for (int u = 0; u < all.surface.z_m.cols; ++u) {
            const double z = all.surface.z_m(v, u), truth = all.beside.z_m(v, u);
            if (z == 0)
                continue;
            ++seen;
            misses.push_back(std::abs(z - truth));
            in_front += z < truth - 0.02 * truth; // nothing is there
        }
    EXPECT_LT(median(misses), 1e-3);
    EXPECT_LT(in_front, 0.002 * seen);
    EXPECT_GT(seen, 0.7 * static_cast<double>(all.surface.z_m.total())); // of another angle, and 60 mm aside
}

TEST(SurfaceInColour, ValuesOfDepthPixelsComeToThePixelsThatShowThem) {
    const Views& all = views();
    // Each depth pixel's value is its surface's height in the world, which the colour camera's own geometry tells, too.
    cv::Mat1f height(all.depth.z_m.size(), std::numeric_limits<float>::quiet_NaN());
    for (int v = 0; v < height.rows; ++v)
        for (int u = 0; u < height.cols; ++u)
            if (const double z = all.depth.z_m(v, u); z > 0)
                height(v, u) = static_cast<float>((all.world_from_depth * depth_camera.pinhole.point(u, v, z)).z());
    const cv::Mat1f carried = on_colour_pixels(height, all.surface);
    std::vector<double> misses;
    for (int v = 0; v < carried.rows; ++v)
        for (int u = 0; u < carried.cols; ++u) {
            EXPECT_EQ(std::isnan(carried(v, u)), all.surface.z_m(v, u) == 0); // holes stay unknown
            if (std::isnan(carried(v, u)))
                continue;
            const Eigen::Vector3d point = colour_camera.camera.pinhole.point(u, v, all.beside.z_m(v, u));
            misses.push_back(std::abs((all.world_from_colour * point).z() - carried(v, u)));
        }
    EXPECT_LT(median(misses), 2e-3); // a pixel is 8 mm wide there
}

TEST(SurfaceInColour, BothLensesBend) {
    // The same camera twice, with a lens: every pixel must come back to itself.
    const Camera bent{depth_camera.pinhole, {-0.2, 0.05, 0.001, -0.001, 0}, "bent"};
    const cv::Mat1f wall(depth_camera.pinhole.size, 2.0F);
    const SurfaceInColour surface = surface_in_colour(wall, bent, {bent, Eigen::Isometry3d::Identity()});
    for (int v = 5; v < wall.rows - 5; ++v)
        for (int u = 5; u < wall.cols - 5; ++u) {
            EXPECT_NEAR(surface.seen_at(v, u)[0], u, 0.01);
            EXPECT_NEAR(surface.seen_at(v, u)[1], v, 0.01);
        }
    // With another lens in front of it, where that lens bends the ray to.
    const Camera other{depth_camera.pinhole, {0.1, 0, 0, 0, 0}, "other"};
    const SurfaceInColour through = surface_in_colour(wall, bent, {other, Eigen::Isometry3d::Identity()});
    const Pinhole& p = depth_camera.pinhole;
    const auto straight = undistorted(other.distortion, p.ray(60, 200).head<2>());
    ASSERT_TRUE(straight);
    const Eigen::Vector2d at = distorted(bent.distortion, *straight);
    EXPECT_NEAR(through.seen_at(200, 60)[0], p.fx * at.x() + p.cx, 0.02);
    EXPECT_NEAR(through.seen_at(200, 60)[1], p.fy * at.y() + p.cy, 0.02);
}

TEST(SurfaceInColour, NothingIsSpannedOverHolesAndEdges) {
    cv::Mat1f depth(depth_camera.pinhole.size, 2.0F);
    depth(cv::Rect(100, 80, 30, 30)).setTo(0);
    depth(cv::Rect(200, 0, 120, 240)).setTo(3);
    const SurfaceInColour surface =
        surface_in_colour(depth, depth_camera, {depth_camera, Eigen::Isometry3d::Identity()});
    for (int v = 0; v < depth.rows; ++v)
        for (int u = 0; u < depth.cols; ++u) {
            const float z = surface.z_m(v, u);
            EXPECT_TRUE(z == 0 || std::abs(z - depth(v, u)) < 1e-5F) << u << ", " << v;
            EXPECT_EQ(z == 0, depth(v, u) == 0);
        }
}

TEST(SurfaceInColour, OfTwoSurfacesTheNearerIsSeen) {
    // A strip a metre away before a wall at two: 60 mm to the side, the strip moves by 17.5 pixels and the wall by 8.8,
    // so that the strip covers 8.8 columns of wall which the depth camera saw. It is drawn before that wall or after
    // it, depending on the side.
    cv::Mat1f depth(depth_camera.pinhole.size, 2.0F);
    depth.colRange(140, 181).setTo(1);
    for (const double aside_m : {-0.06, 0.06}) {
        Eigen::Isometry3d colour_from_depth = Eigen::Isometry3d::Identity();
        colour_from_depth.translation().x() = aside_m;
        const SurfaceInColour surface = surface_in_colour(depth, depth_camera, {depth_camera, colour_from_depth});
        const double moved = 292.5 * aside_m;
        for (int v = 1; v < 239; ++v)
            for (int u = static_cast<int>(std::ceil(140 + moved)); u <= static_cast<int>(180 + moved); ++u) {
                ASSERT_EQ(surface.z_m(v, u), 1) << u << ", " << v;
                ASSERT_NEAR(surface.seen_at(v, u)[0], u - moved, 1e-3);
            }
    }
}

TEST(ColourOnDepth, ImagesOfOtherSizesAreRefused) {
    const cv::Mat1f depth(depth_camera.pinhole.size, 2.0F);
    const SurfaceInColour surface = surface_in_colour(depth, depth_camera, colour_camera);
    EXPECT_TRUE(says(
        tests::refusal([&] { (void)colour_on_depth(cv::Mat3b(10, 10), depth, depth_camera, colour_camera, surface); }),
        "colour is 10x10, but its camera is for 400x300"));
    EXPECT_TRUE(
        says(tests::refusal([&] { (void)surface_in_colour(cv::Mat1f(5, 5, 1.0F), depth_camera, colour_camera); }),
             "depth is 5x5"));
}

} // namespace
} // namespace scanshade
