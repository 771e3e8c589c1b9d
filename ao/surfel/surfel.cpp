#include "ao/surfel/surfel.h"

#include "shaders/shared/surfel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

struct Level {
    const char* quality;
    int slices, steps;
};
constexpr std::array levels{Level{"low", 1, 4}, Level{"medium", 1, 8}, Level{"high", 2, 8}, Level{"highest", 2, 16}};

/// Slices and steps of the quality, where none are given.
SurfelOptions resolved(SurfelOptions options) {
    options = checked(std::move(options));
    const Level& level = level_of(levels, options.quality);
    if (options.slices == 0)
        options.slices = level.slices;
    if (options.steps == 0)
        options.steps = level.steps;
    return options;
}

/// Where depth is clean, wide holes are the sky; noisy sensors have shadows beside whatever stands in front of something.
constexpr int widest_fill_px = 40, narrowest_fill_px = 4;

int divided_up(int n, int by) { return (n + by - 1) / by; }

/// Half the thickness of what other views saw behind this one's surfaces, in radii.
constexpr float hidden_layer = 0.05F;

/// What other views saw behind this one's surfaces and outside its image, and how thick these can be: two buffers.
std::pair<int, int> add_layers(ScreenTables& tables) {
    using Texels = gpu::BufferRow::Texels;
    const auto halved = [](cv::Size size) { return cv::Size(divided_up(size.width, 2), divided_up(size.height, 2)); };
    const cv::Size blocks = halved(tables.size);
    const auto bytes = static_cast<std::size_t>(blocks.area()) * 4;
    const int behind = tables.add_buffer({"behind", 2 * bytes, gpu::BufferRow::Host::none, Texels::r32ui});
    const int limits = tables.add_buffer({"limits", bytes, gpu::BufferRow::Host::none, Texels::r32f});
    tables.passes.push_back({"clear layers", "", {}, {behind}, {1, 1, 1}, {}});
    for (int round = 0; round < 2; ++round) {
        tables.add_pass_over(halved(tables.window.size()), fmt::format("reproject {}", round + 1), "surfel/reproject",
                             {screen_neighbours, screen_depth}, {behind}, {{shared::spec_round, round}});
        tables.passes.back().groups[2] = static_cast<std::uint32_t>(tables.neighbours);
    }
    tables.add_pass("widen", "surfel/widen", {screen_depth, behind}, {screen_surfaces});
    tables.add_pass_over(halved(tables.window.size()), "carve", "surfel/carve", {screen_neighbours, screen_surfaces}, {limits});
    return {behind, limits};
}

/// What the passes' work and buffers are counted in.
struct Grid {
    cv::Size words;   ///< of edges: along a row, along a column
    cv::Size samples; ///< pixels that slices are marched from

    Grid(cv::Size size, cv::Size window, bool downsampled)
        : words(divided_up(size.width, shared::surfel_run), divided_up(size.height, shared::surfel_run)),
          samples(downsampled ? cv::Size(divided_up(window.width, 2), divided_up(window.height, 2)) : window) {}
};

/// One of the 16 planes of what lies 4 apart.
cv::Size plane_of(cv::Size size) { return {divided_up(size.width, 4), divided_up(size.height, 4)}; }

/// Work groups of a pass whose threads each take one of `n`.
std::array<std::uint32_t, 3> groups_of(int n) {
    return {static_cast<std::uint32_t>(divided_up(n, shared::surfel_group)), 1, 1};
}

} // namespace

std::vector<Parameter> SurfelOptions::parameters() {
    return joined(
        screen.parameters(),
        {{"quality", "8, 16, 32 or 64 reads a pixel", &quality, "", {}, {}, {"low", "medium", "high", "highest"}},
         {"downsampled", "march from every other pixel of every other row, and fill in the rest", &downsampled},
         {"slices", "of the hemisphere; 0 = the quality's", &slices, "", 0, 64},
         {"steps", "reads on either side of a slice; 0 = the quality's", &steps, "", 0, 256},
         {"thinnest", "half the thickness of a surface at least", &thinnest, "radii", 0, 10},
         {"thickest", "half the thickness of a surface at most; what is wider than twice this in the image is as thick",
          &thickest, "radii", 1e-3, 10},
         {"hidden",
          "half the thickness of a surface whose ends lie behind others or outside the image; thickest is the limit",
          &hidden, "radii", 0, 10}});
}

