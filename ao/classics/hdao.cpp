#include "ao/classics/hdao.h"

#include "ao/screen/fitted_curves.h"
#include "shaders/shared/hdao.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace scanshade {
namespace {

struct Count {
    Quality quality;
    int pairs;
};
constexpr std::array counts{Count{Quality::lowest, 4}, Count{Quality::low, 8}, Count{Quality::medium, 24},
                            Count{Quality::high, 48}, Count{Quality::highest, 128}};

constexpr std::array test_words{Named{"plane", HdaoTest::plane}, Named{"angle", HdaoTest::angle},
                                Named{"z", HdaoTest::z}};

constexpr float accept = 0.006F; // a, in radii

/// Of depth's noise, by which a tap must stand out from fitted planes, too: these keep what is wider than their
/// windows, and this method counts whatever stands out, however little. More makes scenes of small things too bright.
constexpr float fitted_sigmas = 2;

HdaoOptions resolved(HdaoOptions options) {
    options = checked(std::move(options));
    if (options.normal_rejection && options.test != HdaoTest::z)
        throw Misuse("normal-rejection is of test z only");
    if (options.pairs == 0)
        options.pairs = level_of(counts, options.quality).pairs;
    if (options.screen.curve == fitted_curve)
        options.screen.curve = options.test == HdaoTest::plane ? fitted_curve_of("hdao", options.quality) : 0.0F;
    return options;
}

/// The specialization constant of a test.
int kind_of(HdaoTest test) {
    switch (test) {
    case HdaoTest::angle:
        return shared::test_angle;
    case HdaoTest::z:
        return shared::test_z;
    case HdaoTest::plane:
        break;
    }
    return shared::test_plane;
}

} // namespace

std::vector<Parameter> HdaoOptions::parameters() {
    return joined(
        joined(screen.parameters(), {screen.curve_row()}),
        {
            {.name = "quality",
             .help = "pairs of taps: lowest 4, low 8, medium 24, high 48, highest 128",
             .value = OneOf(&quality, quality_words)},
            {.name = "pairs", .help = "pairs of taps; 0 = as the quality says", .value = &pairs, .low = 0, .high = 512},
            {.name = "test",
             .help = "which pairs occlude: plane, each tap above the tangent plane by itself; angle and z, "
                     "the published ones, valleys with taps on both sides, and without a tone curve",
             .value = OneOf(&test, test_words)},
            {.name = "normal-rejection",
             .help = "of test z: where the normals around agree, nothing occludes",
             .value = &normal_rejection},
        });
}

Hdao::Hdao(gpu::Device& device, const HdaoOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Hdao::add_passes(ScreenTables& tables) const {
    tables.add_pass(
        "generate", "hdao/generate", {screen_depth, screen_surfaces, screen_noise}, {screen_raw},
        {{shared::spec_test, kind_of(options_.test)}, {shared::spec_normal_rejection, options_.normal_rejection}});
}

std::vector<std::byte> Hdao::constants(const shared::ScreenConstants& screen) const {
    constexpr double golden_angle = std::numbers::pi * 137.508 / 180;
    // The published tests keep to their constant.
    const bool counts = options_.test == HdaoTest::plane;
    const float sigmas = counts ? std::max(screen.tangent_sigmas, fitted_sigmas) : screen.tangent_sigmas;
    return bytes_of(shared::HdaoConstants{screen, options_.pairs, static_cast<float>(std::cos(golden_angle)),
                                          static_cast<float>(std::sin(golden_angle)), accept * screen.radius, sigmas});
}

} // namespace scanshade
