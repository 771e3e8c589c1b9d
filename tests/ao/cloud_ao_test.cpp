// Clouds without a view: laws and closed forms that visibility from the points themselves must keep.
#include "ao/cloud/cloud_ao.h"
#include "ao/cloud/surface/leaf_neighbours.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scanner.h"
#include "projection/base/error.h"
#include "projection/sensor/expected_error.h"
#include "tests/support/files.h"
#include "tests/support/points.h"

#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <numbers>
#include <numeric>
#include <sstream>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using tests::corner, tests::Dice, tests::mean, tests::Points, tests::rms_between, tests::sphere, tests::square;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

PointVisibility visibility(const Points& points, CloudAoOptions options = {}, const Points& normals = {}) {
    return CloudAo(std::move(options)).compute({points, normals});
}

bool any_note(const PointVisibility& found, const std::string& words) {
    return std::any_of(found.notes.begin(), found.notes.end(),
                       [&](const std::string& note) { return note.find(words) != std::string::npos; });
}

TEST(CloudAo, a_plane_is_open_at_any_tilt) {
    for (const double tilt : {0.0, 0.5, 1.2}) {
        Points points = square(20000);
        for (Vector3d& p : points)
            p = Eigen::AngleAxisd(tilt, Vector3d(1, 2, 0).normalized()) * p;
        const auto found = visibility(points, {.radius = 0.5});
        for (const float v : found.visibility)
            ASSERT_GE(v, 0.99F) << tilt;
    }
}

/// Spec's closed form b: floor at distance c R from a long wall, V = 1 - (acos c - c sqrt(1 - c^2)) / pi.
TEST(CloudAo, a_corner_is_as_dark_as_the_closed_form_says) {
    const Points points = corner(80000);
    const double radius = 0.4;
    const auto found = visibility(points, {.radius = radius, .outside = "1,1,1"});
    double squares = 0;
    int count = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Vector3d& p = points[i];
        const double away = std::max(p.x(), p.z()), c = away / radius;
        if (p.y() < radius || p.y() > 2 - radius || away > 2 - radius || c < 0.05)
            continue; // what the cloud's own rims leave open
        const double truth = c >= 1 ? 1 : 1 - (std::acos(c) - c * std::sqrt(1 - c * c)) / std::numbers::pi;
        squares += std::pow(static_cast<double>(found.visibility[i]) - truth, 2);
        ++count;
    }
    EXPECT_GT(count, 20000);
    EXPECT_LT(std::sqrt(squares / count), 0.015);
}

TEST(CloudAo, distance_from_the_origin_changes_nothing) {
    const Points here = corner(20000);
    Points far = here;
    const Vector3d shift(5e6, -5e6, 5e6);
    for (Vector3d& p : far)
        p += shift;
    const auto near_values = visibility(here, {.radius = 0.4, .outside = "1,1,1"});
    const auto far_values = visibility(far, {.radius = 0.4, .outside = "5000001,-4999999,5000001"});
    EXPECT_LT(rms_between(near_values.visibility, far_values.visibility), 0.01);
    EXPECT_NEAR(near_values.spacing, far_values.spacing, 1e-5);
}

TEST(CloudAo, scale_changes_nothing) {
    const Points points = corner(20000);
    Points large = points;
    for (Vector3d& p : large)
        p *= 1000;
    const auto small_values = visibility(points, {.outside = "1,1,1"});
    const auto large_values = visibility(large, {.outside = "1000,1000,1000"});
    EXPECT_NEAR(large_values.radius / small_values.radius, 1000, 0.1);
    EXPECT_LT(rms_between(small_values.visibility, large_values.visibility), 0.01);
}

