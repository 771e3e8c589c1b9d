// Which side of a cloud's planes was scanned: from graphs of patches to whole scenes.
#include "ao/cloud/sides/sides.h"

#include "ao/cloud/cloud_ao.h"
#include "ao/cloud/sides/noise_camera.h"
#include "ao/cloud/sides/patches.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scanner.h"
#include "projection/base/hash.h"
#include "projection/sensor/expected_error.h"
#include "tests/support/files.h"
#include "tests/support/points.h"

#include <functional>
#include <gtest/gtest.h>
#include <limits>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;
using tests::Dice, tests::Points, tests::sphere, tests::square;

/// Shares of the points whose normal is on the wrong side, and of those that claim to be sure of it.
struct Wrong {
    double all = 0, sure = 0, share_sure = 0;
};
Wrong wrong_sides(const PointVisibility& found, const Points& truth) {
    double points = 0, wrong = 0, sure = 0, surely_wrong = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        const double cosine = found.normals[i].cast<double>().dot(truth[i]);
        if (std::abs(cosine) < 0.5)
            continue;
        const bool is_sure = confidence_from(found.error[i]) > 0.8F;
        points += 1, wrong += cosine < 0, sure += is_sure, surely_wrong += is_sure && cosine < 0;
    }
    return {wrong / points, surely_wrong / std::max(sure, 1.0), sure / points};
}

const scene::World& world_of(const std::string& name) {
    static std::map<std::string, scene::World> worlds;
    return worlds.try_emplace(name, scene::scene_named(name)).first->second;
}

PointVisibility visibility(const Points& points, const Points& normals = {}, CloudAoOptions options = {.radius = 0.5}) {
    return CloudAo(std::move(options)).compute({points, normals});
}

TEST(SignedGraph, strong_links_outvote_weak_ones_and_parallel_ones_add_up) {
    SignedGraph graph(6);
    graph.add(0, 1, 5);
    graph.add(1, 2, -4);
    graph.add(0, 2, 1); // against the two above
    graph.add(2, 3, 0.6);
    graph.add(2, 3, -1.2); // together -0.6
    graph.add(5, 5, -9);   // says nothing
    const auto signs = graph.signs();
    EXPECT_EQ(signs[0], signs[1]);
    EXPECT_EQ(signs[1], -signs[2]);
    EXPECT_EQ(signs[2], -signs[3]);
    EXPECT_EQ(signs, graph.signs()) << "deterministic";
}

/// Two halves, each of one mind, held together by many weak links that a few strong ones contradict.
TEST(SignedGraph, many_weak_links_between_parts_outvote_a_few_strong_ones) {
    constexpr std::uint32_t half = 200;
    SignedGraph graph(2 * half);
    Dice dice(5);
    const auto any = [&] { return static_cast<std::uint32_t>(dice.roll() * half); };
    for (std::uint32_t k = 0; k < 10 * half; ++k) {
        graph.add(any(), any(), 1);
        graph.add(half + any(), half + any(), 1);
        graph.add(any(), half + any(), 0.1);
    }
    for (int k = 0; k < 20; ++k)
        graph.add(any(), half + any(), -5);
    const auto signs = graph.signs();
    EXPECT_EQ(std::count(signs.begin(), signs.end(), signs[0]), 2 * half);
}

/// Every point of a patch agrees on a side, whatever signs its planes came with; patches do not cross a corner.
TEST(Patches, agree_within_themselves_and_end_at_corners) {
    Points points = tests::corner(20000);
    CloudSurface surface = cloud_surface(LocalCloud(points), {});
    Dice dice(7);
    for (Vector3f& normal : surface.normals)
        if (dice.roll() < 0.5)
            normal = -normal;
    const Patches patches = patches_of(surface);
    std::vector<Vector3f> sides(patches.count, Vector3f::Zero());
    std::size_t opposed = 0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const Vector3f side = static_cast<float>(patches.sign(i)) * surface.normals[i];
        Vector3f& sum = sides[patches.patch[i]];
        opposed += side.dot(sum) < 0;
        sum += side;
    }
    EXPECT_LT(static_cast<double>(opposed), 0.002 * static_cast<double>(surface.size()));
    EXPECT_LT(patches.count, surface.size() / 10);
}

