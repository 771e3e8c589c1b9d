// Marks of holes and cut-off ranges among depths are found; walls and the steps of a sensor are not mistaken for them.
#include "projection/sensor/depth_ends.h"

#include <cmath>
#include <gtest/gtest.h>
#include <random>

namespace scanshade {
namespace {

/// A floor from 1.5 to 4.5 m, with noise of `sigma` times z^2, in steps of a millimetre.
cv::Mat1f floor_seen(double sigma = 0.0018) {
    cv::Mat1f z(240, 320);
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    for (int v = 0; v < z.rows; ++v)
        for (int u = 0; u < z.cols; ++u) {
            const double clean = 1 / (0.222 + 0.444 * v / 239 + 0.0001 * u);
            z(v, u) = static_cast<float>(std::round(1000 * (clean + sigma * clean * clean * normal(random))) / 1000);
        }
    return z;
}

cv::Mat1f with(cv::Mat1f z, float value, const cv::Rect& where = {100, 50, 60, 40}) {
    z(where) = value;
    return z;
}

cv::Mat1f cut_off(const cv::Mat1f& z, double at) {
    cv::Mat1f result;
    cv::min(z, at, result);
    return result;
}

TEST(depth_ends, sensors_have_none) {
    for (const double sigma : {0.0, 0.0018, 0.01}) {
        const DepthEnds ends = depth_ends(floor_seen(sigma));
        EXPECT_FALSE(ends.nearest) << sigma;
        EXPECT_FALSE(ends.farthest) << sigma;
    }
    cv::Mat1f coarse = floor_seen(); // steps of disparity, as a Kinect's: hundreds of pixels hold the last one
    for (float& z : coarse)
        z = static_cast<float>(1 / (std::round(1 / (z * 0.0028)) * 0.0028));
    EXPECT_FALSE(depth_ends(coarse).farthest);
    EXPECT_FALSE(depth_ends(coarse).nearest);
    EXPECT_FALSE(depth_ends(cv::Mat1f(240, 320, 0.0F)).farthest);
    EXPECT_FALSE(depth_ends(cv::Mat1f(240, 320, 2.0F)).farthest) << "of one value it is not the end";
    EXPECT_FALSE(depth_ends(cv::Mat1f()).nearest);
}

TEST(depth_ends, marks_of_holes_lie_apart) {
    for (const float mark : {10.0F, 65.534F, 1000.0F}) {
        const auto far = depth_ends(with(floor_seen(), mark)).farthest;
        ASSERT_TRUE(far) << mark;
        EXPECT_EQ(far->z_m, mark);
        EXPECT_TRUE(far->apart);
        EXPECT_NEAR(far->share, 0.031, 0.002) << "60 x 40 of 320 x 240";
        EXPECT_TRUE(depth_ends(with(floor_seen(0), mark)).farthest) << "of rendered depth, too";
    }
    const auto near = depth_ends(with(floor_seen(), 0.001F)).nearest;
    ASSERT_TRUE(near);
    EXPECT_TRUE(near->apart);
    EXPECT_FALSE(depth_ends(with(floor_seen(), 10, {100, 50, 6, 6})).farthest) << "a few pixels";
}

TEST(depth_ends, a_range_that_was_cut_off_is_told_from_a_wall) {
    const auto far = depth_ends(cut_off(floor_seen(), 3)).farthest;
    ASSERT_TRUE(far);
    EXPECT_FALSE(far->apart);
    EXPECT_GT(far->share, 0.2);
    EXPECT_FALSE(depth_ends(cut_off(floor_seen(0), 3)).farthest) << "a wall that faces an ideal sensor";
    const auto mark = depth_ends(cut_off(cv::Mat1f(4 * floor_seen(0)), 10)).farthest;
    ASSERT_TRUE(mark) << "at a number by which programs mark holes";
    EXPECT_FALSE(mark->apart);
}

/// What an ideal camera sees: a ball in front of a wall at `wall`, and above a floor where that is nearer.
cv::Mat1f ball_before_a_wall(double wall, bool floor) {
    cv::Mat1f z(240, 320);
    for (int v = 0; v < z.rows; ++v)
        for (int u = 0; u < z.cols; ++u) {
            const double x = (u - 160) / 260.0, y = (v - 120) / 260.0, square = x * x + y * y + 1;
            const double under = 4 - square * (4 - 0.25), low = y > 0 ? 1.2 / y : 1e9; // a radius of .5 m at 2 m
            double depth = floor ? std::min(wall, low) : wall;
            if (under > 0)
                depth = (2 - std::sqrt(under)) / square;
            z(v, u) = static_cast<float>(std::round(1000 * depth) / 1000);
        }
    return z;
}

TEST(depth_ends, walls_that_face_an_ideal_camera_are_none) {
    EXPECT_FALSE(depth_ends(ball_before_a_wall(4.2, false)).farthest) << "apart from the ball";
    EXPECT_FALSE(depth_ends(ball_before_a_wall(4.2, true)).farthest) << "the floor comes up to it";
    EXPECT_TRUE(depth_ends(ball_before_a_wall(50, false)).farthest) << "no wall, but where the renderer ended";
}

} // namespace
} // namespace scanshade