/// Leaves lie side by side in one plane, one in the open and the next one in the shade. Means over both, whatever their
/// difference, would leave an error of 0.153 here; in rooms, where light changes slowly, the rule costs 0.001 at most.
TEST(CloudAo, leaves_in_the_open_and_in_the_shade_stay_apart) {
    const scene::World world(scene::scene_named("outdoor"));
    const auto cloud = scene::scene_cloud(world, 100000);
    const auto found = visibility(cloud.points, {.radius = 2, .rays = 16}, cloud.normals);
    const auto truth = scene::true_visibility(world, cloud, {.radius_m = 2, .rays = 256}, 4);
    std::printf("outdoor: RMS %.4f\n", rms_between(found.visibility, truth));
    EXPECT_LT(rms_between(found.visibility, truth), 0.15);
}

/// Halving a cloud must not change what its points see: the first half of a scene's points are a scene's points.
TEST(CloudAo, density_changes_hardly_anything) {
    const scene::World world(scene::scene_named("office"));
    const auto all = scene::scene_cloud(world, 200000);
    const auto with = [&](std::size_t count) {
        return visibility({all.points.begin(), all.points.begin() + static_cast<std::ptrdiff_t>(count)},
                          {.radius = 0.5},
                          {all.normals.begin(), all.normals.begin() + static_cast<std::ptrdiff_t>(count)});
    };
    const auto half = with(100000), whole = with(200000);
    EXPECT_LT(rms_between(half.visibility, whole.visibility), 0.045);
    const auto truth = scene::true_visibility(world, all, {.radius_m = 0.5, .rays = 512});
    EXPECT_LT(rms_between(whole.visibility, truth), 0.035);
}

/// Boards and backs of furniture as thin as two gaps between points included. Over twelve clouds 1.5 to 2.3 % of the
/// normals faced away, so two clouds are judged together.
TEST(CloudAo, a_room_without_normals_is_seen_from_inside) {
    const scene::World world(scene::scene_named("office"));
    double away = 0, all = 0;
    for (const int seed : {1, 2}) {
        const auto cloud = scene::scene_cloud(world, 200000, seed);
        const auto found = visibility(cloud.points, {.radius = 0.5});
        EXPECT_TRUE(doubts_in(found.findings).empty()) << tests::joined(doubts_in(found.findings));
        const auto truth = scene::true_visibility(world, cloud, {.radius_m = 0.5, .rays = 256}, 8);
        EXPECT_LT(rms_between(found.visibility, truth), 0.12) << seed;
        for (std::size_t i = 0; i < found.normals.size(); ++i)
            away += found.normals[i].cast<double>().dot(cloud.normals[i]) < 0;
        all += static_cast<double>(found.normals.size());
    }
    EXPECT_LT(away / all, 0.025);
}

TEST(CloudAo, a_ball_without_normals_is_seen_from_outside) {
    const auto found = visibility(sphere(20000, {10, 20, 30}), {.radius = 1.5});
    EXPECT_TRUE(any_note(found, "outward")) << tests::joined(found.notes);
    EXPECT_GT(mean(found.visibility), 0.99); // convex: nothing above any tangent plane
    const auto inside = visibility(sphere(20000, {10, 20, 30}), {.radius = 1, .outside = "inward"});
    EXPECT_NEAR(mean(inside.visibility), 0.75, 0.02); // 1 - R^2 / 4 r^2
}

TEST(CloudAo, terrain_is_seen_from_above_and_scans_from_their_scanner) {
    Points hills = square(20000);
    for (Vector3d& p : hills)
        p = {p.x() * 500 + 512000, p.y() * 500 + 5403000, 40 * std::sin(6 * p.x()) * std::cos(5 * p.y())};
    EXPECT_TRUE(any_note(visibility(hills), "up along z"));
    const auto scan = visibility(sphere(80000, {0.9, 0, 0}), {.radius = 2.1});
    EXPECT_TRUE(any_note(scan, "the origin of the coordinates")) << tests::joined(scan.notes);
    EXPECT_LT(mean(scan.visibility), 0.05); // closed all round
    const auto far = visibility(sphere(50000, {9, 0, 0}), {.radius = 0.5});
    EXPECT_TRUE(any_note(far, "outward")) << tests::joined(far.notes); // its back is hardly farther than its front
}

