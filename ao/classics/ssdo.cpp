#include "ao/classics/ssdo.h"

#include "ao/screen/fitted_curves.h"
#include "shaders/shared/ssdo.h"

#include <array>

namespace scanshade {
namespace {

struct Count {
    Quality quality;
    int directions;
};
constexpr std::array counts{Count{Quality::lowest, 4}, Count{Quality::low, 8}, Count{Quality::medium, 16},
                            Count{Quality::high, 32}, Count{Quality::highest, 128}};

SsdoOptions resolved(SsdoOptions options) {
    options = checked(std::move(options));
    if (options.directions == 0)
        options.directions = level_of(counts, options.quality).directions;
    if (options.screen.curve == fitted_curve)
        options.screen.curve = fitted_curve_of("ssdo", options.quality);
    return options;
}

} // namespace

std::vector<Parameter> SsdoOptions::parameters() {
    return joined(joined(screen.parameters(), {screen.curve_row()}),
                  {
                      {.name = "quality",
                       .help = "directions: lowest 4, low 8, medium 16, high 32, highest 128",
                       .value = OneOf(&quality, quality_words)},
                      {.name = "directions",
                       .help = "directions over the surface; 0 = as the quality says",
                       .value = &directions,
                       .low = 0,
                       .high = 1024},
                      {.name = "renormalise",
                       .help = "samples of unknown depth are left out where at least half are known; "
                               "otherwise they count as open",
                       .value = &renormalise},
                  });
}

Ssdo::Ssdo(gpu::Device& device, const SsdoOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Ssdo::add_passes(ScreenTables& tables) const {
    tables.add_pass("generate", "ssdo/generate", {screen_depth, screen_surfaces, screen_noise}, {screen_raw},
                    {{shared::spec_renormalise, options_.renormalise}});
}

std::vector<std::byte> Ssdo::constants(const shared::ScreenConstants& screen) const {
    return bytes_of(shared::SsdoConstants{screen, options_.directions});
}

} // namespace scanshade
