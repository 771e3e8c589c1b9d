// The accurate method against closed forms: an open plane and right-angled corners, whatever the number of reads.
#include "ao/gpu/device.h"
#include "ao/surfel/surfel.h"
#include "apps/scenes/world/scene.h"
#include "tests/support/scenes.h"
#include "tests/support/watched.h"

#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using namespace tests;

AoMap visibility_of(const DepthImage& depth, const SurfelOptions& options = {}) {
    Surfel surfel(watched_device(), options);
    return surfel.compute({depth});
}

SurfelOptions reads(int slices, int steps) {
    SurfelOptions options;
    options.slices = slices;
    options.steps = steps;
    return options;
}

/// Visibility next to a right-angled wall, `share` of the radius away (any cosine-weighted hemisphere within the
/// radius).
double beside_wall(double share) {
    return share >= 1 ? 1 : 1 - (std::acos(share) - share * std::sqrt(1 - share * share)) / std::numbers::pi;
}

/// Root mean square and largest error of the pixels whose whole sphere is in view.
struct CornerError {
    double rms = 0, worst = 0;
};

CornerError corner_error(const SurfelOptions& options) {
    const Pinhole camera = test_camera({640, 480});
    const DepthImage depth = wall_corner(camera, 2);
    const AoMap ao = visibility_of(depth, options);
    double sum = 0;
    int count = 0;
    CornerError error;
    for (int v = 140; v < 340; ++v)
        for (int u = 0; u < 640; ++u) {
            const double z = depth.z_m(v, u), x = camera.point(u, v, z).x();
            const double along = std::hypot(x, z - 2); // from the edge, along the own wall: the distance to the other
            if (along > 0.6)
                continue;
            const double off = ao.visibility(v, u) - beside_wall(along / options.screen.radius);
            sum += off * off;
            error.worst = std::max(error.worst, std::abs(off));
            ++count;
        }
    error.rms = std::sqrt(sum / count);
    return error;
}

TEST(Surfel, a_right_angled_corner_is_as_dark_as_the_closed_form) {
    const CornerError many = corner_error(reads(2, 8)), few = corner_error(reads(1, 4));
    const CornerError alike = corner_error({.quality = Quality::lowest});
    EXPECT_LT(many.rms, 0.01);
    EXPECT_LT(few.rms, 0.01);
    EXPECT_LT(alike.rms, 0.01); // surfaces of a corner have no free ends, so thickness has no effect
    std::printf(
        "right-angled corner: RMS %.4f at 32 reads (worst pixel %.4f), %.4f at 8 (%.4f), %.4f at lowest (%.4f)\n",
        many.rms, many.worst, few.rms, few.worst, alike.rms, alike.worst);
}

TEST(Surfel, a_plane_is_open_at_any_tilt_and_distance) {
    for (const Quality quality : {Quality::lowest, Quality::high})
        for (const double tilt : {0.0, 45.0, 60.0, 80.0, 85.0})
            for (const double z : {0.3, 2.0, 20.0}) {
                const DepthImage depth = tilted_plane(test_camera({320, 240}), tilt, z);
                const AoMap ao = visibility_of(depth, {.quality = quality});
                double lowest = 1;
                for (int i = 0; i < 320 * 240; ++i)
                    if (depth.z_m(i) > 0)
                        lowest = std::min<double>(lowest, ao.visibility(i));
                EXPECT_GE(lowest, 0.995) << word_for(quality, quality_words) << ": " << tilt << " degrees at " << z
                                         << " m";
            }
}

/// Error of quality high on the wall 2 m away, before which the bodies stand; the camera looks straight at it.
struct WallError {
    double rms = 0, bias = 0;
};

WallError error_on_wall(const std::vector<scene::Body>& bodies) {
    scene::Scene scene{.name = "wall", .summary = ""};
    scene.bodies = bodies;
    scene.bodies.push_back({scene::Plane{{0, 2, 0}, {0, -1, 0}}, {}});
    const scene::World world(scene);
    const Pinhole camera{262.5, 262.5, 159.5, 119.5, {320, 240}};
    const Eigen::Isometry3d pose = scene::looking_at({0, 0, 0}, {0, 2, 0});
    const cv::Mat1f z_m = render_geometry(world, camera, pose).z_m;
    const cv::Mat1f truth = scene::true_visibility(world, camera, pose, {0.5, 256, 1, false}).visibility[0];
    const cv::Mat1f found = visibility_of({camera, z_m, {}}, {.quality = Quality::high}).visibility;
    WallError error;
    double squares = 0;
    int count = 0;
    for (int v = 40; v < 200; ++v)
        for (int u = 40; u < 280; ++u) {
            if (z_m(v, u) < 1.999F)
                continue;
            const double off = found(v, u) - truth(v, u);
            squares += off * off;
            error.bias += off;
            ++count;
        }
    error.rms = std::sqrt(squares / count);
    error.bias /= count;
    return error;
}

TEST(Surfel, light_passes_behind_rods_and_not_through_pillars) {
    // Rods of 2 cm, 15 cm before a wall: what a camera sees of them is as wide as they are thick. Were they as thick as
    // surfaces are at most, 30 cm, all of the wall behind them would be dark; were they thinner, it would be too open.
    std::vector<scene::Body> rods, pillars;
    for (int i = -4; i <= 4; ++i)
        rods.push_back({scene::Cylinder{{0.2 * i, 1.85, -2}, 0.01, 4}, {}});
    // Pillars of 30 cm, which stand at the wall: the wall beside them is as dark as beside another wall.
    for (int i = -1; i <= 1; ++i)
        pillars.push_back({scene::Box{{0.75 * i, 1.85, 0}, {0.15, 0.15, 3}}, {}});
    const WallError of_rods = error_on_wall(rods), of_pillars = error_on_wall(pillars);
    std::printf("rods: RMS %.4f, bias %.4f; pillars: RMS %.4f, bias %.4f\n", of_rods.rms, of_rods.bias, of_pillars.rms,
                of_pillars.bias);
    // A wire before the left edge of each rod hides where the rod ends: it is at most as much wider as the wire hides.
    std::vector<scene::Body> behind_wires = rods;
    for (int i = -4; i <= 4; ++i)
        behind_wires.push_back({scene::Cylinder{{(0.2 * i - 0.01) / 1.85, 1, -2}, 0.004, 4}, {}});
    const WallError of_wires = error_on_wall(behind_wires);
    std::printf("rods behind wires: RMS %.4f, bias %.4f\n", of_wires.rms, of_wires.bias);
    EXPECT_LT(of_wires.rms, 0.04);
    EXPECT_LT(of_rods.rms, 0.029);    // 0.27 were all as thick as can be, 0.032 were all as thin
    EXPECT_LT(of_pillars.rms, 0.045); // 0.13 were all as thin
}

} // namespace
} // namespace scanshade
