#include "ao/surfel/surfel.h"

#include "shaders/shared/surfel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

struct Level {
    Quality quality;
    int slices, steps;
    bool alike = false; ///< all surfaces are taken to be equally thick, and clean depth's narrow holes stay
};
constexpr std::array levels{Level{Quality::lowest, 1, 4, true}, Level{Quality::low, 1, 4}, Level{Quality::medium, 1, 8},
                            Level{Quality::high, 2, 8}, Level{Quality::highest, 4, 8}};

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

/// In clean depth, wide holes are the sky. Noisy sensors have shadows next to foreground objects.
constexpr int widest_fill_px = 40, narrowest_fill_px = 4;

int divided_up(int n, int by) { return (n + by - 1) / by; }

/// Limits of half the thickness of a surface, in radii, chosen for the least error. Surfaces whose ends are hidden get
/// the upper one.
constexpr float thinnest = 0.01F, thickest = 0.6F;
/// That of all surfaces where they are alike.
constexpr float alike = 0.25F;

/// Half the thickness of surfaces that only other views saw, in radii.
constexpr float hidden_layer = 0.05F;

/// A buffer: the surfaces that other views saw behind this view's and outside its image.
int add_layers(ScreenTables& tables) {
    using Texels = gpu::BufferRow::Texels;
    const auto halved = [](cv::Size size) { return cv::Size(divided_up(size.width, 2), divided_up(size.height, 2)); };
    const auto bytes = static_cast<std::size_t>(halved(tables.size).area()) * 4;
    const int behind = tables.add_buffer({"behind", 2 * bytes, gpu::BufferRow::Host::none, Texels::r32ui});
    tables.passes.push_back({"clear layers", "", {}, {behind}, {1, 1, 1}, {}});
    cv::Size threads = halved(tables.window.size());
    threads.height = divided_up(threads.height, shared::reprojected_rows);
    for (int round = 0; round < 2; ++round) {
        tables.add_pass_over(threads, fmt::format("reproject {}", round + 1), "surfel/reproject",
                             {screen_neighbours, screen_depth}, {behind}, {{shared::spec_round, round}});
        tables.passes.back().groups[2] = static_cast<std::uint32_t>(tables.neighbours);
    }
    tables.add_pass("widen", "surfel/widen", {screen_depth, behind, screen_surfaces}, {screen_surfaces});
    return behind;
}

/// Words of edges: along a row, along a column.
cv::Size words_of(cv::Size size) {
    return {divided_up(size.width, shared::surfel_run), divided_up(size.height, shared::surfel_run)};
}

/// The pixels sampled.
cv::Size samples_of(cv::Size window, bool downsampled) {
    return downsampled ? cv::Size(divided_up(window.width, 2), divided_up(window.height, 2)) : window;
}

/// The size of one of the 16 planes of pixels 4 apart.
cv::Size plane_of(cv::Size size) { return {divided_up(size.width, 4), divided_up(size.height, 4)}; }

/// Work groups for `n` threads.
std::array<std::uint32_t, 3> groups_of(int n) {
    return {static_cast<std::uint32_t>(divided_up(n, shared::surfel_group)), 1, 1};
}

/// Of texels of two words.
std::size_t bytes_of_texels(int count) { return 8 * static_cast<std::size_t>(count); }

void add_fill(ScreenTables& tables) {
    tables.add_pass_over(tables.window.size(), "fill", "surfel/fill", {screen_surfaces}, {screen_surfaces});
}

/// Without surfels, surfaces are read directly: an unused buffer for the slot of surfels.
int add_surfaces_alike(ScreenTables& tables) {
    if (tables.noisy)
        add_fill(tables);
    return tables.add_buffer({"no surfels", 8, gpu::BufferRow::Host::none, gpu::BufferRow::Texels::rg32ui, {0, 0}});
}

/// Adds the passes from surfaces to surfels, which are as thick as wide; returns their buffer.
int add_surfels(ScreenTables& tables, int layers) {
    using Texels = gpu::BufferRow::Texels;
    constexpr auto none = gpu::BufferRow::Host::none;
    const cv::Size size = tables.size, of_words = words_of(size);
    const int words = of_words.width * size.height + of_words.height * size.width;
    const int edges = tables.add_buffer({"edges", bytes_of_texels(words), none, Texels::rg32ui});
    const int runs = tables.add_buffer({"runs", bytes_of_texels(words), none, Texels::r32ui});
    const int surfels =
        tables.add_buffer({"surfels", bytes_of_texels(layers * 16 * plane_of(size).area()), none, Texels::rg32ui});
    // Without neighbours nothing reads what fills the slot of their layers.
    const int behind = layers > 1 ? add_layers(tables) : runs;
    add_fill(tables);
    tables.passes.push_back({"edges", "surfel/edges", {screen_surfaces}, {edges}, groups_of(words), {}});
    tables.passes.push_back({"runs", "surfel/runs", {edges}, {runs}, groups_of(size.width + size.height), {}});
    tables.add_pass("surfels", "surfel/surfels", {screen_surfaces, edges, runs, screen_depth, behind}, {surfels},
                    {{shared::spec_layers, layers}});
    return surfels;
}

} // namespace

