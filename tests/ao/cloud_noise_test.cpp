// The noise of a cloud: measured, thinned and taken away; what is no noise stays.
#include "ao/cloud/extent.h"
#include "ao/cloud/surface/cleaned_cloud.h"
#include "ao/cloud/surface/cloud_noise.h"
#include "ao/cloud/surface/fitted_cloud.h"
#include "tests/support/points.h"

#include <gtest/gtest.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using tests::corner, tests::Dice, tests::Points, tests::sphere, tests::square;

CloudNoise noise_of(const Points& points, float widest = 0.3F) {
    const LocalCloud local(points);
    return {local.tree, widest};
}
FittedCloud fitted(const Points& points, double radius = 1) {
    return fitted_cloud(LocalCloud(points), points, {}, radius, thinning_grid(Vector3d::Zero(), 0.01));
}

TEST(CloudNoise, of_a_plane_is_known_at_any_density) {
    for (const std::size_t count : {20000, 200000})
        for (const double sigma : {0.002, 0.005, 0.015}) {
            const CloudNoise noise = noise_of(square(count, sigma));
            ASSERT_TRUE(noise.known()) << count << " " << sigma;
            EXPECT_NEAR(static_cast<double>(noise.median()), sigma, 0.12 * sigma) << count;
            EXPECT_NEAR(static_cast<double>(noise.at({0.3F, 0.2F, 0})), sigma, 0.25 * sigma) << count;
        }
}

TEST(CloudNoise, of_a_cloud_without_any_is_next_to_nothing) {
    EXPECT_LT(noise_of(square(50000)).median(), 1e-5F);
    EXPECT_LT(noise_of(sphere(50000, {0, 0, 0})).median(), 2e-4F) << "curvature is no noise";
}

/// Waves as high as noise, but the same side by side; leaves differ side by side, but make no surface.
TEST(CloudNoise, is_neither_structure_nor_leaves) {
    Points waves = square(100000);
    for (Vector3d& p : waves)
        p.z() = 0.01 * std::sin(40 * p.x());
    EXPECT_LT(noise_of(waves).median(), 0.002F);
    Points leaves = square(100000);
    Dice dice(7);
    for (Vector3d& p : leaves)
        p.z() = dice.roll();
    EXPECT_FALSE(noise_of(leaves).known());
}

TEST(CloudNoise, differs_from_place_to_place) {
    Points points = square(100000);
    Dice dice(7);
    for (Vector3d& p : points)
        p.z() = (p.x() < 0 ? 0.002 : 0.006) * dice.gauss();
    const CloudNoise noise = noise_of(points);
    EXPECT_NEAR(noise.at({-0.5F, 0, 0}), 0.002F, 0.0006F);
    EXPECT_NEAR(noise.at({0.5F, 0, 0}), 0.006F, 0.0018F);
}

TEST(FittedCloud, a_noisy_plane_is_flat_and_every_point_is_stood_for) {
    const double sigma = 0.005;
    const Points points = square(100000, sigma);
    const FittedCloud found = fitted(points);
    ASSERT_FALSE(found.empty());
    ASSERT_EQ(found.fitted_of.size(), points.size());
    EXPECT_LT(found.points.size(), points.size() / 2) << "dense points are taken together";
    double squares = 0;
    for (const Vector3d& p : found.points)
        squares += p.z() * p.z();
    EXPECT_LT(std::sqrt(squares / static_cast<double>(found.points.size())), 0.2 * sigma);
    for (std::size_t i = 0; i < points.size(); ++i)
        ASSERT_LT((found.points[found.fitted_of[i]] - points[i]).norm(), 12 * sigma) << i;
}

TEST(FittedCloud, nothing_changes_without_noise) { EXPECT_TRUE(fitted(square(20000)).empty()); }

TEST(FittedCloud, corners_stay_sharp) {
    const double sigma = 0.004;
    const FittedCloud found = fitted(corner(150000, sigma));
    std::size_t off = 0, at_edge = 0;
    for (const Vector3d& p : found.points)
        if (std::min(p.x(), p.z()) < 0.05 && std::max(p.x(), p.z()) < 0.05) {
            ++at_edge;
            off += std::min(std::abs(p.x()), std::abs(p.z())) > 2 * sigma;
        }
    ASSERT_GT(at_edge, 50U);
    EXPECT_LT(static_cast<double>(off), 0.1 * static_cast<double>(at_edge));
}