TEST(RecordedSides, of_thin_boards_do_not_contradict_each_other) {
    Points board = square(40000);
    Points normals;
    for (std::size_t i = 0; i < board.size(); ++i) {
        board[i].z() = i % 2 ? 0.002 : 0;
        normals.emplace_back(0, 0, i % 2 ? 1 : -1);
    }
    const auto found = [&] { return contradiction(cloud_surface(LocalCloud(board), normals)); };
    EXPECT_LT(found(), 0.001) << "two sheets";
    Dice dice(7);
    for (Vector3d& normal : normals)
        if (dice.roll() < 0.5)
            normal = -normal;
    EXPECT_GT(found(), 0.35);
}

/// Sides recorded wrongly in one of several ways, how they contradict each other, and what is wrong before and after
/// the repair.
struct WrongSides {
    const char* name;
    double tilt_deg;                                             ///< sigma of the recorded axes
    bool (*turned)(const Vector3d& point, double random);        ///< whether a point's normal is turned over
    double contradiction_from, contradiction_below, wrong_after; ///< shares
};
class WrongRecordedSides : public testing::TestWithParam<WrongSides> {};

TEST_P(WrongRecordedSides, are_noticed_and_repaired) {
    const WrongSides& wrong = GetParam();
    const auto cloud = scene::scanned_cloud(world_of("clutter"), 60000, {.stations = 6, .noise_m = 0.002});
    Dice dice(7);
    Points normals = cloud.normals;
    for (std::size_t i = 0; i < normals.size(); ++i) {
        const double tilt = wrong.tilt_deg * std::numbers::pi / 180;
        normals[i] = (normals[i] + tilt * Vector3d(dice.gauss(), dice.gauss(), dice.gauss())).normalized();
        if (wrong.turned(cloud.points[i], dice.roll()))
            normals[i] = -normals[i];
    }
    const CloudSurface surface = cloud_surface(LocalCloud(cloud.points), normals);
    const double found = contradiction(surface);
    EXPECT_GE(found, wrong.contradiction_from);
    EXPECT_LT(found, wrong.contradiction_below);
    const RepairedSides repaired = repaired_sides(surface);
    double still_wrong = 0, undecided = 0, turned = 0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const std::uint32_t point = surface.tree.original(i);
        still_wrong += repaired.sign[i] * normals[point].dot(cloud.normals[point]) < 0;
        undecided += repaired.sign[i] == 0;
        turned += repaired.sign[i] < 0;
    }
    const auto all = static_cast<double>(surface.size());
    EXPECT_LE(still_wrong / all, wrong.wrong_after);
    EXPECT_NEAR(repaired.undecided, undecided / all, 1e-9);
    EXPECT_NEAR(repaired.turned, turned / all, 1e-9);
    EXPECT_EQ(repaired.undecided > 0.5, found > 0.25) << "random signs tell nothing, others do";
}

INSTANTIATE_TEST_SUITE_P(
    Of, WrongRecordedSides,
    testing::Values(
        WrongSides{"right", 0, [](const Vector3d&, double) { return false; }, 0, 0.0005, 0.001},
        WrongSides{"rough", 15, [](const Vector3d&, double) { return false; }, 0, 0.005, 0.002},
        WrongSides{"inverted", 0, [](const Vector3d&, double) { return true; }, 0, 0.0005, 1},
        WrongSides{"some", 0, [](const Vector3d&, double random) { return random < 0.05; }, 0.05, 0.11, 0.005},
        WrongSides{
            "cubes", 0,
            [](const Vector3d& p, double) { return static_cast<long>((p / 0.6).array().floor().sum()) % 4 == 0; }, 0.02,
            0.2, 0.05},
        WrongSides{"random", 0, [](const Vector3d&, double random) { return random < 0.5; }, 0.3, 0.52, 0.5}),
    [](const auto& info) { return info.param.name; });

