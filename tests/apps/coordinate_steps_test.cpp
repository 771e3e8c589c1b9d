// Coordinates that were rounded more coarsely than points stand apart are found; grids and profiles are no such.
#include "apps/doubts/coordinate_steps.h"

#include <cmath>
#include <gtest/gtest.h>
#include <random>
#include <vector>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

/// 20000 points on the floor and two walls of a room, about 4 cm apart.
Points room(const Vector3d& offset = Vector3d::Zero()) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> share;
    Points points;
    for (int i = 0; i < 20000; ++i) {
        const double a = share(random), b = share(random);
        points.push_back(i % 3 == 0   ? Vector3d(4 * a, 3 * b, 0)
                         : i % 3 == 1 ? Vector3d(4 * a, 0, 2.5 * b)
                                      : Vector3d(0, 3 * a, 2.5 * b));
        points.back() += offset;
    }
    return points;
}

Points rounded(Points points, const Vector3d& steps) {
    for (Vector3d& point : points)
        for (int axis = 0; axis < 3; ++axis)
            if (steps[axis] > 0)
                point[axis] = std::round(point[axis] / steps[axis]) * steps[axis];
    return points;
}

Points in_floats(Points points) {
    for (Vector3d& point : points)
        point = point.cast<float>().cast<double>();
    return points;
}

constexpr double spacing = 0.04;

TEST(coordinate_steps, fine_ones_are_passed) {
    EXPECT_FALSE(coarse_steps(room(), spacing));
    EXPECT_FALSE(coarse_steps(rounded(room(), {0.001, 0.001, 0.001}), spacing)) << "as LAS files hold millimetres";
    EXPECT_FALSE(coarse_steps(rounded(room(), {0.01, 0.01, 0.01}), spacing));
    EXPECT_FALSE(coarse_steps(in_floats(room({5000, 8000, 300})), spacing));
    EXPECT_FALSE(coarse_steps({}, spacing));
    EXPECT_FALSE(coarse_steps(Points(2000, Vector3d::Zero()), spacing));
}

TEST(coordinate_steps, large_coordinates_in_single_precision) {
    const auto found = coarse_steps(in_floats(room({500000, 5800000, 300})), spacing);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->axis, 1);
    EXPECT_EQ(found->step, 0.5);
    EXPECT_TRUE(found->single_precision);
    EXPECT_FALSE(coarse_steps(room({500000, 5800000, 300}), spacing)) << "in double precision";
}

TEST(coordinate_steps, too_few_digits) {
    const auto found = coarse_steps(rounded(room(), {0.1, 0.1, 0.1}), 0.1);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->step, 0.1, 1e-9);
    EXPECT_FALSE(found->single_precision);
    EXPECT_TRUE(coarse_steps(rounded(room(), {0, 0, 1}), spacing)) << "heights in whole metres";
    EXPECT_TRUE(coarse_steps(rounded(room(), {0.1, 0.1, 0}), spacing));
}

TEST(coordinate_steps, grids_of_heights_and_profiles_are_as_they_should_be) {
    Points heights, profiles;
    for (int y = 0; y < 100; ++y)
        for (int x = 0; x < 100; ++x) {
            heights.emplace_back(x, y, 5 * std::sin(x / 8.0) * std::cos(y / 11.0));
            profiles.emplace_back(x, y + 0.3 * std::sin(7.0 * x + y), std::sin(x / 8.0 + y / 9.0));
        }
    EXPECT_FALSE(coarse_steps(heights, 1));
    EXPECT_FALSE(coarse_steps(profiles, 1));
    for (Vector3d& point : heights) // every half metre, at coordinates whose last bit is that
        point = {500000 + point.x() / 2, 5800000 + point.y() / 2, point.z()};
    EXPECT_FALSE(coarse_steps(in_floats(heights), 0.5));
}

TEST(coordinate_steps, voxels_have_the_same_step_along_all_axes) {
    const auto voxels = coarse_steps(rounded(room(), {0.05, 0.05, 0.05}), 0.06);
    ASSERT_TRUE(voxels);
    EXPECT_TRUE(voxels->in_all);
    const auto precision = coarse_steps(in_floats(room({500000, 5800000, 300})), spacing);
    ASSERT_TRUE(precision);
    EXPECT_FALSE(precision->in_all);
}

TEST(coordinate_steps, a_plane_and_strays_have_none) {
    Points plane;
    for (const Vector3d& point : room())
        plane.emplace_back(point.x(), point.y() + point.z(), 0.0);
    for (const double stray : {1000.0, 2010.0, -1500.0})
        plane.emplace_back(0, 0, stray);
    EXPECT_FALSE(coarse_steps(plane, spacing));
}

} // namespace
} // namespace scanshade