/// A board eight sigma thick has two sides.
TEST(FittedCloud, sheets_do_not_merge) {
    const double sigma = 0.003, thickness = 8 * sigma;
    Points points = square(200000, sigma), normals;
    for (std::size_t i = 0; i < points.size(); ++i) {
        points[i].z() += i % 2 ? thickness : 0;
        normals.emplace_back(0, 0, i % 2 ? 1 : -1);
    }
    EXPECT_TRUE(fitted(points).empty()) << "without normals, the board's thickness is no noise";
    const FittedCloud found =
        fitted_cloud(LocalCloud(points), points, normals, 1, thinning_grid(Vector3d::Zero(), 0.01));
    ASSERT_FALSE(found.empty());
    EXPECT_NEAR(static_cast<double>(found.noise), sigma, 0.15 * sigma);
    std::size_t between = 0;
    for (const Vector3d& p : found.points)
        between += std::abs(p.z() - thickness / 2) < thickness / 4;
    EXPECT_LT(static_cast<double>(between), 0.05 * static_cast<double>(found.points.size()));
}

/// Slabs of noise larger than the spacing: a plane, or both faces of a board, thicker than their distance is told only
/// by recorded normals.
struct Slabs {
    const char* name;
    double sigma, apart; ///< of the points; of two faces, 0 = one
    bool normals;
};
class CleanedCloud : public testing::TestWithParam<Slabs> {
  protected:
    static constexpr std::size_t count = 60000; // 8 mm apart
    CleanedCloud() : points(square(count, GetParam().sigma)) {
        for (std::size_t i = 0; i < count; ++i) {
            const double side = GetParam().apart > 0 && i % 2 ? -1 : 1;
            points[i].z() += side * GetParam().apart / 2;
            normals.emplace_back(0, 0, side);
        }
    }
    [[nodiscard]] FittedCloud cleaned() const {
        return cleaned_cloud(LocalCloud(points), points, GetParam().normals ? normals : Points(), 0.5,
                             thinning_grid(Vector3d::Zero(), 0.008));
    }
    Points points, normals;
};

TEST_P(CleanedCloud, lies_on_its_surfaces) {
    const FittedCloud cloud = cleaned();
    ASSERT_FALSE(cloud.empty());
    double squares = 0, own_side = 0;
    for (const Vector3d& point : cloud.points)
        squares += std::pow(std::abs(point.z()) - GetParam().apart / 2, 2);
    EXPECT_LT(std::sqrt(squares / static_cast<double>(cloud.points.size())), 0.35 * GetParam().sigma)
        << "raw points have one sigma";
    for (std::size_t i = 0; i < count; ++i)
        own_side += cloud.points[cloud.fitted_of[i]].z() * normals[i].z() >= 0 || GetParam().apart == 0;
    EXPECT_GT(own_side / count, GetParam().normals ? 0.997 : 0.95) << "points stay on their face";
    EXPECT_NEAR(static_cast<double>(cloud.noise), GetParam().sigma, 0.2 * GetParam().sigma);
    EXPECT_LT(cloud.points.size(), count / 2) << "discs are as far apart as the noise is large";
    EXPECT_GT(static_cast<double>(cloud.moved), 0.98 * count);
    ASSERT_EQ(cloud.largest_disc.size(), cloud.points.size());
    for (const float radius : cloud.largest_disc)
        ASSERT_LT(radius, 6 * std::max(GetParam().sigma, 0.008));
}

TEST_P(CleanedCloud, is_the_same_each_time) {
    const FittedCloud one = cleaned(), other = cleaned();
    EXPECT_EQ(one.points, other.points);
    EXPECT_EQ(one.fitted_of, other.fitted_of);
}

INSTANTIATE_TEST_SUITE_P(Of, CleanedCloud,
                         testing::Values(Slabs{"a_plane", 0.02, 0, false}, Slabs{"a_plane_with_normals", 0.02, 0, true},
                                         Slabs{"two_sheets", 0.01, 0.15, false},
                                         Slabs{"a_board_thinner_than_its_noise", 0.02, 0.03, true}),
                         [](const auto& info) { return info.param.name; });

/// Flying pixels between two surfaces make no discs, and have a value all the same.
TEST(CleanedCloud, makes_no_discs_of_points_that_no_plane_explains) {
    Points points = square(60000, 0.012);
    const std::size_t on_surface = points.size();
    Dice dice(9);
    for (int i = 0; i < 1500; ++i)
        points.emplace_back(0.8 * dice.roll(), 2 * dice.roll() - 1, 0.1 + 0.8 * dice.roll());
    const FittedCloud cloud =
        cleaned_cloud(LocalCloud(points), points, {}, 0.5, thinning_grid(Vector3d::Zero(), 0.008));
    std::size_t flying = 0;
    for (const Vector3d& point : cloud.points)
        flying += point.z() > 0.06;
    EXPECT_LT(flying, 75U) << "a twentieth of them";
    ASSERT_EQ(cloud.fitted_of.size(), points.size());
    for (std::size_t i = on_surface; i < points.size(); ++i)
        ASSERT_LT(cloud.fitted_of[i], cloud.points.size());
}

