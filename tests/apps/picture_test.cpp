// Pictures made of depth and visibility.
#include "apps/picture.h"

#include <cmath>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

const Pinhole camera{100, 100, 31.5, 23.5, {64, 48}};

/// A plane through (0, 0, 2), turned by `degrees` about the vertical.
cv::Mat1f plane(double degrees) {
    cv::Mat1f z_m(camera.size);
    const double slope = std::tan(degrees * M_PI / 180);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 0; u < z_m.cols; ++u)
            z_m(v, u) = static_cast<float>(2 / (1 - slope * camera.ray(u, v).x()));
    return z_m;
}

TEST(PictureTest, clay_is_as_bright_as_it_faces_the_camera) {
    for (const double degrees : {0.0, 30.0, 60.0}) {
        const int expected = cvRound(70 + 165 * std::cos(degrees * M_PI / 180));
        EXPECT_NEAR(clay(plane(degrees), camera)(24, 32)[0], expected, 2) << degrees;
    }
}

/// A jump in depth is no surface: without the jump test its pixels would turn almost edge-on, and black.
TEST(PictureTest, clay_keeps_its_brightness_next_to_a_jump_and_a_hole) {
    cv::Mat1f z_m = plane(0);
    z_m.colRange(40, 64) = 3;
    z_m.colRange(0, 10) = 0;
    const cv::Mat3b picture = clay(z_m, camera);
    for (int u = 11; u < 63; ++u)
        EXPECT_GT(picture(24, u)[0], 220) << u;
    EXPECT_NE(picture(24, 5)[0], picture(24, 5)[2]); // holes have a hue, surfaces are grey
}

TEST(PictureTest, depth_pictures_are_black_only_in_holes) {
    cv::Mat1f z_m = plane(30);
    z_m(24, 32) = 0;
    const cv::Mat3b picture = depth_picture(z_m);
    EXPECT_EQ(picture(24, 32), cv::Vec3b(0, 0, 0));
    EXPECT_GT(cv::norm(picture(24, 33)), 50);
    EXPECT_EQ(cv::countNonZero(depth_picture(cv::Mat1f(8, 8, 0.0f)).reshape(1)), 0);
}

TEST(PictureTest, a_panel_holds_its_tiles_side_by_side) {
    const cv::Mat3b tile(48, 64, cv::Vec3b(10, 20, 30));
    const cv::Mat3b both = panel({{"one", tile}, {"none", {}}, {"two", tile}});
    EXPECT_EQ(both.cols, 3 * 64);
    EXPECT_EQ(both(both.rows - 1, 10), cv::Vec3b(10, 20, 30));
    EXPECT_EQ(both(both.rows - 1, 2 * 64 + 10), cv::Vec3b(10, 20, 30));
    EXPECT_TRUE(panel({{"none", {}}}).empty());
}

} // namespace
} // namespace scanshade
