#include "ao/classics/abao.h"

#include "ao/screen/fitted_curves.h"
#include "shaders/shared/abao.h"

#include <array>
#include <cmath>
#include <numbers>

namespace scanshade {
namespace {

struct Count {
    Quality quality;
    int lines, steps;
};
/// More than four steps a side find ever higher elevations of a surface without a thickness, which no curve mends: the
/// best one leaves 0.135 at 8x8 and 0.141 at 16x16, 0.129 at 4x4. High qualities have more lines in place of them.
constexpr std::array counts{Count{Quality::lowest, 2, 2}, Count{Quality::low, 4, 2}, Count{Quality::medium, 4, 4},
                            Count{Quality::high, 8, 4}, Count{Quality::highest, 16, 4}};
constexpr Count count_of_published{Quality::medium, 6, 1};

/// The quality's values, except those given.
AbaoOptions resolved(AbaoOptions options) {
    options = checked(std::move(options));
    const bool published = options.profile == Profile::published;
    const Count& count = published ? count_of_published : level_of(counts, options.quality);
    if (options.lines == 0 || published)
        options.lines = count.lines;
    if (options.steps == 0 || published)
        options.steps = count.steps;
    if (options.screen.curve == fitted_curve)
        options.screen.curve = published ? 0.0F : fitted_curve_of(options.hard ? "abao hard" : "abao", options.quality);
    return options;
}

} // namespace

std::vector<Parameter> AbaoOptions::parameters() {
    return joined(joined(screen.parameters(), {screen.curve_row()}),
                  {
                      {.name = "profile",
                       .help = "metric takes the highest elevation of several steps; published takes six pairs of "
                               "taps, and has no tone curve",
                       .value = OneOf(&profile, profile_words)},
                      {.name = "quality",
                       .help = "lines x steps to either side: lowest 2x2, low 4x2, medium 4x4, high 8x4, highest 16x4",
                       .value = OneOf(&quality, quality_words)},
                      {.name = "lines",
                       .help = "lines through the pixel; 0 = as the quality says",
                       .value = &lines,
                       .low = 0,
                       .high = 64},
                      {.name = "steps",
                       .help = "steps to either side of a line; 0 = as the quality says",
                       .value = &steps,
                       .low = 0,
                       .high = 256},
                      {.name = "hard",
                       .help = "elevations count alike up to the radius; otherwise they fade with the square of "
                               "distance, which is kinder to thin things",
                       .value = &hard},
                  });
}

Abao::Abao(gpu::Device& device, const AbaoOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Abao::add_passes(ScreenTables& tables) const {
    tables.add_pass("generate", "abao/generate", {screen_depth, screen_surfaces, screen_noise}, {screen_raw},
                    {{shared::spec_published, options_.profile == Profile::published}});
}

std::vector<std::byte> Abao::constants(const shared::ScreenConstants& screen) const {
    const double turn = std::numbers::pi / options_.lines;
    return bytes_of(shared::AbaoConstants{screen, options_.lines, options_.steps, static_cast<float>(std::cos(turn)),
                                          static_cast<float>(std::sin(turn)), options_.hard ? 0.0F : 1.0F});
}

} // namespace scanshade