std::vector<Parameter> SurfelOptions::parameters() {
    return joined(
        screen.parameters(),
        {{.name = "quality",
          .help = "reads per pixel: lowest 8, low 8, medium 16, high 32, highest 64. RMSE 0.103, 0.095, 0.085, 0.081, "
                  "0.080; time on a CPU 0.39, 0.57, 0.7, 1, 1.5 of high's. lowest assumes that all surfaces are "
                  "equally thick",
          .value = OneOf(&quality, quality_words)},
         {.name = "downsampled",
          .help = "samples every other pixel of every other row and fills in the rest: lowest RMSE 0.109, low 0.101, "
                  "high 0.085; time on a CPU 0.22, 0.37, 0.47 of high's",
          .value = &downsampled},
         {.name = "slices",
          .help = "slices of the hemisphere; 0 = as the quality says",
          .value = &slices,
          .low = 0,
          .high = 64},
         {.name = "steps",
          .help = "reads on either side of a slice; 0 = as the quality says",
          .value = &steps,
          .low = 0,
          .high = 256}});
}

Surfel::Surfel(gpu::Device& device, const SurfelOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Surfel::add_passes(ScreenTables& tables) const {
    using Texels = gpu::BufferRow::Texels;
    constexpr auto none = gpu::BufferRow::Host::none;
    const cv::Size samples = samples_of(tables.window.size(), options_.downsampled);
    const int layers = tables.neighbours > 0 ? 3 : 1;
    const bool packed =
        layers > 1 || !level_of(levels, options_.quality).alike; // layers of other views need thicknesses of their own
    const int surfels = packed ? add_surfels(tables, layers) : add_surfaces_alike(tables);
    const int sampled = tables.add_buffer({"sampled", bytes_of_texels(samples.area()), none, Texels::rg32f});
    const cv::Size plane = plane_of(samples); // its threads share a rotation
    const auto tiles = [](int n) { return static_cast<std::uint32_t>(divided_up(n, shared::screen_tile)); };
    const std::pair<int, int> spacing{shared::spec_spacing, options_.downsampled ? 2 : 1};
    const std::pair<int, int> of_layers{shared::spec_layers, layers}, of_packed{shared::spec_packed, packed};
    tables.passes.push_back({"generate",
                             "surfel/generate",
                             {surfels, screen_surfaces, screen_noise},
                             {sampled},
                             {16 * tiles(plane.width), tiles(plane.height), 1},
                             {{shared::spec_slices, options_.slices},
                              {shared::spec_steps, options_.steps},
                              spacing,
                              of_layers,
                              of_packed}});
    tables.add_pass_over(tables.window.size(), "resolve", "surfel/resolve", {surfels, screen_surfaces, sampled},
                         {screen_visibility}, {{shared::spec_denoise, options_.screen.denoise}, spacing, of_packed}, 2);
}

std::vector<std::byte> Surfel::constants(const shared::ScreenConstants& screen) const {
    const cv::Size size(screen.size.x, screen.size.y), plane = plane_of(size);
    const cv::Size words = words_of(size),
                   samples = samples_of({screen.window.x, screen.window.y}, options_.downsampled);
    const float r = screen.radius;
    const bool noisy = screen.noise_floor > 0 || screen.noise_per_z2 > 0;
    return bytes_of(shared::SurfelConstants{
        screen,
        {words.width, words.height},
        {plane.width, plane.height},
        {samples.width, samples.height},
        thinnest * r,
        thickest * r,
        alike * r,
        options_.slices * options_.steps <= 4 ? 1.3F : 1.0F, // between few samples gaps would open
        0.05F * r,
        0.3F * r,
        noisy ? widest_fill_px : narrowest_fill_px,
        0.5F * r,
        0.03F * r,
        static_cast<int>(std::lround(255 * hidden_layer / thickest))});
}

} // namespace scanshade
