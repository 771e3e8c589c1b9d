// Gaussian splats as soft discs: closed forms, and what must not occlude.
#include "ao/cloud/cloud_ao.h"
#include "tests/support/points.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>

namespace scanshade {
namespace {

using Eigen::Quaterniond, Eigen::Vector3d, Eigen::Vector3f;
using tests::corner, tests::Dice, tests::Points, tests::square;

/// Splats that someone trained: points with a Gaussian about each.
struct Scene {
    Points points;
    std::vector<Splat> splats;

    /// Flat ones across `normal`; any of the three axes is the shortest, any way round.
    void add(const Vector3d& point, const Vector3d& normal, double sigma, double opacity, Dice& dice,
             double thickness = 0.05) {
        const auto shortest = static_cast<int>(3 * dice.roll());
        const Quaterniond turned = Quaterniond::FromTwoVectors(Vector3d::Unit(shortest), normal) *
                                   Eigen::AngleAxisd(6 * dice.roll(), Vector3d::Unit(shortest));
        Vector3f sigmas = Vector3f::Constant(static_cast<float>(sigma));
        sigmas[shortest] *= static_cast<float>(thickness);
        points.push_back(point);
        splats.push_back({turned.cast<float>(), sigmas, static_cast<float>(opacity)});
    }
    [[nodiscard]] PointVisibility seen(double radius, const std::string& outside = "1,1,1",
                                       std::span<const FoundFrame> cameras = {}) const {
        PointSet set{points};
        set.splats = splats;
        set.frames = cameras;
        return CloudAo({.radius = radius, .outside = outside}).compute(set);
    }
};

constexpr double radius = 0.4;

/// A corner of `count` splats, 0.75 spacings wide as trained ones are, with the noise of their centres.
Scene corner_of(std::size_t count, double thickness, Dice& dice) {
    const double spacing = std::sqrt(8 / static_cast<double>(count));
    Scene scene;
    const Points points = corner(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Vector3d normal = i % 2 ? Vector3d::UnitZ() : Vector3d::UnitX();
        const double roll = dice.roll();
        scene.add(points[i] + 0.05 * spacing * dice.gauss() * normal, normal, 0.75 * spacing, 1 - 0.5 * roll * roll,
                  dice, thickness);
    }
    return scene;
}

/// RMS error of the corner's points that its own rims do not open, found and expected.
std::pair<double, double> corner_error(const Scene& scene, const PointVisibility& found) {
    double squares = 0, expected = 0, count = 0;
    for (std::size_t i = 0; i < found.visibility.size(); ++i) {
        const Vector3d& p = scene.points[i];
        const double away = std::max(p.x(), p.z()), c = away / radius;
        if (scene.splats[i].opacity < 0.5 || p.y() < radius || p.y() > 2 - radius || away > 2 - radius || c < 0.05)
            continue;
        const double truth = c >= 1 ? 1 : 1 - (std::acos(c) - c * std::sqrt(1 - c * c)) / std::numbers::pi;
        squares += std::pow(static_cast<double>(found.visibility[i]) - truth, 2);
        expected += std::pow(static_cast<double>(found.error[i]), 2);
        ++count;
    }
    EXPECT_GT(count, 500);
    return {std::sqrt(squares / count), std::sqrt(expected / count)};
}

TEST(SplatAo, a_corner_is_as_dark_as_the_closed_form_says) {
    Dice dice;
    for (const auto& [thickness, error] : {std::pair(0.05, 0.055), {0.0, 0.065}, {1.0, 0.065}}) { // balls, too
        const Scene scene = corner_of(4000, thickness, dice);
        const PointVisibility found = scene.seen(radius);
        const auto [is, expected] = corner_error(scene, found);
        EXPECT_LT(is, error) << thickness;
        EXPECT_LT(is, 1.25 * expected) << thickness;
        EXPECT_GT(is, 0.4 * expected) << thickness;
    }
}

/// Rays pass between splats that are far narrower than their distances: a result that is open, and no truth.
TEST(SplatAo, gaps_between_splats_are_doubted) {
    for (const auto& [sigma_by_spacing, gaps] : {std::pair(0.75, false), {0.3, false}, {0.1, true}}) {
        Dice dice;
        Scene scene = corner_of(4000, 0.05, dice);
        for (Splat& splat : scene.splats)
            splat.sigma *= static_cast<float>(sigma_by_spacing / 0.75);
        const auto found = scene.seen(radius).findings;
        const auto gap = std::ranges::find(found, Check::splat_gaps, &Finding::check);
        ASSERT_NE(gap, found.end());
        EXPECT_EQ(is_doubt(*gap), gaps) << gap->value;
        EXPECT_NEAR(gap->value / (2 * std::numbers::pi * 0.87 * sigma_by_spacing * sigma_by_spacing), 1, 0.35)
            << "the area of a Gaussian by the square of its own, with the middle opacity";
    }
}

TEST(SplatAo, haze_occludes_nothing_and_is_shaded_like_the_surface_by_it) {
    Dice dice;
    Scene scene = corner_of(4000, 0.05, dice);
    const std::size_t surface = scene.points.size();
    const std::vector<float> clear = scene.seen(radius).visibility;
    for (int i = 0; i < 500; ++i)
        scene.add({2 * dice.roll(), 2 * dice.roll(), 2 * dice.roll()}, Vector3d::UnitY(), 0.1, 0.04, dice);
    scene.add({1, 1, 0.01}, Vector3d::UnitZ(), 0.1, 0.01, dice);
    scene.add({50, 50, 50}, Vector3d::UnitZ(), 0.1, 0.01, dice);
    scene.add({1, 1, 0.5}, Vector3d::UnitZ(), 30, 0.9, dice); // a sky that is where the cameras never were
    scene.points.emplace_back(Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    scene.splats.emplace_back();
    const std::vector<float> found = scene.seen(radius).visibility;
    for (std::size_t i = 0; i < surface; ++i)
        ASSERT_EQ(found[i], clear[i]) << i;
    EXPECT_GT(found[surface + 500], 0.9F);
    EXPECT_EQ(found[surface + 501], 1) << "nothing is near";
    EXPECT_TRUE(std::isnan(found.back()));
}

/// A ball is open all round, and no place sees more than its front.
TEST(SplatAo, a_place_turns_the_sides_that_it_sees) {
    Dice dice;
    Scene scene;
    const Vector3d centre(3, -2, 1);
    for (const Vector3d& p : tests::sphere(3000, centre))
        scene.add(p, p - centre, 0.05, 0.9, dice);
    const PointVisibility found = scene.seen(0.5, "7,-2,2");
    EXPECT_GT(tests::mean(found.visibility), 0.98);
    for (std::size_t i = 0; i < scene.points.size(); ++i)
        ASSERT_GT(found.normals[i].cast<double>().dot(scene.points[i] - centre), 0.9) << i;
}

FoundFrame camera_at(const Vector3d& position, const Vector3d& towards) {
    FoundFrame frame{.camera = {300, 300, 319.5, 239.5, {640, 480}}};
    const Vector3d z = (towards - position).normalized(), x = z.unitOrthogonal();
    frame.world_from_camera.linear() << x, z.cross(x), z;
    frame.world_from_camera.translation() = position;
    return frame;
}

/// The same ball is a room to cameras within it, and an object to those around it.
TEST(SplatAo, cameras_decide_what_is_inside_and_what_outside) {
    Dice dice;
    Scene scene;
    for (const Vector3d& p : tests::sphere(3000, Vector3d::Zero()))
        scene.add(p, p, 0.05, 0.9, dice);
    for (const bool inside : {true, false}) {
        std::vector<FoundFrame> cameras;
        for (const Vector3d& way : tests::sphere(40, Vector3d::Zero()))
            cameras.push_back(inside ? camera_at(-0.3 * way, way) : camera_at(4 * way, Vector3d::Zero()));
        const PointVisibility found = scene.seen(1, "auto", cameras);
        int right = 0;
        for (std::size_t i = 0; i < scene.points.size(); ++i)
            right += (found.normals[i].cast<double>().dot(scene.points[i]) < 0) == inside;
        EXPECT_EQ(right, 3000) << inside;
        EXPECT_TRUE(std::ranges::any_of(found.notes, [](const std::string& note) {
            return note.find("to the 40 cameras that the splats were made with, which see 100 %") != std::string::npos;
        })) << inside;
    }
    const PointVisibility given = scene.seen(1, "outward", {std::vector{camera_at({0, 0, 0}, {1, 0, 0})}});
    EXPECT_GT(given.normals[0].cast<double>().dot(scene.points[0]), 0) << "what people say goes first";
}

/// A sheet at the height h over a floor lets T of the light through: V = 1 - (1 - T) (1 - (h / R)^2). Of n random
/// splats a square, T = exp(-n 2 pi sigma^2 opacity).
TEST(SplatAo, a_curtain_takes_what_it_is_seen_to_take) {
    constexpr double height = 0.15, sigma = 0.05;
    Dice dice;
    for (const double opacity : {0.06, 0.12}) { // it hides no sides: more than half comes through
        Scene scene;
        for (const Vector3d& p : square(6000))
            scene.add(p, Vector3d::UnitZ(), 0.02, 0.95, dice);
        for (Vector3d p : square(1200)) {
            p.z() = height;
            scene.add(p, Vector3d::UnitZ(), sigma, opacity, dice);
        }
        const std::vector<float> found = scene.seen(radius, "0,0,100").visibility;
        double sum = 0, count = 0;
        for (std::size_t i = 0; i < 6000; ++i)
            if (scene.points[i].head<2>().cwiseAbs().maxCoeff() < 0.5) {
                sum += static_cast<double>(found[i]);
                ++count;
            }
        const double through = std::exp(-300 * 2 * std::numbers::pi * sigma * sigma * opacity);
        EXPECT_NEAR(sum / count, 1 - (1 - through) * (1 - std::pow(height / radius, 2)), 0.02) << opacity;
    }
}

} // namespace
} // namespace scanshade
