// Two frames laid onto each other: planes at grazing angles, directions that nothing tells, noise, and stated sigmas.
#include "ao/sequence/agreement.h"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>
#include <random>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

struct Plane {
    Vector3d normal; ///< towards the inside of the room
    double offset_m; ///< normal . point + offset = 0
};

const std::vector<Plane> wall{{-Vector3d::UnitZ(), 3}};
const std::vector<Plane> floor{{-Vector3d::UnitY(), 1.2}};
const std::vector<Plane> corner{{-Vector3d::UnitZ(), 3}, {-Vector3d::UnitY(), 0.8}, {Vector3d::UnitX(), 1}};

/// Depth of the nearest plane, up to 8 m, with independent noise of every pixel.
DepthImage seen(const std::vector<Plane>& room, const Isometry3d& world_from_camera, const DepthNoise& noise = {},
                unsigned seed = 1) {
    DepthImage depth{{262.5, 262.5, 159.5, 119.5, {320, 240}}, cv::Mat1f(240, 320, 0.0F), {}};
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (int v = 0; v < 240; ++v)
        for (int u = 0; u < 320; ++u) {
            const Vector3d ray = world_from_camera.linear() * depth.camera.point(u, v, 1);
            double z = 8;
            for (const Plane& plane : room)
                if (const double towards = -plane.normal.dot(ray); towards > 1e-6)
                    z = std::min(z, (plane.normal.dot(world_from_camera.translation()) + plane.offset_m) / towards);
            if (z < 8)
                depth.z_m(v, u) = static_cast<float>(z + noise.at(z) * normal(random));
        }
    return depth;
}

Isometry3d motion(const Vector3d& shift_m, const Vector3d& turn_degrees = Vector3d::Zero()) {
    Isometry3d pose = Isometry3d::Identity();
    if (const double angle = turn_degrees.norm() * std::numbers::pi / 180; angle > 0)
        pose.linear() = Eigen::AngleAxisd(angle, turn_degrees.normalized()).toRotationMatrix();
    pose.translation() = shift_m;
    return pose;
}

const DepthNoise kinect{0.0015, 0.0018, 1};

/// `off` is added to the right pose of a frame 10 cm aside.
Aligned laid(const std::vector<Plane>& room, const Isometry3d& off, const DepthNoise& noise = {}, unsigned seed = 1) {
    const Isometry3d right = motion({0.1, 0.02, 0.05}, {1, -2, 0.5});
    const Facets here = facets_of(seen(room, Isometry3d::Identity(), noise, seed), noise),
                 there = facets_of(seen(room, right, noise, seed + 1000), noise);
    Aligned result = aligned({here, there, 0.5, noise}, off * right);
    result.here_from_there = result.here_from_there * right.inverse(); // what is left of the error
    return result;
}

// At 8 m the floor of a camera 1.2 m above it is seen at 9 degrees.
TEST(Agreement, a_floor_seen_at_a_grazing_angle_has_facets) {
    const Facets facets = facets_of(seen(floor, Isometry3d::Identity()), {});
    int with_depth = 0, with_plane = 0;
    for (int row = 0; row < facets.grid.height; ++row)
        for (int column = 0; column < facets.grid.width; ++column) {
            const int u = column * facets.apart_px + facets.apart_px / 2,
                      v = row * facets.apart_px + facets.apart_px / 2;
            const Facets::Facet& facet = facets.all[static_cast<std::size_t>(row * facets.grid.width + column)];
            with_depth += facets.depth.z_m(v, u) > 0;
            if (facet.normal.isZero())
                continue;
            ++with_plane;
            EXPECT_GT(facet.normal.dot(-Vector3d::UnitY()), 0.9999) << column << ' ' << row;
        }
    EXPECT_GT(with_depth, 500);
    EXPECT_GT(with_plane, 0.95 * with_depth);
}

// A wall tells its distance and two of the turns. Shifts along it and the turn in its plane must stay as recorded: what
// is recorded may well be right.
TEST(Agreement, what_the_planes_do_not_tell_stays_as_recorded) {
    const Isometry3d off = motion({0.03, -0.02, 0.04});
    const Isometry3d left = laid(wall, off).here_from_there;
    EXPECT_NEAR(left.translation().x(), 0.03, 1e-3);
    EXPECT_NEAR(left.translation().y(), -0.02, 1e-3);
    EXPECT_NEAR(left.translation().z(), 0, 1e-3);
    EXPECT_NEAR(left.linear()(0, 1), 0, 1e-3);
    // So it may be off by as much as the rest was: 4 cm in one of three directions.
    EXPECT_NEAR(laid(wall, off).sigma_m, 0.04 / std::sqrt(3), 0.002);
}

TEST(Agreement, three_planes_tell_everything) {
    const Aligned left = laid(corner, motion({0.03, -0.02, 0.04}, {1, -1, 0.5}));
    EXPECT_LT(left.here_from_there.translation().norm(), 1e-3);
    EXPECT_LT((left.here_from_there.linear() - Eigen::Matrix3d::Identity()).norm(), 1e-3);
    EXPECT_LT(left.sigma_m, 1e-3);
}

// Any motion makes noise fit better. A pose that is right would be lost to that.
TEST(Agreement, noise_does_not_move_a_pose_that_is_right) {
    for (unsigned seed = 1; seed <= 10; ++seed) {
        const Aligned left = laid(corner, Isometry3d::Identity(), kinect, seed);
        EXPECT_TRUE(left.here_from_there.isApprox(Isometry3d::Identity(), 1e-12)) << seed;
        EXPECT_EQ(left.sigma_m, 0) << seed;
    }
}

// The sigma is of the least known direction, so most errors are below it, and none far beyond.
TEST(Agreement, sigma_tells_how_far_off_the_surfaces_remain) {
    int within = 0;
    for (unsigned seed = 1; seed <= 20; ++seed) {
        const double sign = seed % 2 == 0 ? 1 : -1;
        const Aligned left = laid(corner, motion({0.03 * sign, -0.02, 0.02}, {0.5, sign, 0.3}), kinect, seed);
        const Vector3d surfaces(0, 0.2, 2.6); // about their middle
        const double off_m = (left.here_from_there * surfaces - surfaces).norm();
        EXPECT_GT(left.sigma_m, 0) << seed;
        EXPECT_LT(off_m, 4 * left.sigma_m) << seed;
        within += off_m < 2 * left.sigma_m;
    }
    EXPECT_GE(within, 17);
}

TEST(Agreement, frames_that_share_no_planes_stay_as_they_are) {
    const Facets here = facets_of(seen(wall, Isometry3d::Identity()), {});
    Facets none = here;
    for (Facets::Facet& facet : none.all)
        facet = {};
    const Isometry3d recorded = motion({0.1, 0, 0});
    EXPECT_TRUE(aligned({here, none, 0.5, {}}, recorded).here_from_there.isApprox(recorded, 1e-15));
    EXPECT_FALSE(agreement({here, none, 0.5, {}}, recorded).fits());
}

} // namespace
} // namespace scanshade