/// What is doubted, but for an error that so few points make plausible.
std::string doubts_of_sides(const PointVisibility& found) {
    std::vector<std::string> doubts = doubts_in(found.findings);
    std::erase_if(doubts, [](const std::string& doubt) {
        return doubt.starts_with("an error of") || doubt.starts_with("a part of the points");
    });
    return tests::joined(doubts);
}

class Scans : public testing::TestWithParam<const char*> {};

TEST_P(Scans, without_normals_are_seen_from_where_they_were_scanned) {
    const auto cloud = scene::scanned_cloud(world_of(GetParam()), 100000, {.stations = 6, .noise_m = 0.002});
    const auto found = visibility(cloud.points);
    const Wrong wrong = wrong_sides(found, cloud.normals);
    EXPECT_LT(wrong.all, 0.03);
    EXPECT_LT(wrong.sure, 0.002);
    EXPECT_GT(wrong.share_sure, 0.34) << "above 0.8 an error below 0.06 is expected, whatever the side or the noise";
    EXPECT_EQ(doubts_of_sides(found), "");
}

TEST_P(Scans, with_random_signs_or_some_patches_turned_over_come_out_the_same) {
    const auto cloud = scene::scanned_cloud(world_of(GetParam()), 100000, {.stations = 6, .noise_m = 0.002});
    Dice dice(7);
    Points random = cloud.normals, torn = cloud.normals;
    for (Vector3d& normal : random)
        if (dice.roll() < 0.5)
            normal = -normal;
    for (std::size_t i = 0; i < torn.size(); ++i) // every fourth cube of 60 cm
        if (const Vector3d cell = (cloud.points[i] / 0.6).array().floor();
            static_cast<long>(cell.sum()) % 4 == 0 && torn[i].norm() > 0)
            torn[i] = -torn[i];
    EXPECT_LT(wrong_sides(visibility(cloud.points, random), cloud.normals).all, 0.03);
    const auto mended = visibility(cloud.points, torn);
    EXPECT_LT(wrong_sides(mended, cloud.normals).all, 0.03);
    EXPECT_TRUE(std::any_of(mended.notes.begin(), mended.notes.end(),
                            [](const std::string& note) { return note.find("were turned") != note.npos; }));
}

TEST_P(Scans, keep_recorded_normals_that_are_right) {
    const auto cloud = scene::scanned_cloud(world_of(GetParam()), 100000, {.stations = 6, .noise_m = 0.002});
    const auto found = visibility(cloud.points, cloud.normals);
    EXPECT_EQ(wrong_sides(found, cloud.normals).all, 0);
    EXPECT_EQ(doubts_of_sides(found), "");
}

INSTANTIATE_TEST_SUITE_P(of, Scans, testing::Values("office", "clutter", "thin", "columns", "outdoor"));

/// Thin boards and backs of furniture, as dense as the rest; no scanner's density tells where it stood.
TEST(Sides, a_room_of_even_density_is_seen_from_within) {
    for (const char* name : {"office", "thin", "columns"}) {
        const auto cloud = scene::scene_cloud(world_of(name), 100000);
        const Wrong wrong = wrong_sides(visibility(cloud.points), cloud.normals);
        EXPECT_LT(wrong.all, 0.06) << name;
        EXPECT_LT(wrong.sure, 0.01) << name;
    }
}

TEST(Sides, true_normals_of_boards_and_shelves_are_kept) {
    for (const char* name : {"clutter", "thin"}) {
        const auto cloud = scene::scene_cloud(world_of(name), 100000);
        const auto found = visibility(cloud.points, cloud.normals);
        EXPECT_EQ(wrong_sides(found, cloud.normals).all, 0) << name;
    }
}

