// The accurate method against closed forms: an open plane and right-angled corners, whatever the number of reads.
#include "ao/gpu/device.h"
#include "ao/surfel/surfel.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using namespace tests;

AoMap visibility_of(const DepthImage& depth, const SurfelOptions& options = {}) {
    static gpu::Device device;
    Surfel surfel(device, options);
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

} // namespace
} // namespace scanshade
