#include "ao/hbao/hbao.h"

#include "shaders/shared/hbao.h"

#include <array>
#include <cmath>
#include <numbers>

namespace scanshade {
namespace {

struct Count {
    Quality quality;
    int directions, steps;
};
constexpr std::array counts{Count{Quality::lowest, 4, 2}, Count{Quality::low, 4, 4}, Count{Quality::medium, 8, 4},
                            Count{Quality::high, 8, 8}, Count{Quality::highest, 32, 16}};

/// The quality's values, except those given.
Count count_of(const HbaoOptions& options) {
    Count count = level_of(counts, options.quality);
    if (options.directions > 0)
        count.directions = options.directions;
    if (options.steps > 0)
        count.steps = options.steps;
    return count;
}

HbaoOptions resolved(HbaoOptions options) {
    options = checked(std::move(options));
    if (options.profile == Profile::metric)
        return options;
    options.bias_degrees = 30;
    options.attenuated = true;
    return options;
}

} // namespace

std::vector<Parameter> HbaoOptions::parameters() {
    return joined(screen.parameters(),
                  {
                      {.name = "profile",
                       .help = "metric weighs all samples within the radius alike; published uses bias 30, attenuated, "
                               "contrast 1.25",
                       .value = OneOf(&profile, profile_words)},
                      {.name = "quality",
                       .help = "directions x steps: lowest 4x2, low 4x4, medium 8x4, high 8x8, highest 32x16",
                       .value = OneOf(&quality, quality_words)},
                      {.name = "directions",
                       .help = "directions in the image; 0 = as the quality says",
                       .value = &directions,
                       .low = 0,
                       .high = 128},
                      {.name = "steps",
                       .help = "steps along each direction; 0 = as the quality says",
                       .value = &steps,
                       .low = 0,
                       .high = 256},
                      {.name = "bias",
                       .help = "horizons lower above the tangent plane than this do not occlude",
                       .value = &bias_degrees,
                       .unit = "degrees",
                       .low = 0,
                       .high = 89},
                      {.name = "attenuated",
                       .help = "samples count less with the square of their distance; otherwise all within the radius "
                               "count alike",
                       .value = &attenuated},
                  });
}

Hbao::Hbao(gpu::Device& device, const HbaoOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Hbao::add_passes(ScreenTables& tables) const {
    tables.add_pass("generate", "hbao/generate", {screen_depth, screen_surfaces, screen_noise}, {screen_raw});
}

std::vector<std::byte> Hbao::constants(const shared::ScreenConstants& screen) const {
    const Count count = count_of(options_);
    const double turn = 2 * std::numbers::pi / count.directions, bias = options_.bias_degrees * std::numbers::pi / 180;
    return bytes_of(shared::HbaoConstants{screen, count.directions, count.steps, static_cast<float>(std::cos(turn)),
                                          static_cast<float>(std::sin(turn)), static_cast<float>(std::cos(bias)),
                                          static_cast<float>(std::sin(bias)), options_.attenuated ? 1.0F : 0.0F,
                                          options_.profile == Profile::published ? 1.25F : 1.0F});
}

} // namespace scanshade