TEST(CloudAo, recorded_normals_are_taken_only_if_they_lie_on_the_planes) {
    const Points points = square(5000);
    const auto good = visibility(points, {}, Points(points.size(), Vector3d(0, 0, -1)));
    EXPECT_TRUE(any_note(good, "normals: recorded."));
    EXPECT_TRUE(doubts_in(good.findings).empty()) << tests::joined(doubts_in(good.findings));
    const auto bad = visibility(points, {}, Points(points.size(), Vector3d(1, 0, 0)));
    EXPECT_TRUE(any_note(bad, "recorded normals are not used"));
    EXPECT_GT(mean(bad.visibility), 0.99);
    Points torn(points.size());
    for (std::size_t i = 0; i < torn.size(); ++i)
        torn[i] = {0, 0, i % 2 ? 1.0 : -1.0};
    const auto sewn = visibility(points, {}, torn);
    EXPECT_TRUE(any_note(sewn, "sides look random")) << tests::joined(sewn.notes);
    EXPECT_GT(mean(sewn.visibility), 0.99);
    for (const auto& normal : sewn.normals)
        ASSERT_GT(normal.z(), 0.9F);
}

TEST(CloudAo, outside_as_given_turns_recorded_normals_too) {
    const Points points = sphere(20000, {1, 2, 3});
    Points outward;
    for (const Vector3d& p : points)
        outward.push_back(p - Vector3d(1, 2, 3));
    const auto found = visibility(points, {.radius = 1, .outside = "inward"}, outward);
    EXPECT_NEAR(mean(found.visibility), 0.75, 0.02); // 1 - R^2 / 4 r^2
    EXPECT_TRUE(doubts_in(found.findings).empty()) << tests::joined(doubts_in(found.findings));
}

/// Noise of a fifth of the spacing made everything dark before it was measured.
TEST(CloudAo, noise_of_a_scanner_hardly_costs_accuracy) {
    const scene::World world(scene::scene_named("staircase"));
    const auto error = [&](double noise) {
        const auto cloud = scene::scanned_cloud(world, 100000, {.stations = 6, .noise_m = noise});
        const auto found = CloudAo({.radius = 0.5}).compute({cloud.points, cloud.normals});
        return rms_between(found.visibility, scene::true_visibility(world, cloud, {.radius_m = 0.5, .rays = 256}, 8));
    };
    const double clean = error(0);
    EXPECT_LT(clean, 0.09);
    EXPECT_LT(error(0.003), clean + 0.01);
    EXPECT_LT(error(0.010), clean + 0.03);
}

/// Three visits of each surface, each with noise twice the spacing: merged depth frames.
TEST(CloudAo, noise_larger_than_the_spacing_costs_little) {
    const scene::World world(scene::scene_named("office"));
    const auto cloud = scene::scanned_cloud(world, 150000, {.stations = 6, .noise_m = 0.025});
    const auto truth = scene::true_visibility(world, cloud, {.radius_m = 0.5, .rays = 256}, 8);
    for (const bool recorded : {true, false}) {
        const auto found = visibility(cloud.points, {.radius = 0.5}, recorded ? cloud.normals : Points());
        EXPECT_LT(rms_between(found.visibility, truth), recorded ? 0.08 : 0.12);
    }
}

/// From scarce even points to many scanned ones, true errors lie between 0.03 and 0.2.
TEST(CloudAo, the_expected_error_is_near_the_true_one) {
    for (const char* name : {"office", "columns", "outdoor"})
        for (const auto& [points, stations] : {std::pair{40000, 0}, std::pair{150000, 6}}) {
            const scene::World world(scene::scene_named(name));
            const auto cloud = scene::scanned_cloud(world, static_cast<std::size_t>(points), {.stations = stations});
            const double radius = world.scene().ao_radius_m;
            const auto found = visibility(cloud.points, {.radius = radius}, cloud.normals);
            const double error = rms_between(
                found.visibility, scene::true_visibility(world, cloud, {.radius_m = radius, .rays = 256}, 4));
            ASSERT_TRUE(found.expected_error);
            EXPECT_LT(*found.expected_error, 2 * error) << name << ", " << points;
            EXPECT_GT(*found.expected_error, error / 2) << name << ", " << points;
            EXPECT_TRUE(doubts_in(found.findings).empty()) << tests::joined(doubts_in(found.findings));
        }
}

