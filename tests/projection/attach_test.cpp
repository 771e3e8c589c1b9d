// AoMap -> per recorded pixel or point: the right value comes back to the right place.
#include "projection/attach.h"

#include "projection/base/error.h"
#include "projection/project.h"
#include "projection/undistort.h"
#include "tests/support/scenes.h"

#include <algorithm>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using tests::ball_on_floor, tests::test_camera, tests::tilted_plane, tests::with_holes;
constexpr float unknown = std::numeric_limits<float>::quiet_NaN();

/// A visibility map in which every pixel with a surface can be told from every other.
AoMap numbered(const DepthImage& depth) {
    AoMap ao{cv::Mat1f(depth.z_m.size(), unknown)};
    for (int i = 0; i < depth.z_m.size().area(); ++i)
        if (depth.z_m.ptr<float>()[i] > 0)
            ao.visibility.ptr<float>()[i] = static_cast<float>(i) * 0x1p-20F;
    return ao;
}

TEST(AttachToDepth, PixelsKeepTheirValuesAndHolesStayUnknown) {
    Frame frame;
    const DepthImage depth = with_holes(ball_on_floor(test_camera()), 0.2);
    frame.camera = {depth.camera, {}, "test"};
    frame.depth_m = depth.z_m;
    const AoMap ao = numbered(depth);
    const Attached attached = attach(frame, depth, ao);
    for (int i = 0; i < depth.z_m.size().area(); ++i) {
        const float expected = ao.visibility.ptr<float>()[i], found = attached.visibility.ptr<float>()[i];
        EXPECT_TRUE(found == expected || (std::isnan(found) && std::isnan(expected)));
    }
    EXPECT_EQ(attached.coverage, 1);
    EXPECT_TRUE(attached.per_point.empty());
}

TEST(AttachToDepth, CoverageIsTheShareOfDepthsWithAValue) {
    Frame frame;
    const DepthImage depth = tilted_plane(test_camera(), 0);
    frame.camera = {depth.camera, {}, "test"};
    frame.depth_m = depth.z_m;
    AoMap ao{cv::Mat1f(depth.z_m.size(), 0.75F)};
    ao.visibility(cv::Rect(0, 0, 80, 120)) = unknown; // no normal could be made there, say
    const Attached attached = attach(frame, depth, ao);
    EXPECT_DOUBLE_EQ(attached.coverage, 0.5);
    EXPECT_DOUBLE_EQ(attached.mean_visibility, 0.75);

    frame.depth_m = cv::Mat1f(depth.z_m.size(), 0.0F);
    const DepthImage holes = project(frame);
    const Attached nothing = attach(frame, holes, {cv::Mat1f(holes.z_m.size(), unknown)});
    EXPECT_EQ(nothing.coverage, 0);
    EXPECT_TRUE(std::isnan(nothing.mean_visibility));
}

TEST(AttachToDepth, ThroughALensNoPixelGetsTheValueOfAnotherSurface) {
    // A pane at 1 m before a wall at 3 m. Through a lens, fewer pixels are computed than were recorded: those at
    // the outline that were left out take the value of a neighbour, but not of one on the other surface.
    Frame frame;
    const Pinhole pinhole = test_camera({320, 240});
    frame.camera = {pinhole, {0.3, 0.1, 0.001, -0.002, 0}, "test"};
    frame.depth_m = cv::Mat1f(pinhole.size, 3.0F);
    frame.depth_m(cv::Rect(60, 50, 201, 141)).setTo(1);
    const DepthImage depth = project(frame);
    AoMap ao{cv::Mat1f(depth.z_m.size(), unknown)};
    ao.visibility.setTo(0.25, depth.z_m == 1);
    ao.visibility.setTo(0.75, depth.z_m == 3);
    const Attached attached = attach(frame, depth, ao);
    int known = 0;
    for (int v = 0; v < 240; ++v)
        for (int u = 0; u < 320; ++u)
            if (const float found = attached.visibility(v, u); !std::isnan(found)) {
                ++known;
                ASSERT_EQ(found, frame.depth_m(v, u) == 1 ? 0.25F : 0.75F) << u << ", " << v;
            }
    EXPECT_GT(known, 0.8 * 320 * 240);
}