/// Frames of a camera before a table see it from one side only. The place beneath it sees as much.
TEST(Sides, right_normals_of_merged_depth_frames_are_kept) {
    const scene::World& world = world_of("clutter");
    constexpr int width = 120, height = 90, focal_px = 100;
    Points points, normals;
    for (int frame = 0; frame < 12; ++frame) {
        const Eigen::Isometry3d pose = scene::world_from_camera(world.scene().walk, frame);
        for (int v = 0; v < height; ++v)
            for (int u = 0; u < width; ++u) {
                const Vector3d ray = pose.linear() * Vector3d(u - 0.5 * width, v - 0.5 * height, focal_px).normalized();
                if (const scene::Hit hit = world.cast({pose.translation(), ray}); hit.body) {
                    points.push_back(pose.translation() + hit.t * ray);
                    normals.push_back(hit.normal);
                }
            }
    }
    const auto found = visibility(points, normals);
    EXPECT_EQ(wrong_sides(found, normals).all, 0);
    EXPECT_EQ(doubts_of_sides(found), "");
}

/// What two answers explain equally well is doubted.
TEST(Sides, an_empty_box_could_be_either) {
    Points box;
    Dice dice(7);
    for (int i = 0; i < 60000; ++i) {
        Vector3d p(2 * dice.roll() - 1, 2 * dice.roll() - 1, 2 * dice.roll() - 1);
        p[i % 3] = i % 2 ? 1 : -1;
        box.push_back(p.cwiseProduct(Vector3d(2, 1.5, 1)) + Vector3d(10, 20, 5));
    }
    const PointVisibility alone = visibility(box);
    const auto sides = std::ranges::find(alone.findings, Check::sides, &Finding::check);
    ASSERT_NE(sides, alone.findings.end());
    EXPECT_GT(sides->value, 0.02) << "as high as a room, it is most likely one";
    EXPECT_LT(sides->value, 0.1);
    for (const bool within : {true, false}) { // a sweep's scanner decides
        const Vector3d scanner = within ? Vector3d(10.4, 19.7, 5.1) : Vector3d(90, 40, 25);
        const auto swept = CloudAo({.radius = 0.5}).compute({box, {}, {}, false, true}, scanner);
        if (within) {
            EXPECT_TRUE(doubts_in(swept.findings).empty()) << tests::joined(doubts_in(swept.findings));
            EXPECT_GT(swept.normals[1].cast<double>().dot(scanner - box[1]), 0);
        } else {
            EXPECT_FALSE(doubts_in(swept.findings).empty()) << "not all of it is seen from there";
        }
    }
    EXPECT_TRUE(doubts_in(visibility(box, {}, {.radius = 0.5, .outside = "inward"}).findings).empty());
}

TEST(Sides, round_bodies_are_seen_from_outside) {
    Points snowman;
    for (const auto& [x, z, r] : {std::array{0.0, 0.0, 1.0}, {0.0, 1.3, 0.7}, {0.0, 2.2, 0.45}, {0.8, 1.3, 0.3}})
        for (const Vector3d& p : sphere(static_cast<std::size_t>(20000 * r * r), {0, 0, 0}))
            snowman.push_back(r * p + Vector3d(x, 0, z));
    const std::array<std::pair<Vector3d, double>, 4> balls = {
        {{{0, 0, 0}, 1}, {{0, 0, 1.3}, 0.7}, {{0, 0, 2.2}, 0.45}, {{0.8, 0, 1.3}, 0.3}}};
    std::erase_if(snowman, [&](const Vector3d& p) {
        return std::any_of(balls.begin(), balls.end(),
                           [&](const auto& ball) { return (p - ball.first).norm() < 0.999 * ball.second; });
    });
    const auto found = visibility(snowman);
    double inward = 0;
    for (std::size_t i = 0; i < snowman.size(); ++i) {
        double outside = 0;
        for (const auto& [centre, radius] : balls)
            if (const Vector3d out = snowman[i] - centre; std::abs(out.norm() - radius) < 1e-6)
                outside = found.normals[i].cast<double>().dot(out);
        inward += outside < 0;
    }
    EXPECT_LT(inward, 0.01 * static_cast<double>(snowman.size()));
    EXPECT_TRUE(doubts_in(found.findings).empty()) << tests::joined(doubts_in(found.findings));
}