/// Errors where confidence is high are smaller.
TEST(CloudAo, confidence_knows_where_the_error_is) {
    const scene::World world(scene::scene_named("clutter"));
    const auto cloud = scene::scanned_cloud(world, 60000, {.stations = 0});
    const auto found = visibility(cloud.points, {.radius = 0.5});
    const auto truth = scene::true_visibility(world, cloud, {.radius_m = 0.5, .rays = 256}, 4);
    std::vector<float> sure = found.visibility, unsure = found.visibility;
    for (std::size_t i = 0; i < sure.size(); ++i)
        (confidence_from(found.error[i]) > 0.5F ? unsure : sure)[i] = static_cast<float>(nan);
    EXPECT_LT(rms_between(sure, truth), 0.5 * rms_between(unsure, truth));
}

TEST(CloudAo, noise_of_recorded_normals_is_no_noise_of_planes) {
    const Points points = square(20000);
    Dice dice(7);
    Points normals;
    for (std::size_t i = 0; i < points.size(); ++i)
        normals.push_back(Vector3d(0.3 * dice.gauss(), 0.3 * dice.gauss(), 1).normalized());
    EXPECT_GT(mean(visibility(points, {.radius = 0.3}, normals).visibility), 0.99);
}

TEST(CloudAo, far_strays_change_nobody_else) {
    const Points points = corner(60000, 0.002);
    const auto alone = visibility(points);
    Points more = points;
    Dice dice(7);
    for (int i = 0; i < 600; ++i)
        more.push_back(1e8 * Vector3d(2 * dice.roll() - 1, 2 * dice.roll() - 1, 2 * dice.roll() - 1));
    const auto among = visibility(more);
    EXPECT_NEAR(among.radius, alone.radius, 0.01 * alone.radius);
    EXPECT_LT(rms_between(alone.visibility, among.visibility), 0.002);
    EXPECT_TRUE(any_note(among, "strays"));
    for (std::size_t i = points.size(); i < more.size(); ++i)
        ASSERT_TRUE(std::isnan(among.visibility[i]));
}

TEST(CloudAo, a_scan_whose_normals_all_look_away_from_its_scanner_is_doubted) {
    const Points scan = sphere(80000, {0.9, 0, 0}); // the origin sees all of it
    Points outward(scan.size()), inward(scan.size());
    for (std::size_t i = 0; i < scan.size(); ++i) {
        outward[i] = scan[i] - Vector3d(0.9, 0, 0);
        inward[i] = -outward[i];
    }
    const auto towards = visibility(scan, {.radius = 0.5}, inward), away = visibility(scan, {.radius = 0.5}, outward);
    EXPECT_TRUE(doubts_in(towards.findings).empty()) << tests::joined(doubts_in(towards.findings));
    EXPECT_EQ(doubts_in(away.findings).size(), 1);
    EXPECT_GT(mean(away.visibility), 0.99) << "recorded normals are kept";
}

TEST(CloudAo, the_sky_is_seen_by_its_share) {
    const auto flat = visibility(square(10000), {.sky = true});
    for (const float v : flat.visibility)
        ASSERT_GE(v, 0.99F);
    Points wall = square(10000);
    for (Vector3d& p : wall)
        p = {p.x(), 0, p.y()};
    EXPECT_NEAR(mean(visibility(wall, {.sky = true, .outside = "0,-9,0"}).visibility), 0.5, 0.01);
    for (const float v : visibility(square(10000), {.sky = true, .outside = "0,0,-9"}).visibility)
        ASSERT_EQ(v, 0.0F); // a ceiling
    EXPECT_NEAR(mean(visibility(square(10000), {.sky = true, .up = "1,0,0", .outside = "0,0,9"}).visibility), 0.5,
                0.01);
}

