// A camera's motion is told in its own coordinates; poses between others turn and move evenly.
#include "projection/motion.h"

#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using Eigen::AngleAxisd, Eigen::Isometry3d, Eigen::Vector3d;

Isometry3d pose(double turn, const Vector3d& at) {
    Isometry3d made = Isometry3d::Identity();
    made.linear() = AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix();
    made.translation() = at;
    return made;
}

TEST(Motion, is_told_in_the_cameras_coordinates) {
    // Turned by a quarter about z, the camera's x is the world's y: along the world's x it moves towards its own -y.
    constexpr double quarter = std::numbers::pi / 2;
    const Isometry3d before = pose(quarter, {0, 0, 0}), after = pose(quarter + 0.02, {0.1, 0, 0});
    const Motion motion = motion_between(before, after, 0.1, before);
    EXPECT_NEAR((motion.translation_per_s - Vector3d(0, -1, 0)).norm(), 0, 1e-12);
    EXPECT_NEAR((motion.rotation_per_s - Vector3d(0, 0, 0.2)).norm(), 0, 1e-9);
    EXPECT_TRUE(motion.any());
    EXPECT_FALSE(motion_between(before, before, 0.1, before).any());
}

TEST(Motion, poses_between_others_turn_and_move_evenly) {
    const Isometry3d quarter_way = pose_between(pose(0, {0, 0, 0}), pose(0.4, {4, 0, 8}), 0.25);
    EXPECT_NEAR((quarter_way.translation() - Vector3d(1, 0, 2)).norm(), 0, 1e-12);
    EXPECT_NEAR(AngleAxisd(quarter_way.linear()).angle(), 0.1, 1e-12);
}

} // namespace
} // namespace scanshade