/// The faces of boxes that stand on each other, without what lies within another one; normals look out.
struct Faces {
    Points points, normals;
};
Faces faces_of(const std::vector<Eigen::AlignedBox3d>& boxes, double points_per_area) {
    Faces faces;
    Dice dice(3);
    for (const auto& box : boxes)
        for (int axis = 0; axis < 3; ++axis)
            for (const double side : {-1.0, 1.0}) {
                const Vector3d normal = side * Vector3d::Unit(axis);
                const Vector3d size = box.sizes();
                const double area = size.prod() / size[axis];
                for (int i = 0; i < points_per_area * area; ++i) {
                    Vector3d at = box.min() + size.cwiseProduct(Vector3d(dice.roll(), dice.roll(), dice.roll()));
                    at[axis] = side < 0 ? box.min()[axis] : box.max()[axis];
                    const bool inside = std::ranges::any_of(
                        boxes, [&](const auto& other) { return other.contains(at + 1e-6 * normal); });
                    if (!inside) {
                        faces.points.push_back(at);
                        faces.normals.push_back(normal);
                    }
                }
            }
    return faces;
}

/// Half a metre high, in the shape of an L: only its height tells that it is no room.
TEST(Sides, an_angular_body_too_low_for_a_room_is_none_and_its_recorded_normals_are_believed) {
    const Faces block =
        faces_of({{Vector3d(0, 0, 0), Vector3d(1, 0.4, 0.5)}, {Vector3d(0, 0.4, 0), Vector3d(0.4, 1, 0.5)}}, 10000);
    const auto alone = visibility(block.points, {}, {.radius = 0.1});
    EXPECT_EQ(doubts_of_sides(alone), "");
    EXPECT_LT(wrong_sides(alone, block.normals).all, 0.01);
    const auto recorded = visibility(block.points, block.normals, {.radius = 0.1});
    EXPECT_EQ(doubts_of_sides(recorded), "");
    EXPECT_EQ(wrong_sides(recorded, block.normals).all, 0);
}

/// As high as a room, it is taken for one; lower, it is doubted.
TEST(Sides, an_empty_room_of_several_parts_is_one_by_its_height) {
    const Faces room =
        faces_of({{Vector3d(0, 0, 0), Vector3d(5, 2, 2.5)}, {Vector3d(0, 2, 0), Vector3d(2, 5, 2.5)}}, 400);
    const auto found = visibility(room.points);
    EXPECT_GT(wrong_sides(found, room.normals).all, 0.99) << "the faces look out";
    EXPECT_EQ(doubts_of_sides(found), "");
    Points low = room.points;
    for (Vector3d& point : low)
        point *= 0.5;
    EXPECT_NE(doubts_of_sides(visibility(low, {}, {.radius = 0.3})), "");
}

/// Its wheels reach into it, so the places that explain it best stand within.
TEST(Sides, right_normals_of_a_car_are_believed) {
    Faces car = faces_of(
        {{Vector3d(-2, -0.8, 0.3), Vector3d(2, 0.8, 0.9)}, {Vector3d(-1, -0.7, 0.9), Vector3d(1, 0.7, 1.5)}}, 400);
    Dice dice(9);
    const auto add = [&](const Vector3d& at, const Vector3d& normal) {
        car.points.push_back(at);
        car.normals.push_back(normal);
    };
    for (const double x : {-1.3, 1.3})
        for (const double y : {-0.85, 0.65})
            for (int i = 0; i < 380; ++i) { // of a radius of 30 cm, 20 cm wide
                const double turn = 2 * std::numbers::pi * dice.roll(), off = 0.3 * std::sqrt(dice.roll());
                const Vector3d axle(x, y, 0.3), out(std::cos(turn), 0, std::sin(turn));
                if (i < 150)
                    add(axle + 0.3 * out + Vector3d(0, 0.2 * dice.roll(), 0), out);
                else
                    add(axle + off * out + Vector3d(0, i % 2 ? 0.2 : 0, 0), Vector3d(0, i % 2 ? 1 : -1, 0));
            }
    const auto found = visibility(car.points, car.normals, {.radius = 0.3});
    EXPECT_EQ(doubts_of_sides(found), "");
    EXPECT_EQ(wrong_sides(found, car.normals).all, 0);
}

