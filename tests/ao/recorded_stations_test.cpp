// Files of several scans say where each scanner stood: sides face it, where that can be right.
#include "ao/cloud/sides/recorded_stations.h"

#include "ao/cloud/cloud_ao.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scanner.h"
#include "tests/support/points.h"
#include "tests/support/says.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <limits>
#include <map>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using tests::Points, tests::says;

const scene::SceneCloud& scans_of(const std::string& name) {
    static std::map<std::string, scene::SceneCloud> clouds;
    if (!clouds.contains(name))
        clouds[name] =
            scene::scanned_cloud(scene::World(scene::scene_named(name)), 60000, {.stations = 6, .noise_m = 0.002});
    return clouds[name];
}

std::vector<Station> stations_at(const scene::SceneCloud& cloud, const Points& positions) {
    std::vector<Station> stations;
    for (std::size_t s = 0; s < positions.size(); ++s)
        stations.push_back({cloud.starts[s], positions[s]});
    return stations;
}

PointVisibility computed(const scene::SceneCloud& cloud, const Points& positions, const Points& normals = {},
                         CloudAoOptions options = {.radius = 0.5}) {
    const std::vector<Station> stations = stations_at(cloud, positions);
    PointSet set{cloud.points, normals};
    set.z_up = true;
    set.stations = stations;
    return CloudAo(std::move(options)).compute(set);
}

/// Of the cloud by itself.
const PointVisibility& without_stations(const std::string& name) {
    static std::map<std::string, PointVisibility> found;
    if (!found.contains(name))
        found[name] = computed(scans_of(name), {});
    return found[name];
}

/// NaN is equal to NaN.
bool same(const PointVisibility& a, const PointVisibility& b) {
    return std::ranges::equal(a.visibility, b.visibility,
                              [](float x, float y) { return x == y || (std::isnan(x) && std::isnan(y)); });
}

/// Share of the points whose normal faces the wrong side, of those whose axis is about right.
double wrong_sides(const PointVisibility& found, const scene::SceneCloud& cloud) {
    double points = 0, wrong = 0;
    for (std::size_t i = 0; i < cloud.points.size(); ++i)
        if (const double cosine = found.normals[i].cast<double>().dot(cloud.normals[i]); std::abs(cosine) >= 0.5)
            ++points, wrong += cosine < 0;
    return wrong / points;
}

std::string said(const PointVisibility& found) {
    return fmt::format("{} {}", fmt::join(found.notes, " "), fmt::join(doubts_in(found.findings), " "));
}

class RecordedStationsOf : public testing::TestWithParam<const char*> {};

/// The estimate without stations errs on 0.03 to 1.2 % of these clouds; stations leave axes that planes have wrong.
TEST_P(RecordedStationsOf, decide_sides_at_least_as_well_as_the_cloud_itself) {
    const scene::SceneCloud& cloud = scans_of(GetParam());
    const PointVisibility with = computed(cloud, cloud.stations);
    EXPECT_LT(wrong_sides(with, cloud), 0.008);
    EXPECT_LE(wrong_sides(with, cloud), wrong_sides(without_stations(GetParam()), cloud) + 0.0005);
    EXPECT_TRUE(says(said(with), "turned to the position that each point was seen from"));
    EXPECT_TRUE(says(said(with), "of the points can be seen from the position of their scan"));
    EXPECT_TRUE(doubts_in(with.findings).empty()) << said(with);
}

TEST_P(RecordedStationsOf, leave_right_normals_alone_and_turn_inverted_ones) {
    const scene::SceneCloud& cloud = scans_of(GetParam());
    EXPECT_TRUE(same(computed(cloud, cloud.stations, cloud.normals), computed(cloud, {}, cloud.normals)));
    Points inverted = cloud.normals;
    for (Vector3d& normal : inverted)
        normal = -normal;
    const PointVisibility turned = computed(cloud, cloud.stations, inverted);
    EXPECT_LT(wrong_sides(turned, cloud), 0.002);
    EXPECT_TRUE(says(said(turned), "of the recorded normals face away from the scanner that recorded them"));
    const PointVisibility kept =
        computed(cloud, cloud.stations, inverted, {.radius = 0.5, .normals = CloudNormals::recorded});
    EXPECT_EQ(wrong_sides(kept, cloud), 1) << "a person is sure of them";
}

INSTANTIATE_TEST_SUITE_P(Scenes, RecordedStationsOf, testing::Values("clutter", "columns", "outdoor"));

Points moved(Points positions, const Vector3d& by) {
    for (Vector3d& position : positions)
        position += by;
    return positions;
}
Points rotated(Points positions) {
    std::rotate(positions.begin(), positions.begin() + 3, positions.end());
    return positions;
}

/// Positions that cannot be right, and what is said of them.
struct WrongStations {
    const char* name;
    const char* scene;
    Points (*positions)(const Points& stations);
    const char* says;
};
class WrongRecordedStations : public testing::TestWithParam<WrongStations> {};

