// Rays against the discs of a cloud, compared with trying every disc.
#include "ao/cloud/surface/disc_tree.h"
#include "tests/support/points.h"

#include <gtest/gtest.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;
using tests::Dice;

Vector3d direction(Dice& dice) {
    for (;;) {
        const Vector3d d(2 * dice.roll() - 1, 2 * dice.roll() - 1, 2 * dice.roll() - 1);
        if (d.norm() > 0.1 && d.norm() < 1)
            return d.normalized();
    }
}

/// Points in a box, with discs that leave gaps; every seventh has none. Some stand side by side in one plane.
CloudSurface scattered(std::size_t count, Dice& dice) {
    std::vector<Vector3d> points, normals;
    for (std::size_t i = 0; i < count; ++i) {
        points.emplace_back(dice.roll(), dice.roll(), i % 3 == 0 ? 0.25 : dice.roll());
        normals.push_back(i % 3 == 0 ? Vector3d(0, 0, 1) : direction(dice));
    }
    CloudSurface surface = cloud_surface(LocalCloud(points), normals);
    for (std::size_t i = 0; i < surface.size(); ++i) {
        surface.normals[i] = normals[surface.tree.original(i)].cast<float>();
        surface.disc_radius[i] = i % 7 == 0 ? 0 : 0.03F;
    }
    return surface;
}

struct Tried {
    float distance = std::numeric_limits<float>::infinity();
    std::uint32_t index = 0;
};

/// Nearest hit by the definition, in double precision; `doubtful` where a rim or the ray's end is too close to tell.
Tried nearest_of_all(const CloudSurface& surface, const Vector3d& origin, const DiscRay& ray, bool& doubtful) {
    Tried nearest;
    doubtful = false;
    const Vector3d along = ray.direction.cast<double>();
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const double radius = surface.disc_radius[i];
        const Vector3d centre = surface.tree[i].cast<double>(), normal = surface.normals[i].cast<double>();
        const double t = (centre - origin).dot(normal) / along.dot(normal);
        const double off = (origin + t * along - centre).norm();
        constexpr double close = 1e-5;
        if (!(radius > 0) || !(t > ray.near - close) || !(t < ray.far + close) || off > radius + close)
            continue;
        doubtful |= off > radius - close || t < ray.near + close || t > ray.far - close;
        if (t < static_cast<double>(nearest.distance))
            nearest = {static_cast<float>(t), static_cast<std::uint32_t>(i)};
    }
    return nearest;
}

/// Clouds of one leaf, of a few, and of trees of each depth modulo three: a node has eight children, a leaf's parent as
/// many as there are.
TEST(DiscTree, hits_are_those_that_trying_all_discs_finds) {
    Dice dice(3);
    int blocked = 0, free = 0;
    for (const std::size_t count : {std::size_t(5), std::size_t(11), std::size_t(30), std::size_t(90), std::size_t(200),
                                    std::size_t(400), std::size_t(800), std::size_t(3000)}) {
        const CloudSurface surface = scattered(count, dice);
        const DiscTree discs(surface);
        for (int k = 0; k < 300; ++k) {
            const Vector3f at(static_cast<float>(dice.roll()) - 0.5F, static_cast<float>(dice.roll()) - 0.5F,
                              static_cast<float>(dice.roll()) - 0.5F);
            DiscRay ray;
            ray.origin = discs.local(at.cast<double>());
            ray.direction = k % 10 == 0 ? Vector3f(0, 0, k % 20 == 0 ? 1.0F : -1.0F) : direction(dice).cast<float>();
            ray.near = k % 2 == 0 ? 0.0F : 0.05F;
            ray.far = k % 3 == 0 ? 0.3F : 10.0F;
            bool doubtful = false;
            const Tried expected = nearest_of_all(surface, at.cast<double>(), ray, doubtful);
            if (doubtful)
                continue;
            const bool hit = std::isfinite(expected.distance);
            ++(hit ? blocked : free);
            const auto first = discs.first_hit(ray);
            ASSERT_EQ(first.has_value(), hit) << count << " discs, ray " << k;
            if (first) {
                ASSERT_NEAR(first->distance, expected.distance, 1e-5F);
            }
            ASSERT_EQ(discs.blocked(discs.start_at_root(), ray), hit);
            // Two rays to the side of a plane that this one is nearly in.
            const Vector3f beside = ray.origin - Vector3f::Constant(0.02F),
                           normal = (ray.direction.normalized() * 0.01F + ray.direction.unitOrthogonal()).normalized();
            DiscTree::Origins origins{{beside, ray.origin}, {normal, normal}};
            const Vector3f middle = origins.positions.center();
            origins.lowest = std::min(normal.dot(beside - middle), normal.dot(ray.origin - middle));
            ASSERT_EQ(discs.blocked(discs.start_near(origins, ray.far), ray), hit);
        }
    }
    EXPECT_GT(blocked, 300);
    EXPECT_GT(free, 300);
}