TEST(AttachToDepth, ThroughALensEachRecordedPixelGetsItsOwnBack) {
    Frame frame;
    const Pinhole pinhole = test_camera({320, 240});
    frame.camera = {pinhole, {-0.2, 0.05, 0.001, -0.002, 0}, "test"};
    frame.depth_m = tilted_plane(pinhole, 30).z_m;
    const DepthImage depth = project(frame);
    const auto maps = Undistortion::of(frame.camera);
    AoMap ao{
        cv::Mat1f(depth.z_m.size(), unknown)}; // holds, per undistorted pixel, which recorded pixel it was taken from
    for (int i = 0; i < depth.z_m.size().area(); ++i)
        if (depth.z_m.ptr<float>()[i] > 0)
            ao.visibility.ptr<float>()[i] = static_cast<float>(maps->recorded_pixel().ptr<int>()[i]);

    const Attached attached = attach(frame, depth, ao);
    int same = 0, known = 0;
    for (int v = 0; v < 240; ++v)
        for (int u = 0; u < 320; ++u) {
            if (std::isnan(attached.visibility(v, u)))
                continue;
            const int from = static_cast<int>(attached.visibility(v, u));
            ++known;
            same += from == v * 320 + u;
            EXPECT_LE(std::max(std::abs(from % 320 - u), std::abs(from / 320 - v)), 1);
        }
    EXPECT_GT(same, 0.75 * known); // barrel distortion spreads the middle and squeezes the rim
    EXPECT_EQ(known, 320 * 240) << "the straight image is wide enough for the rim";
    EXPECT_EQ(attached.coverage, 1);
}

TEST(AttachToDepth, ThroughALensNothingIsTakenFromAcrossAnEdge) {
    Frame frame;
    const Pinhole pinhole = test_camera({320, 240});
    frame.camera = {pinhole, {-0.2, 0.05, 0, 0, 0}, "test"};
    frame.depth_m = cv::Mat1f(pinhole.size, 3.0F);
    for (int u = 0; u < 320; u += 16)
        frame.depth_m(cv::Rect(u, 0, 8, 240)) = 1.5F;
    const DepthImage depth = project(frame);
    const Attached attached = attach(frame, depth, {cv::Mat1f(depth.z_m * 0.25)}); // the value tells its surface
    for (int v = 0; v < 240; ++v)
        for (int u = 0; u < 320; ++u)
            if (!std::isnan(attached.visibility(v, u))) {
                ASSERT_EQ(attached.visibility(v, u), frame.depth_m(v, u) / 4) << u << ", " << v;
            }
    EXPECT_GT(attached.coverage, 0.98);
}

// ---------------------------------------------------------------------------------------------------- clouds

Frame cloud_frame(const Pinhole& camera, const std::vector<cv::Point3d>& pixels_and_depths) {
    Frame frame;
    frame.camera = {camera, {}, "--camera"};
    frame.cloud = Cloud{{static_cast<int>(pixels_and_depths.size()), 1}, {}, {}, {}};
    for (const auto& p : pixels_and_depths)
        frame.cloud->points.push_back(camera.point(p.x, p.y, p.z));
    return frame;
}

TEST(AttachToCloud, PointsMergedInOnePixelShareItAndHiddenOnesStayUnknown) {
    const Frame frame = cloud_frame(test_camera(), {{20, 30, 2},        // shown
                                                    {20.3, 30.2, 2.01}, // merged: 5 mm apart across, 10 mm in depth
                                                    {20, 30, 3},        // hidden a metre behind
                                                    {50, 60, 1.5},      // shown
                                                    {-40, 30, 2},       // outside the image
                                                    {0, 0, -2},         // behind the camera
                                                    {NAN, NAN, NAN}});  // invalid
    const DepthImage depth = project(frame);
    AoMap ao{cv::Mat1f(depth.z_m.size(), unknown)};
    ao.visibility(30, 20) = 0.25F;
    ao.visibility(60, 50) = 0.75F;
    const Attached attached = attach(frame, depth, ao);
    ASSERT_EQ(attached.per_point.size(), 7U);
    EXPECT_EQ(attached.per_point[0], 0.25F);
    EXPECT_EQ(attached.per_point[1], 0.25F);
    EXPECT_TRUE(std::isnan(attached.per_point[2]));
    EXPECT_EQ(attached.per_point[3], 0.75F);
    for (int i = 4; i < 7; ++i)
        EXPECT_TRUE(std::isnan(attached.per_point[i]));
    EXPECT_DOUBLE_EQ(attached.coverage, 3.0 / 6.0) << "of the valid points";
    EXPECT_DOUBLE_EQ(attached.mean_visibility, (0.25 + 0.25 + 0.75) / 3);
}