TEST(CloudAo, odd_clouds_are_results_not_failures) {
    EXPECT_TRUE(visibility({}).visibility.empty());
    for (const Points& points : {Points{{1, 2, 3}}, Points{{1, 2, 3}, {4, 5, 6}}, Points(50, {1, 2, 3}),
                                 Points(20, {nan, nan, nan}), Points{{nan, nan, nan}, {1, 1, 1}, {2, 2, 2}}}) {
        const auto found = visibility(points, {.outside = "outward"});
        ASSERT_EQ(found.visibility.size(), points.size());
        for (std::size_t i = 0; i < points.size(); ++i) {
            EXPECT_TRUE(std::isnan(found.visibility[i]));
            EXPECT_TRUE(std::isnan(found.error[i]));
        }
    }
    Points line(100, Vector3d::Zero());
    for (std::size_t i = 0; i < line.size(); ++i)
        line[i].x() = static_cast<double>(i) / 10;
    for (const float v : visibility(line, {.outside = "outward"}).visibility)
        EXPECT_TRUE(std::isnan(v)); // no plane, no side
    for (const float error : visibility(line, {.outside = "5,0,9"}).error)
        EXPECT_GT(error, 0.2F) << "no plane tells the side";
}

TEST(CloudAo, holes_and_duplicates_leave_the_others_alone) {
    const Points plain = corner(10000);
    Points holed;
    for (const Vector3d& p : plain) {
        holed.push_back(p);
        holed.push_back({nan, nan, nan});
    }
    const auto expected = visibility(plain, {.radius = 0.4, .outside = "1,1,1"});
    const auto found = visibility(holed, {.radius = 0.4, .outside = "1,1,1"});
    for (std::size_t i = 0; i < plain.size(); ++i) {
        ASSERT_EQ(found.visibility[2 * i], expected.visibility[i]);
        ASSERT_TRUE(std::isnan(found.visibility[2 * i + 1]));
    }
    Points twice = plain;
    twice.insert(twice.end(), plain.begin(), plain.end());
    const auto doubled = visibility(twice, {.radius = 0.4, .outside = "1,1,1"});
    for (std::size_t i = 0; i < twice.size(); ++i)
        ASSERT_EQ(doubled.visibility[i], expected.visibility[i % plain.size()]);
}

TEST(CloudAo, tiles_change_hardly_anything) {
    const Points points = corner(400000);
    const auto whole = visibility(points, {.radius = 0.2, .outside = "1,1,1"});
    const auto tiled = visibility(points, {.radius = 0.2, .outside = "1,1,1", .memory_mib = 64});
    EXPECT_EQ(whole.tiles, 1);
    EXPECT_GE(tiled.tiles, 2);
    EXPECT_EQ(whole.radius, tiled.radius);
    EXPECT_LT(rms_between(whole.visibility, tiled.visibility), 0.015);
    EXPECT_LT(rms_between(whole.error, tiled.error), 0.01);
    ASSERT_TRUE(whole.expected_error && tiled.expected_error);
    EXPECT_NEAR(*whole.expected_error, *tiled.expected_error, 0.003);
}

/// A part of a ball by itself could be seen from either side.
TEST(CloudAo, tiles_agree_about_sides) {
    const auto found = visibility(sphere(250000, {10, 20, 30}), {.radius = 0.2, .memory_mib = 64});
    EXPECT_GE(found.tiles, 2);
    EXPECT_TRUE(doubts_in(found.findings).empty()) << tests::joined(doubts_in(found.findings));
    EXPECT_TRUE(any_note(found, "outward")) << tests::joined(found.notes);
    EXPECT_GT(mean(found.visibility), 0.99);
}