/// Beneath a table, at the origin, no scanner stood, though nearly all is seen first from there.
TEST(Sides, right_normals_of_a_table_are_kept) {
    std::vector<Eigen::AlignedBox3d> boxes{{Vector3d(0, 0, 0.7), Vector3d(1.2, 0.8, 0.74)}};
    for (const double x : {0.02, 1.12})
        for (const double y : {0.02, 0.72})
            boxes.emplace_back(Vector3d(x, y, 0), Vector3d(x + 0.06, y + 0.06, 0.7));
    const Faces table = faces_of(boxes, 6000);
    EXPECT_EQ(wrong_sides(visibility(table.points, table.normals, {.radius = 0.1}), table.normals).all, 0);
}

TEST(Sides, a_ball_whose_normals_look_in_is_doubted) {
    const Points ball = sphere(20000, {3, 1, 2});
    Points outward, inward;
    for (const Vector3d& point : ball) {
        outward.push_back(point - Vector3d(3, 1, 2));
        inward.push_back(-outward.back());
    }
    EXPECT_EQ(doubts_of_sides(visibility(ball, outward)), "");
    EXPECT_NE(doubts_of_sides(visibility(ball, inward)), "");
}

/// A room of 4 x 3 x 2.5 m with a table, seen from one place by rays of even angles.
Points seen_in_room(const Vector3d& camera) {
    Dice dice(4);
    Points points;
    for (int i = 0; i < 60000; ++i) {
        const Vector3d along = Vector3d(dice.gauss(), dice.gauss(), dice.gauss()).normalized();
        double far = std::numeric_limits<double>::infinity();
        for (int axis = 0; axis < 3; ++axis)
            far = std::min(far, ((along[axis] > 0 ? Vector3d(4, 3, 2.5)[axis] : 0) - camera[axis]) / along[axis]);
        const double table = (0.7 - camera.z()) / along.z();
        if (const Vector3d at = camera + table * along; table > 0 && (at - Vector3d(2.5, 1.5, 0.7)).norm() < 0.7)
            far = std::min(far, table);
        points.push_back(camera + far * along);
    }
    return points;
}

TEST(NoiseCamera, stands_where_noise_grows_from) {
    const Vector3d camera(1.2, 0.9, 1.5);
    CloudSurface surface = cloud_surface(LocalCloud(seen_in_room(camera)), {});
    const DiscRays rays(surface);
    const auto found = [&](const std::function<double(const Vector3d& point)>& sigma) {
        surface.noise.clear();
        for (std::size_t i = 0; i < surface.size(); ++i)
            surface.noise.push_back(static_cast<float>(sigma(surface.middle + surface.tree[i].cast<double>())));
        return camera_of_noise(surface, rays);
    };
    const auto told = found([&](const Vector3d& point) { return 0.002 + 0.002 * (point - camera).squaredNorm(); });
    ASSERT_TRUE(told);
    EXPECT_LT((surface.middle + told->position.cast<double>() - camera).norm(), 0.4);
    EXPECT_GT(told->seen, 0.9);
    EXPECT_GT(told->noise, 0.9);
    EXPECT_GT(told->density, 0.5);
    Dice dice(6);
    EXPECT_FALSE(found([&](const Vector3d&) { return 0.01 + 0.01 * dice.roll(); })) << "no distance tells of it";
}