Surfel::Surfel(gpu::Device& device, const SurfelOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Surfel::add_passes(ScreenTables& tables) const {
    using Texels = gpu::BufferRow::Texels;
    constexpr auto none = gpu::BufferRow::Host::none;
    const cv::Size size = tables.size;
    const Grid grid(size, tables.window.size(), options_.downsampled);
    const int words = grid.words.width * size.height + grid.words.height * size.width;
    const auto bytes = [](int count, int each) {
        return static_cast<std::size_t>(count) * static_cast<std::size_t>(each);
    };
    const int edges = tables.add_buffer({"edges", bytes(words, 8), none, Texels::rg32ui});
    const int runs = tables.add_buffer({"runs", bytes(words, 8), none, Texels::r32ui});
    const int layers = tables.neighbours > 0 ? 3 : 1;
    const int surfels = tables.add_buffer({"surfels", bytes(layers * 16 * plane_of(size).area(), 8), none, Texels::rg32ui});
    const int sampled = tables.add_buffer({"sampled", bytes(grid.samples.area(), 8), none, Texels::rg32f});

    // Without neighbours nothing reads what fills the slots of their layers.
    const auto [behind, limits] = layers > 1 ? add_layers(tables) : std::pair(runs, screen_depth);
    tables.add_pass_over(tables.window.size(), "fill", "surfel/fill", {}, {screen_surfaces});
    tables.passes.push_back({"edges", "surfel/edges", {screen_surfaces}, {edges}, groups_of(words), {}});
    tables.passes.push_back({"runs", "surfel/runs", {edges}, {runs}, groups_of(size.width + size.height), {}});
    const std::pair<int, int> of_layers{shared::spec_layers, layers};
    tables.add_pass("surfels", "surfel/surfels", {screen_surfaces, edges, runs, screen_depth, behind, limits}, {surfels}, {of_layers});
    const cv::Size plane = plane_of(grid.samples); // its threads share a rotation
    const auto tiles = [](int n) { return static_cast<std::uint32_t>(divided_up(n, shared::screen_tile)); };
    const std::pair<int, int> spacing{shared::spec_spacing, options_.downsampled ? 2 : 1};
    tables.passes.push_back({"generate",
                             "surfel/generate",
                             {surfels, screen_surfaces, screen_noise},
                             {sampled},
                             {16 * tiles(plane.width), tiles(plane.height), 1},
                             {{shared::spec_slices, options_.slices}, {shared::spec_steps, options_.steps}, spacing, of_layers}});
    tables.add_pass_over(tables.window.size(), "resolve", "surfel/resolve", {surfels, screen_surfaces, sampled}, {screen_visibility},
                         {{shared::spec_denoise, options_.screen.denoise}, spacing}, 2);
}

std::vector<std::byte> Surfel::constants(const shared::ScreenConstants& screen) const {
    const cv::Size size(screen.size.x, screen.size.y), plane = plane_of(size);
    const Grid grid(size, {screen.window.x, screen.window.y}, options_.downsampled);
    const float r = screen.radius;
    const bool noisy = screen.noise_floor > 0 || screen.noise_per_z2 > 0;
    return bytes_of(shared::SurfelConstants{
        screen,
        {grid.words.width, grid.words.height},
        {plane.width, plane.height},
        {grid.samples.width, grid.samples.height},
        options_.thinnest * r,
        options_.thickest * r,
        std::min(options_.hidden, options_.thickest) * r,
        options_.slices * options_.steps <= 4 ? 1.3F : 1.0F, // between few samples gaps would open
        0.05F * r,
        0.3F * r,
        noisy ? widest_fill_px : narrowest_fill_px,
        0.5F * r,
        0.03F * r,
        static_cast<int>(std::lround(255 * hidden_layer / options_.thickest))});
}

} // namespace scanshade
