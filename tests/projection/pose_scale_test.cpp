// Depth in a wrong unit shows where two posed views of one room are compared, and nothing else looks like it.
#include "projection/pose_scale.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>

namespace scanshade {
namespace {

using Eigen::Vector3d;

/// What a camera sees of a room of 4 x 3 x 5 m with a box on its floor.
PosedDepth seen_from(const Eigen::Isometry3d& world_from_camera) {
    const Eigen::AlignedBox3d room(Vector3d(-2, -1.5, -1), Vector3d(2, 1.5, 4)),
        box(Vector3d(-0.6, 0.4, 2), Vector3d(0.5, 1.5, 3));
    PosedDepth view{{{130, 130, 79.5, 59.5, {160, 120}}, cv::Mat1f(120, 160), {}}, world_from_camera};
    const Vector3d origin = world_from_camera.translation();
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u) {
            const Vector3d along = world_from_camera.linear() * view.depth.camera.ray(u, v); // z grows by 1 along it
            const auto interval = [&](const Eigen::AlignedBox3d& solid) {
                double enter = 0, leave = std::numeric_limits<double>::infinity();
                for (int axis = 0; axis < 3; ++axis) {
                    const double one = (solid.min()[axis] - origin[axis]) / along[axis],
                                 other = (solid.max()[axis] - origin[axis]) / along[axis];
                    enter = std::max(enter, std::min(one, other));
                    leave = std::min(leave, std::max(one, other));
                }
                return std::pair(enter, leave);
            };
            const auto [enter, leave] = interval(box);
            view.depth.z_m(v, u) = static_cast<float>(enter < leave ? enter : interval(room).second);
        }
    return view;
}

Eigen::Isometry3d pose(const Vector3d& position, double turn) {
    return Eigen::Translation3d(position) * Eigen::AngleAxisd(turn, Vector3d(0.3, 1, 0.1).normalized());
}

struct Views {
    PosedDepth a = seen_from(pose({0, 0, 0}, 0)), b = seen_from(pose({0.2, -0.1, 0.2}, 0.1));
    void multiply(double factor) {
        a.depth.z_m *= factor;
        b.depth.z_m *= factor;
    }
    [[nodiscard]] std::optional<double> factor() const { return depth_factor_by_poses(a, b); }
};

TEST(pose_scale, right_depths_need_no_factor) { EXPECT_EQ(Views().factor(), 1); }

TEST(pose_scale, a_wrong_unit_is_found) {
    for (const double unit : {0.001, 0.1, 0.2, 2.0, 5.0, 10.0, 1000.0}) {
        Views views;
        views.multiply(unit);
        const auto factor = views.factor();
        ASSERT_TRUE(factor) << unit;
        EXPECT_NEAR(*factor * unit, 1, 0.1) << "factors are tried in steps of a tenth";
    }
}

TEST(pose_scale, a_camera_that_hardly_moves_tells_nothing) {
    Views views;
    views.b = seen_from(pose({0.002, 0, 0}, 0.1));
    views.multiply(5);
    EXPECT_FALSE(views.factor());
}

TEST(pose_scale, wrong_poses_are_no_wrong_unit) {
    Views inverted;
    inverted.a = seen_from(pose({0, 0.1, 0.3}, 0.2));
    for (PosedDepth* view : {&inverted.a, &inverted.b})
        view->world_from_camera = view->world_from_camera.inverse();
    EXPECT_FALSE(inverted.factor());
    Views turned; // by 20 degrees
    turned.b.world_from_camera.rotate(Eigen::AngleAxisd(0.35, Vector3d::UnitY()));
    EXPECT_FALSE(turned.factor());
    Views backward;
    backward.b.world_from_camera.translation() *= -1;
    EXPECT_FALSE(backward.factor());
}

TEST(pose_scale, views_of_different_places_tell_nothing) {
    Views views;
    views.b = seen_from(pose({0, 0, 0.5}, 3.1));
    EXPECT_FALSE(views.factor());
}

/// Both poses written otherwise.
template <class Written>
std::optional<PoseReading> read(const Written& written) {
    // From somewhere in the world, not its origin, where inverses look alike.
    const Eigen::Isometry3d world = pose({3, -1, 2}, 1.2);
    Views views;
    for (PosedDepth* view : {&views.a, &views.b})
        view->world_from_camera = written(world * view->world_from_camera);
    return pose_reading(views.a, views.b);
}

TEST(pose_reading, poses_written_in_another_way_are_found) {
    using Eigen::Isometry3d;
    const Isometry3d turned(Eigen::AngleAxisd(std::acos(-1.0), Vector3d::UnitX()));
    EXPECT_EQ(read([](const Isometry3d& p) { return p; }), PoseReading::recorded);
    EXPECT_EQ(read([](const Isometry3d& p) { return p.inverse(); }), PoseReading::inverse);
    EXPECT_EQ(read([&](const Isometry3d& p) { return p * turned; }), PoseReading::y_up);
    EXPECT_EQ(read([&](const Isometry3d& p) { return (p * turned).inverse(); }), PoseReading::inverse_y_up);
    EXPECT_EQ(read([](const Isometry3d& p) {
                  const Eigen::Quaterniond q(p.linear());
                  return Isometry3d(Eigen::Translation3d(p.translation()) *
                                    Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()));
              }),
              PoseReading::w_first)
        << "w x y z taken for x y z w";
}

TEST(pose_reading, poses_of_another_recording_contradict_the_depths) {
    Views views;
    views.b = seen_from(pose({0.04, 0, 0.03}, 0.01)); // as the next frame is
    EXPECT_EQ(pose_reading(views.a, views.b), PoseReading::recorded);
    views.b.world_from_camera = pose({0.3, 0.2, -0.3}, 0.2);
    EXPECT_EQ(pose_reading(views.a, views.b), PoseReading::contradicted);
    views.b = views.a;
    EXPECT_FALSE(pose_reading(views.a, views.b)) << "without motion nothing is told";
}

TEST(pose_reading, frames_of_different_places_contradict_nothing) {
    Views views;
    for (const double turn : {1.05, 1.57, 3.1}) { // as of a panorama
        views.b = seen_from(pose({0, 0, 0.1}, turn));
        EXPECT_NE(pose_reading(views.a, views.b), PoseReading::contradicted) << turn;
    }
    views.b = views.a; // the next wall of a square room looks the same
    views.b.world_from_camera = pose({0, 0, 0.1}, 1.57);
    EXPECT_FALSE(pose_reading(views.a, views.b));
}

TEST(pose_reading, holes_are_no_contradiction) {
    Views views;
    views.a = seen_from(pose({0, 0.1, 0.3}, 0.2));
    for (PosedDepth* view : {&views.a, &views.b}) // three of four pixels
        for (int v = 0; v < view->depth.z_m.rows; ++v)
            for (int u = 0; u < view->depth.z_m.cols; ++u)
                if (u % 2 != 0 || v % 2 != 0)
                    view->depth.z_m(v, u) = 0;
    EXPECT_NE(pose_reading(views.a, views.b), PoseReading::contradicted);
}

} // namespace
} // namespace scanshade