TEST(CloudAo, a_wall_that_holds_most_points_is_divided_too) {
    Points points = square(200000);
    for (std::size_t i = 0; i < points.size(); ++i) // most at the lowest coordinate of the longest axis
        points[i] =
            i % 4 ? Vector3d(0, points[i].x(), points[i].y()) : Vector3d(3 + 3 * points[i].x(), points[i].y(), 0);
    EXPECT_GT(visibility(points, {.radius = 0.1, .rays = 4, .outside = "10,0,10", .memory_mib = 64}).tiles, 1);
}

TEST(CloudAo, same_input_same_bits) {
    const Points points = corner(30000);
    const auto one = visibility(points), other = visibility(points);
    EXPECT_EQ(one.visibility, other.visibility);
    EXPECT_EQ(one.error, other.error);
}

TEST(CloudAo, confidence_is_high_on_planes_and_lower_where_few_discs_span_the_radius) {
    const Points points = square(10000);
    const Points up(points.size(), Vector3d(0, 0, 1));
    const auto confidence = [&](const Points& of, double radius, const Points& normals) {
        return mean(confidence_of_points(visibility(of, {.radius = radius}, normals).error));
    };
    EXPECT_GT(confidence(points, 0.5, up), 0.95);
    EXPECT_GT(confidence(points, 0.5, {}), 0.95) << "sides are nearly sure";
    EXPECT_LT(confidence(points, 0.03, up), confidence(points, 0.5, up));
    const scene::World world(scene::scene_named("clutter"));
    const auto cloud = scene::scanned_cloud(world, 20000, {.stations = 0});
    EXPECT_LT(confidence(cloud.points, 0.2, cloud.normals), 0.45) << "few discs among many things";
    EXPECT_GT(confidence(cloud.points, 2, cloud.normals), 0.5);
}

TEST(CloudAo, the_default_radius_is_a_twentieth_of_the_extent_within_its_bounds) {
    EXPECT_EQ(default_radius(10, 0.01), 0.5);
    EXPECT_EQ(default_radius(10, 0.1), 1.0);
    EXPECT_EQ(default_radius(10, 0.001), 0.2);
    EXPECT_EQ(default_radius(0, 0), 0.0);
}

TEST(CloudAo, fewer_rays_do_where_points_are_dense) {
    const Points points = corner(200000); // 6 mm apart
    const auto few = visibility(points, {.radius = 0.8, .outside = "1,1,1"});
    EXPECT_TRUE(any_note(few, "4 rays a point")) << tests::joined(few.notes);
    const auto many = visibility(points, {.radius = 0.8, .rays = 64, .smooth = 1, .outside = "1,1,1"});
    EXPECT_LT(rms_between(few.visibility, many.visibility), 0.02);
}

TEST(CloudAo, settings_that_cannot_be_are_refused) {
    EXPECT_THROW(CloudAo({.rays = -1}), Misuse);
    EXPECT_THROW(CloudAo({.up = "0,0,0"}), Misuse);
    EXPECT_THROW(CloudAo({.up = "up"}), Misuse);
    EXPECT_THROW(CloudAo({.outside = "1,2"}), Misuse);
    EXPECT_THROW(CloudAo({.outside = "sideways"}), Misuse);
}

TEST(Neighbours, are_those_that_trying_all_points_finds) {
    Dice dice(7);
    std::vector<Eigen::Vector3f> points(700);
    for (auto& p : points)
        p = Eigen::Vector3f(static_cast<float>(dice.roll()), static_cast<float>(dice.roll() * dice.roll()),
                            static_cast<float>(std::round(4 * dice.roll())));
    points[10] = points[20] = points[30];
    const NeighbourTree tree(points);
    Nearest found;
    for (std::size_t i = 0; i < tree.size(); ++i) {
        std::vector<float> all;
        for (std::size_t j = 0; j < tree.size(); ++j)
            if (j != i)
                all.push_back((tree[j] - tree[i]).squaredNorm());
        std::sort(all.begin(), all.end());
        tree.find_round(i, 20, found);
        ASSERT_EQ(found.all().size(), 20u);
        for (std::size_t k = 0; k < 20; ++k)
            ASSERT_EQ(found.all()[k].distance2, all[k]) << i << " " << k;
        ASSERT_EQ(tree[i], points[tree.original(i)]);
    }
}