/// Wrong signs would make a second layer of the slab. Of five points three are wrong in 0.0012 of the discs where one
/// in twenty is, in 0.163 where three of ten are (binomial); more points err less.
TEST(CleanedCloud, takes_the_side_that_most_points_recorded) {
    const Points points = square(60000, 0.02);
    const auto cleaned = [&](const Points& normals) {
        return fitted_cloud(LocalCloud(points), points, normals, 0.5, thinning_grid(Vector3d::Zero(), 0.008), true);
    };
    const FittedCloud unsigned_discs = cleaned({});
    for (const auto& [wrong, outvoted] : {std::pair(0.05, 0.0012), std::pair(0.3, 0.163)}) {
        Points normals;
        Dice dice(3);
        for (std::size_t i = 0; i < points.size(); ++i)
            normals.emplace_back(0, 0, dice.roll() < wrong ? -1 : 1);
        const FittedCloud cloud = cleaned(normals);
        ASSERT_EQ(cloud.points, unsigned_discs.points) << wrong;
        ASSERT_EQ(cloud.normals.size(), cloud.points.size());
        std::vector<int> votes(cloud.points.size()), voters(cloud.points.size());
        for (std::size_t i = 0; i < points.size(); ++i) {
            votes[cloud.fitted_of[i]] += normals[i].z() < 0 ? -1 : 1;
            ++voters[cloud.fitted_of[i]];
        }
        double down = 0, known = 0;
        for (std::size_t disc = 0; disc < votes.size(); ++disc) {
            EXPECT_GE(votes[disc] * cloud.normals[disc].z(), 0) << votes[disc] << " of " << voters[disc];
            known += voters[disc] > 4;
            down += voters[disc] > 4 && cloud.normals[disc].z() < 0;
        }
        EXPECT_LT(down, outvoted * known) << wrong;
    }
}

TEST(CleanedCloud, is_asked_for_where_noise_exceeds_the_spacing) {
    for (const auto& [sigma, exceeds] : {std::pair{0.0, false}, {0.0015, false}, {0.012, true}}) {
        const Points points = square(60000, sigma); // 8 mm apart
        const LocalCloud local(points);
        std::vector<NoisePlace> places;
        for (std::uint32_t i = 0; i < 64; ++i)
            places.push_back({i, points[i]});
        const NoiseLook look = look_for_noise(0.5, 0.008);
        const auto whole = noise_at(places, local, {}, look);
        ASSERT_TRUE(whole);
        EXPECT_EQ(whole->exceeds_spacing, exceeds) << sigma;
        NoisePlaces passing(places, look);
        for (std::uint32_t i = 0; i < points.size(); ++i)
            passing.add(i, points[i], nullptr);
        const auto streamed = passing.measured();
        ASSERT_TRUE(streamed);
        EXPECT_EQ(streamed->exceeds_spacing, exceeds) << sigma << ": tiles decide as the whole does";
    }
}

TEST(Extent, is_that_of_the_cloud_and_not_of_its_strays) {
    Points points = square(20000);
    const Extent alone = extent_of(points);
    EXPECT_NEAR(alone.size, 2 * std::sqrt(2.0), 0.1);
    Dice dice(7);
    for (int i = 0; i < 200; ++i)
        points.emplace_back(1e8 * dice.gauss(), 1e8 * dice.gauss(), 1e8 * dice.gauss());
    const Extent found = extent_of(points);
    EXPECT_NEAR(found.size, alone.size, 0.05);
    EXPECT_LT((found.centre - alone.centre).norm(), 0.05);
    EXPECT_LT(found.farthest, 100);
    EXPECT_GT(found.farthest, 1.4);
}

/// A point by itself above a plane occludes nothing; so does none that is a kilometre away.
TEST(Extent, strays_lose_their_discs) {
    Points points = square(20000);
    points.emplace_back(0, 0, 0.5);
    points.emplace_back(0, 0, 0.9);
    CloudSurface surface = cloud_surface(LocalCloud(points), {});
    const auto lonely = drop_strays(surface, Vector3d::Zero(), static_cast<double>(surface.spacing));
    EXPECT_EQ(lonely.size(), 2U);
    std::size_t without = 0;
    for (std::size_t place = 0; place < surface.size(); ++place) {
        without += surface.disc_radius[place] == 0;
        EXPECT_TRUE(surface.tree[place].z() < 0.1F || surface.disc_radius[place] == 0) << place;
    }
    EXPECT_LT(without, 8U) << "the plane keeps its own";
}

} // namespace
} // namespace scanshade
