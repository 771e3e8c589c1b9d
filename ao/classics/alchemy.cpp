#include "ao/classics/alchemy.h"

#include "ao/screen/fitted_curves.h"
#include "shaders/shared/alchemy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <numeric>

namespace scanshade {
namespace {

/// SAO's sum has a heavy tail: more taps make it darker and noisier, so it has fewer, 11 as published.
struct Count {
    Quality quality;
    int taps, taps_of_sao;
};
constexpr std::array counts{Count{Quality::lowest, 5, 5}, Count{Quality::low, 8, 8}, Count{Quality::medium, 16, 11},
                            Count{Quality::high, 32, 16}, Count{Quality::highest, 128, 32}};

constexpr float contact = 0.02F;     // epsilon, in radii
constexpr float bias_of_sao = 0.01F; // b, in radii
constexpr float pyramid_px = 64;     // radii up to which caches hold the disc anyway

constexpr std::array pyramid_words{Named{"auto", DepthPyramid::automatic}, Named{"on", DepthPyramid::on},
                                   Named{"off", DepthPyramid::off}};
constexpr std::array alchemy_profile_words{Named{"metric", AlchemyProfile::metric}, Named{"sao", AlchemyProfile::sao}};

AlchemyOptions resolved(AlchemyOptions options) {
    options = checked(std::move(options));
    const bool sao = options.profile == AlchemyProfile::sao;
    const Count& count = level_of(counts, options.quality);
    if (options.taps == 0)
        options.taps = sao ? count.taps_of_sao : count.taps;
    if (options.screen.curve == fitted_curve)
        options.screen.curve = fitted_curve_of(sao ? "alchemy sao" : "alchemy", options.quality);
    if (options.pyramid == DepthPyramid::automatic)
        options.pyramid = sao ? DepthPyramid::on : DepthPyramid::off;
    return options;
}

/// Five buffers in one: the levels of the pyramid above the depth image, each made of the one below.
int add_pyramid(ScreenTables& tables, int unused) {
    constexpr int widest = 0xffff; // texels hold a pixel's column and row in 16 bits each
    if (tables.size.width > widest || tables.size.height > widest)
        throw Error(fmt::format("image of {}x{}: a pyramid of depths has {} pixels a side at most", tables.size.width,
                                tables.size.height, widest));
    const shared::ivec2 size(tables.size.width, tables.size.height);
    const auto texels = static_cast<std::size_t>(shared::pyramid_start(size, shared::pyramid_levels + 1));
    const int levels =
        tables.add_buffer({"pyramid", texels * 8, gpu::BufferRow::Host::none, gpu::BufferRow::Texels::rg32ui});
    for (int level = 1; level <= shared::pyramid_levels; ++level) {
        const shared::ivec2 of_level = shared::pyramid_size(size, level);
        tables.add_pass_over({of_level.x, of_level.y}, fmt::format("pyramid {}", level), "alchemy/pyramid",
                             {screen_depth, level == 1 ? unused : levels}, {levels}, {{shared::spec_level, level}});
    }
    return levels;
}

} // namespace

int spiral_turns(int taps) {
    constexpr std::array chosen{std::pair(8, 5), std::pair(11, 7), std::pair(16, 7), std::pair(24, 11),
                                std::pair(32, 13)};
    for (const auto& [of, turns] : chosen)
        if (taps == of)
            return turns;
    int turns = std::max(1, taps * 2 / 5);
    while (std::gcd(turns, taps) != 1)
        ++turns;
    return turns;
}

std::vector<Parameter> AlchemyOptions::parameters() {
    return joined(
        joined(screen.parameters(), {screen.curve_row()}),
        {
            {.name = "profile",
             .help = "metric weighs taps within the radius by their distance; sao has a smooth falloff, taps denser "
                     "close by, and the pyramid",
             .value = OneOf(&profile, alchemy_profile_words)},
            {.name = "quality",
             .help = "taps: lowest 5, low 8, medium 16, high 32, highest 128; of sao 5, 8, 11, 16, 32",
             .value = OneOf(&quality, quality_words)},
            {.name = "taps",
             .help = "taps in the disc; 0 = as the quality says",
             .value = &taps,
             .low = 0,
             .high = 1024},
            {.name = "pyramid",
             .help =
                 "far taps read a pyramid of depths where the radius is wider than 64 pixels: auto with sao, on, off",
             .value = OneOf(&pyramid, pyramid_words)},
            {.name = "renormalise",
             .help = "taps of unknown depth are left out where at least half are known; otherwise they count as open",
             .value = &renormalise},
        });
}

Alchemy::Alchemy(gpu::Device& device, const AlchemyOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Alchemy::add_passes(ScreenTables& tables) const {
    const int unused =
        tables.add_buffer({"no pyramid", 8, gpu::BufferRow::Host::none, gpu::BufferRow::Texels::rg32ui, {0, 0}});
    const int levels = options_.pyramid == DepthPyramid::on ? add_pyramid(tables, unused) : unused;
    tables.add_pass("generate", "alchemy/generate", {screen_depth, screen_surfaces, screen_noise, levels}, {screen_raw},
                    {{shared::spec_sao, options_.profile == AlchemyProfile::sao},
                     {shared::spec_pyramid, options_.pyramid == DepthPyramid::on},
                     {shared::spec_renormalise, options_.renormalise}});
}

std::vector<std::byte> Alchemy::constants(const shared::ScreenConstants& screen) const {
    const int taps = options_.taps, turns = spiral_turns(taps);
    const double turn = 2 * std::numbers::pi * turns / taps;
    const float r = screen.radius, epsilon = contact * r;
    const bool sao = options_.profile == AlchemyProfile::sao;
    return bytes_of(shared::AlchemyConstants{screen, taps, static_cast<float>(std::cos(turn)),
                                             static_cast<float>(std::sin(turn)), static_cast<float>(turns),
                                             epsilon * epsilon, sao ? bias_of_sao * r : 0.0F, pyramid_px});
}

} // namespace scanshade