TEST_P(WrongRecordedStations, are_named_and_change_nothing) {
    const WrongStations& wrong = GetParam();
    const scene::SceneCloud& cloud = scans_of(wrong.scene);
    const PointVisibility found = computed(cloud, wrong.positions(cloud.stations));
    EXPECT_TRUE(same(found, without_stations(wrong.scene)));
    EXPECT_TRUE(says(said(found), "where the scanners stood is not used: "));
    EXPECT_TRUE(says(said(found), wrong.says));
}

INSTANTIATE_TEST_SUITE_P(
    Of, WrongRecordedStations,
    testing::Values(WrongStations{"no_poses", "office",
                                  [](const Points& at) { return Points(at.size(), Vector3d::Zero()); },
                                  "all scans name the same position"},
                    WrongStations{"mean", "columns", [](const Points& at) { return Points(at.size(), at[0]); },
                                  "all scans name the same position"},
                    WrongStations{"beside_indoors", "clutter",
                                  [](const Points& at) {
                                      return moved(at, {1.2, -1.2, 0.8});
                                  },
                                  "can be seen from"},
                    WrongStations{"other_scans", "outdoor", [](const Points& at) { return rotated(at); },
                                  "of the points can be seen from the position of their scan"},
                    WrongStations{"deep_below", "outdoor",
                                  [](const Points& at) {
                                      return moved(at, {0, 0, -5000});
                                  },
                                  "nearly all surfaces would look down"},
                    WrongStations{"one_of_six", "office",
                                  [](const Points& at) {
                                      Points positions = at;
                                      positions[2].z() -= 10;
                                      return positions;
                                  },
                                  "of the points of scan 3 can be seen from its position"}),
    [](const auto& info) { return info.param.name; });

TEST(RecordedStations, hold_for_every_tile) {
    const auto cloud =
        scene::scanned_cloud(scene::World(scene::scene_named("columns")), 180000, {.stations = 6, .noise_m = 0.002});
    const PointVisibility found = computed(cloud, cloud.stations, {}, {.radius = 0.5, .memory_mib = 64});
    EXPECT_GT(found.tiles, 1);
    EXPECT_LT(wrong_sides(found, cloud), 0.002);
    EXPECT_TRUE(says(said(found), "turned to the position that each point was seen from"));
}

/// A scan without points has a station, too; points that are holes have no place.
TEST(RecordedStations, of_empty_scans_and_holes_do_no_harm) {
    const scene::SceneCloud& cloud = scans_of("office");
    Points points = cloud.points;
    for (std::size_t i = 0; i < points.size(); i += 9)
        points[i].setConstant(std::numeric_limits<double>::quiet_NaN());
    std::vector<Station> stations = stations_at(cloud, cloud.stations);
    stations.insert(stations.begin() + 2, {stations[2].first, Vector3d(0, 0, -100)});
    stations.push_back({points.size(), Vector3d(0, 0, -100)});
    const RecordedStations found = recorded_stations(stations, points, {});
    ASSERT_EQ(found.seen_from.size(), points.size());
    for (std::size_t s = 0; s < cloud.stations.size(); ++s)
        EXPECT_EQ(found.seen_from[cloud.starts[s] + 1], cloud.stations[s]) << s;
    EXPECT_EQ(found.seen_from.back(), cloud.stations.back());
    EXPECT_TRUE(recorded_stations(stations, Points(points.size(), points[0]), {}).seen_from.empty()) << "all holes";
}

/// Nothing but its scanners tells which side of an empty box was seen.
TEST(RecordedStations, decide_what_the_cloud_cannot) {
    scene::SceneCloud box;
    tests::Dice dice(7);
    for (int i = 0; i < 60000; ++i) {
        Vector3d p(2 * dice.roll() - 1, 2 * dice.roll() - 1, 2 * dice.roll() - 1);
        p[i % 3] = i % 2 ? 1 : -1;
        box.points.push_back(p.cwiseProduct(Vector3d(2, 1.5, 1)) + Vector3d(10, 20, 5));
        Vector3d normal = Vector3d::Zero();
        normal[i % 3] = i % 2 ? -1 : 1;
        box.normals.push_back(normal);
    }
    box.starts = {0, 30000};
    const PointVisibility alone = computed(box, {});
    const auto sides = std::ranges::find(alone.findings, Check::sides, &Finding::check);
    ASSERT_NE(sides, alone.findings.end());
    EXPECT_GT(sides->value, 0.02) << "a room by its height, and that is a guess";
    const PointVisibility found = computed(box, {{10.4, 19.7, 5.1}, {9.3, 20.5, 4.8}});
    EXPECT_TRUE(doubts_in(found.findings).empty()) << said(found);
    EXPECT_LT(wrong_sides(found, box), 0.001);
    EXPECT_FALSE(doubts_in(computed(box, {{90, 40, 25}, {-70, 10, 25}}).findings).empty())
        << "not all of it is seen from there";
}

} // namespace
} // namespace scanshade