TEST(Sides, half_of_the_boxes_turned_over_are_no_majority) {
    const auto cloud = scene::scanned_cloud(world_of("office"), 100000, {.stations = 6});
    for (const double side : {0.3, 1.0}) {
        Points normals = cloud.normals;
        for (std::size_t i = 0; i < normals.size(); ++i) {
            const Eigen::Vector3i box = (cloud.points[i] / side).array().floor().cast<int>();
            std::uint32_t number = 0;
            for (const int along : box)
                number = hash(number, static_cast<std::uint32_t>(along));
            if (number & 1U)
                normals[i] = -normals[i];
        }
        const PointVisibility found = visibility(cloud.points, normals);
        EXPECT_LT(wrong_sides(found, cloud.normals).all, 0.01) << side << ": " << tests::joined(found.notes);
    }
}

TEST(Sides, terrain_whose_normals_look_down_is_doubted_where_z_is_up) {
    Points hills, normals;
    Dice dice(3);
    for (int i = 0; i < 20000; ++i) { // plants let no station see clean fronts
        const double x = 100 * dice.roll(), y = 100 * dice.roll();
        hills.emplace_back(x, y, 3 * std::sin(x / 9) * std::cos(y / 7) + (i % 3 ? 0 : 2 * dice.roll()));
        normals.emplace_back(0.2 * dice.gauss(), 0.2 * dice.gauss(), 1);
        normals.back().normalize();
    }
    const auto doubts = [&](double side) {
        Points given = normals;
        for (Vector3d& normal : given)
            normal *= side;
        return doubts_of_sides(
            CloudAo({.radius = 5, .normals = CloudNormals::automatic}).compute({hills, given, {}, true}));
    };
    EXPECT_EQ(doubts(1).find("look down"), std::string::npos) << doubts(1);
    EXPECT_NE(doubts(-1).find("look down"), std::string::npos) << doubts(-1);
}

/// Where z may point anywhere, normals that look away from it are no mistake, unless they also contradict each other.
TEST(Sides, a_scan_whose_normals_look_away_and_contradict_each_other_is_doubted) {
    Points points, outward; // hills on a whole floor: nobody sees them from beneath
    Dice places(3);
    for (int i = 0; i < 40000; ++i) {
        points.emplace_back(2 * places.roll(), 2 * places.roll(), 0);
        outward.emplace_back(0, 0, 1);
    }
    for (const Vector3d& middle : {Vector3d(0.5, 0.6, 0), Vector3d(1.4, 0.5, 0), Vector3d(1, 1.5, 0)})
        for (const Vector3d& point : sphere(2600, Vector3d::Zero()))
            if (point.z() > 0) {
                points.push_back(middle + 0.15 * point.normalized());
                outward.push_back(point.normalized());
            }
    const auto with = [&](double side, double flipped) {
        Dice dice(5);
        Points normals;
        for (const Vector3d& out : outward)
            normals.push_back(dice.roll() < flipped ? Vector3d(-side * out) : Vector3d(side * out));
        return visibility(points, normals, {.radius = 0.2});
    };
    EXPECT_EQ(doubts_of_sides(with(1, 0)), "");
    const PointVisibility repaired = with(1, 0.05);
    EXPECT_EQ(doubts_of_sides(repaired), "");
    EXPECT_LT(wrong_sides(repaired, outward).all, 0.001);
    EXPECT_NE(tests::joined(repaired.notes).find("since they opposed most of their neighbours."), std::string::npos)
        << "which says nothing of where the whole looks: " << tests::joined(repaired.notes);
    EXPECT_EQ(doubts_of_sides(with(-1, 0)), "");
    const PointVisibility doubted = with(-1, 0.05);
    EXPECT_NE(doubts_of_sides(doubted).find("face away"), std::string::npos) << tests::joined(visibility(points).notes);
}

} // namespace
} // namespace scanshade