TEST(AttachToCloud, AnOrganisedCloudGetsOneValuePerPointAndItsGridBack) {
    const DepthImage sensed = with_holes(ball_on_floor(test_camera()), 0.2);
    Frame frame;
    frame.cloud = Cloud{sensed.z_m.size(), {}, {}, {}};
    for (int v = 0; v < sensed.z_m.rows; ++v)
        for (int u = 0; u < sensed.z_m.cols; ++u) {
            const double z = sensed.z_m(v, u) > 0 ? sensed.z_m(v, u) : NAN;
            frame.cloud->points.push_back(sensed.camera.point(u, v, z));
        }
    const DepthImage depth = project(frame);
    const AoMap ao = numbered(depth);
    const Attached attached = attach(frame, depth, ao);
    ASSERT_EQ(attached.per_point.size(), sensed.z_m.total());
    ASSERT_EQ(attached.visibility.size(), sensed.z_m.size());
    for (std::size_t i = 0; i < attached.per_point.size(); ++i) {
        const float expected = ao.visibility.ptr<float>()[i];
        EXPECT_TRUE(attached.per_point[i] == expected || (std::isnan(attached.per_point[i]) && std::isnan(expected)));
    }
    EXPECT_EQ(attached.coverage, 1);
}

TEST(Attach, MapsOfDifferentSizesAreRefused) {
    Frame frame;
    const DepthImage depth = tilted_plane(test_camera(), 0);
    frame.depth_m = depth.z_m;
    EXPECT_THROW((void)attach(frame, depth, {cv::Mat1f(10, 10, 1.0F)}), Error);
}

// ---------------------------------------------------------------------------------------------------- shading

cv::Vec3b shaded(const cv::Vec3b& colour, float visibility, double strength = 1) {
    return shade(cv::Mat3b(1, 1, colour), cv::Mat1f(1, 1, visibility), strength)(0, 0);
}

TEST(Shade, FullVisibilityChangesNothing) {
    for (int i = 0; i < 256; ++i) {
        const auto value = static_cast<unsigned char>(i);
        const cv::Vec3b grey(value, value, value);
        EXPECT_EQ(shaded(grey, 1), grey);
        EXPECT_EQ(shaded(grey, 0.3F, 0), grey) << "strength 0";
        EXPECT_EQ(shaded(grey, unknown), grey) << "no surface";
    }
}

TEST(Shade, MultipliesInLinearLight) {
    EXPECT_EQ(shaded({255, 255, 255}, 0), cv::Vec3b(0, 0, 0));
    // Half of white's light is stored as 187.5 of 255 in sRGB (not 128, which is a fifth of the light).
    EXPECT_NEAR(shaded({255, 255, 255}, 0.5F)[0], 188, 1);
    // 128 is 0.2159 in linear light; half of it is 0.1079, stored as 92.
    EXPECT_NEAR(shaded({128, 128, 128}, 0.5F)[1], 92, 1);
    // Strength 0.5 at visibility 0 leaves half of the light.
    EXPECT_NEAR(shaded({255, 0, 128}, 0, 0.5)[0], 188, 1);
    EXPECT_EQ(shaded({255, 0, 128}, 0, 0.5)[1], 0);
    EXPECT_NEAR(shaded({255, 0, 128}, 0, 0.5)[2], 92, 1);
}

TEST(Shade, DarkerVisibilityIsNeverLighter) {
    int before = 256;
    for (int i = 100; i >= 0; --i) {
        const int value = shaded({200, 200, 200}, static_cast<float>(i) / 100)[0];
        EXPECT_LE(value, before);
        before = value;
    }
}

TEST(Shade, ImagesOfDifferentSizesAreRefused) { EXPECT_THROW((void)shade(cv::Mat3b(4, 4), cv::Mat1f(4, 5)), Error); }

} // namespace
} // namespace scanshade
