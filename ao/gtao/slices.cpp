#include "ao/gtao/slices.h"

#include <array>
#include <cmath>
#include <numbers>

namespace scanshade {
namespace {

struct Count {
    Quality quality;
    int slices, steps;
};
constexpr std::array counts{Count{Quality::lowest, 1, 4}, Count{Quality::low, 2, 4}, Count{Quality::medium, 2, 8},
                            Count{Quality::high, 4, 8}, Count{Quality::highest, 16, 16}};

/// The quality's values, except those given.
Count count_of(const SliceOptions& options) {
    Count count = level_of(counts, options.quality);
    if (options.slices > 0)
        count.slices = options.slices;
    if (options.steps > 0)
        count.steps = options.steps;
    return count;
}

} // namespace

std::vector<Parameter> SliceOptions::parameters() {
    return {
        {.name = "quality",
         .help = "slices x steps to either side: lowest 1x4, low 2x4, medium 2x8, high 4x8, highest 16x16",
         .value = OneOf(&quality, quality_words)},
        {.name = "slices",
         .help = "slices through the eye's ray; 0 = as the quality says",
         .value = &slices,
         .low = 0,
         .high = 64},
        {.name = "steps",
         .help = "steps to either side of a slice; 0 = as the quality says",
         .value = &steps,
         .low = 0,
         .high = 256},
        {.name = "distribution",
         .help = "exponent of the distances of steps; above 1, they are denser close by",
         .value = &distribution,
         .low = 0.5,
         .high = 4},
    };
}

shared::GtaoConstants slice_constants(const SliceOptions& options, const shared::ScreenConstants& screen) {
    const Count count = count_of(options);
    const double turn = std::numbers::pi / count.slices;
    shared::GtaoConstants block{};
    block.screen = screen;
    block.slices = count.slices;
    block.steps = count.steps;
    block.turn_cosine = static_cast<float>(std::cos(turn));
    block.turn_sine = static_cast<float>(std::sin(turn));
    block.distribution = options.distribution;
    return block;
}

void add_slice_pass(ScreenTables& tables, const SliceOptions& options, std::vector<std::pair<int, int>> constants) {
    constants.emplace_back(shared::spec_square, options.distribution == 2);
    tables.add_pass("generate", "gtao/generate", {screen_depth, screen_surfaces, screen_noise}, {screen_raw},
                    std::move(constants));
}

} // namespace scanshade