/// A leaf's points share one list of candidates, whose reach is guessed from the leaf before. Ties, equal points,
/// lonely points and jumps of density must not show.
TEST(Neighbours, of_leaves_are_those_of_single_searches) {
    Dice dice(11);
    const auto roll = [&] { return static_cast<float>(dice.roll()); };
    std::vector<std::vector<Eigen::Vector3f>> clouds(6);
    for (int i = 0; i < 3000; ++i)
        clouds[0].emplace_back(roll(), roll(), std::round(4 * roll())); // sheets
    for (int i = 0; i < 2500; ++i)
        clouds[1].emplace_back(static_cast<float>(i % 50), std::floor(static_cast<float>(i) / 50),
                               0.0F); // ties everywhere
    clouds[2].assign(2000, Eigen::Vector3f(1, 2, 3));
    for (int i = 0; i < 2000; ++i)
        clouds[3].emplace_back(std::pow(10.0F, 8 * roll()), roll(), 0.0F); // every density
    clouds[4].assign(clouds[0].begin(), clouds[0].begin() + 9);            // fewer than wanted
    clouds[5] = clouds[0];
    clouds[5].insert(clouds[5].end(), clouds[2].begin(), clouds[2].end());
    for (const auto& points : clouds)
        for (const std::size_t wanted : {std::size_t(1), std::size_t(6), std::size_t(16), Nearest::most}) {
            const NeighbourTree tree(points);
            std::vector<int> visits(tree.size(), 0);
            std::vector<std::vector<Nearest::Neighbour>> of_leaves(tree.size());
            for_each_neighbourhood(tree, wanted, [&](std::size_t i, std::span<const Nearest::Neighbour> round) {
                ++visits[i];
                of_leaves[i].assign(round.begin(), round.end());
            });
            for (std::size_t i = 0; i < tree.size(); ++i) {
                Nearest single;
                tree.find_round(i, wanted, single);
                ASSERT_EQ(visits[i], 1);
                ASSERT_EQ(of_leaves[i].size(), single.all().size());
                for (std::size_t k = 0; k < of_leaves[i].size(); ++k) {
                    ASSERT_EQ(of_leaves[i][k].point, single.all()[k].point) << i << " " << k;
                    ASSERT_EQ(of_leaves[i][k].distance2, single.all()[k].distance2);
                }
            }
        }
}

TEST(CloudAo, run_gives_a_plain_cloud_a_value_on_every_point) {
    const tests::TemporaryFolder folder;
    std::string text = "ply\nformat ascii 1.0\nelement vertex 2000\nproperty double x\nproperty double y\nproperty "
                       "double z\nend_header\n";
    const Points points = corner(2000);
    for (const Vector3d& p : points)
        text += std::to_string(p.x() + 1e6) + " " + std::to_string(p.y()) + " " + std::to_string(p.z()) + "\n";
    tests::write_file(folder / "c.ply", text);
    const tests::Ran ran =
        tests::run_program("run " + (folder / "c.ply").string() + " -o " + (folder / "out").string());
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    const std::string written = tests::file_bytes(folder / "out/clouds/c.ply");
    EXPECT_NE(written.find("property float ambient_occlusion\nproperty float ao_confidence\n"), std::string::npos);
    EXPECT_EQ(written.find("nan"), std::string::npos);
    EXPECT_TRUE(std::filesystem::exists(folder / "out/shaded/c.png"));
    const std::string manifest = tests::file_bytes(folder / "out/manifest.json");
    EXPECT_NE(manifest.find("radius"), std::string::npos);
    EXPECT_NE(manifest.find("points stand"), std::string::npos);
}