TEST(DiscTree, of_discs_hit_at_once_the_first_in_order_counts) {
    const std::vector<Vector3d> points(40, Vector3d(1, 2, 3)), normals(40, Vector3d(0, 0, 1));
    CloudSurface surface = cloud_surface(LocalCloud(points), normals);
    surface.normals.assign(40, Vector3f(0, 0, 1));
    surface.disc_radius.assign(40, 0.1F);
    surface.disc_radius[0] = 0;
    const DiscTree discs(surface);
    DiscRay ray;
    ray.origin = {0, 0, -1};
    ray.direction = {0, 0, 1};
    ray.far = 2;
    ASSERT_TRUE(discs.first_hit(ray));
    EXPECT_EQ(discs.first_hit(ray)->index, 1u);
}

TEST(DiscTree, rays_pass_the_surface_that_they_start_from) {
    const std::vector<Vector3d> points{{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0.05, 0, 0.5}},
        normals(4, Vector3d(0, 0, 1));
    CloudSurface surface = cloud_surface(LocalCloud(points), normals);
    surface.normals.assign(4, Vector3f(0, 0, 1));
    surface.disc_radius.assign(4, 0.1F);
    const DiscTree discs(surface);
    const auto middle = surface.middle;
    DiscRay ray;
    ray.origin = discs.local(Vector3d(0.01, 0, -0.001) - middle);
    ray.direction = Vector3f(0, 0, 1);
    ray.far = 0.4F;
    EXPECT_TRUE(discs.blocked(discs.start_at_root(), ray));
    ray.own_point = discs.local(Vector3d(0, 0, 0) - middle);
    ray.own_normal = {0, 0, 1};
    ray.own_reach = 0.2F;
    ray.own_depth = 0.02F;
    EXPECT_FALSE(discs.blocked(discs.start_at_root(), ray));
    ray.far = 0.6F; // the fourth is out of reach
    EXPECT_TRUE(discs.blocked(discs.start_at_root(), ray));
    ray.own_normal = {1, 0, 0}; // the other wall of a corner
    ray.far = 0.4F;
    EXPECT_TRUE(discs.blocked(discs.start_at_root(), ray));
}

TEST(DiscTree, nothing_blocks_where_there_are_no_discs) {
    for (const std::size_t count : {std::size_t(0), std::size_t(50)}) {
        const std::vector<Vector3d> points(count, Vector3d(1, 1, 1));
        CloudSurface surface = cloud_surface(LocalCloud(points), {});
        surface.disc_radius.assign(count, 0.0F);
        const DiscTree discs(surface);
        DiscRay ray;
        ray.origin = {0, 0, -1};
        ray.direction = {0, 0, 1};
        ray.far = 10;
        EXPECT_FALSE(discs.blocked(discs.start_at_root(), ray));
        EXPECT_FALSE(discs.first_hit(ray));
        EXPECT_EQ(discs.rounding(), 0);
    }
}

} // namespace
} // namespace scanshade