TEST(CloudAo, run_writes_the_error_that_confidence_follows_from) {
    const tests::TemporaryFolder folder;
    std::string text = "ply\nformat ascii 1.0\nelement vertex 2000\nproperty double x\nproperty double y\nproperty "
                       "double z\nend_header\n";
    for (const Vector3d& p : corner(2000))
        text += std::to_string(p.x()) + " " + std::to_string(p.y()) + " " + std::to_string(p.z()) + "\n";
    tests::write_file(folder / "c.ply", text);
    const tests::Ran ran =
        tests::run_program("run " + (folder / "c.ply").string() + " -o " + (folder / "out").string() +
                           " --write cloud,error --cloud.outside inward"); // a corner alone could be of either
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    std::istringstream written(tests::file_bytes(folder / "out/clouds/c.ply"));
    std::string header;
    for (std::string line; line != "end_header" && std::getline(written, line);)
        header += line + "\n";
    ASSERT_NE(header.find("ambient_occlusion\nproperty float ao_confidence\nproperty float ao_error\n"),
              std::string::npos)
        << header;
    double x = 0, y = 0, z = 0, squares = 0;
    float value = 0, confidence = 0, error = 0;
    int count = 0;
    for (; written >> x >> y >> z >> value >> confidence >> error; ++count) {
        ASSERT_NEAR(confidence, confidence_from(error), 1e-4);
        ASSERT_GT(error, 0);
        squares += static_cast<double>(error) * static_cast<double>(error);
    }
    EXPECT_EQ(count, 2000);
    const std::string manifest = tests::file_bytes(folder / "out/manifest.json");
    EXPECT_NE(manifest.find(fmt::format("an error of {:.2f} RMS is expected", std::sqrt(squares / count))),
              std::string::npos)
        << "that of the cloud is the mean of its points'";
}

/// Balls up to half the radius tell noise, and have to be five times as wide as it.
TEST(CloudAo, noise_that_the_radius_is_too_small_to_tell_is_doubted) {
    const Points slab = square(60000, 0.02), up(slab.size(), Vector3d::UnitZ()); // 8 mm apart
    const auto left = [&](double radius) {
        const auto found = visibility(slab, {.radius = radius}, up);
        return std::ranges::any_of(doubts_in(found.findings), [](const std::string& doubt) {
            return doubt.find("larger than the spacing of the points is left") != doubt.npos;
        });
    };
    EXPECT_TRUE(left(0.08));
    EXPECT_FALSE(left(0.5)) << "as the doubt advises";
    const auto exact = visibility(square(60000), {.radius = 0.08}, up);
    EXPECT_TRUE(doubts_in(exact.findings).empty()) << tests::joined(doubts_in(exact.findings));
}

TEST(CloudAo, rings_of_a_spinning_lidar_have_a_larger_expected_error) {
    Points rings, even;
    for (int laser = 0; laser < 16; ++laser) { // on a floor 2 m below, and the walls of a street
        const double down = (1 + 2 * laser) * std::numbers::pi / 180;
        for (int i = 0; i < 1500; ++i) {
            const double turn = 2 * std::numbers::pi * i / 1500;
            const double range = std::min(2 / std::tan(down), 6 / std::max(std::abs(std::sin(turn)), 1e-3));
            rings.emplace_back(range * std::cos(turn), range * std::sin(turn), -range * std::tan(down));
        }
    }
    const auto says_lines = [](const PointVisibility& found) {
        return std::ranges::any_of(found.notes,
                                   [](const std::string& note) { return note.find("on a line") != note.npos; });
    };
    const auto found = visibility(rings, {.radius = 0.5}), of_corner = visibility(corner(20000), {.radius = 0.5});
    EXPECT_TRUE(says_lines(found));
    EXPECT_FALSE(says_lines(of_corner));
    EXPECT_GT(found.expected_error.value_or(0), 0.11) << "what lies between the rings is not seen";
    EXPECT_LT(of_corner.expected_error.value_or(1), 0.08);
}

} // namespace
} // namespace scanshade
