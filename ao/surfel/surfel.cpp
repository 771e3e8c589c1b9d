#include "ao/surfel/surfel.h"

#include "projection/error.h"
#include "shaders/shared/surfel.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace scanshade {
namespace {

struct Level {
    std::string_view name;
    int slices, steps;
};
constexpr std::array levels{Level{"low", 1, 4}, Level{"medium", 1, 8}, Level{"high", 2, 8}, Level{"highest", 2, 16}};

/// Slices and steps of the quality, where none are given.
SurfelOptions resolved(SurfelOptions options) {
    options = checked(std::move(options));
    for (const Level& level : levels)
        if (level.name == options.quality) {
            if (options.slices == 0)
                options.slices = level.slices;
            if (options.steps == 0)
                options.steps = level.steps;
        }
    return options;
}

cv::Size words_of(cv::Size size) {
    const auto words = [](int n) { return (n + shared::surfel_run - 1) / shared::surfel_run; };
    return {words(size.width), words(size.height)};
}

/// Pixels that slices are marched from.
cv::Size samples_of(cv::Size size, bool downsampled) {
    return downsampled ? cv::Size((size.width + 1) / 2, (size.height + 1) / 2) : size;
}

/// One of the 16 planes of pixels (or samples) 4 apart.
cv::Size plane_of(cv::Size size) { return {(size.width + 3) / 4, (size.height + 3) / 4}; }

} // namespace

std::vector<Parameter> SurfelOptions::parameters() {
    auto rows = screen.parameters();
    rows.push_back(
        {"quality", "8, 16, 32 or 64 reads a pixel", &quality, "", {}, {}, {"low", "medium", "high", "highest"}});
    rows.push_back(
        {"downsampled", "march from every other pixel of every other row, and fill in the rest", &downsampled});
    rows.push_back({"slices", "of the hemisphere; 0 = the quality's", &slices, "", 0, 64});
    rows.push_back({"steps", "reads on either side of a slice; 0 = the quality's", &steps, "", 0, 256});
    rows.push_back({"thinnest", "half the thickness of a surface at least", &thinnest, "radii", 0, 10});
    rows.push_back({"thickest",
                    "half the thickness of a surface at most; what is wider than twice this in the image is as thick",
                    &thickest, "radii", 1e-3, 10});
    rows.push_back(
        {"hidden",
         "half the thickness of a surface whose ends lie behind others or outside the image; thickest is the limit",
         &hidden, "radii", 0, 10});
    return rows;
}

Surfel::Surfel(gpu::Device& device, const SurfelOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Surfel::add_passes(ScreenTables& tables) const {
    using Texels = gpu::BufferRow::Texels;
    constexpr auto none = gpu::BufferRow::Host::none;
    const cv::Size words = words_of(tables.size);
    const auto count_of_words = static_cast<std::size_t>(words.width) * tables.size.height +
                                static_cast<std::size_t>(words.height) * tables.size.width;
    const int edges = tables.add_buffer({"edges", count_of_words * 8, none, Texels::rg32ui});
    const int runs = tables.add_buffer({"runs", count_of_words * 8, none, Texels::r32ui});
    const int surfels = tables.add_buffer(
        {"surfels", static_cast<std::size_t>(plane_of(tables.size).area()) * 16 * 8, none, Texels::rg32ui});
    const auto lines_of = [](std::size_t n) {
        return std::array<std::uint32_t, 3>{static_cast<std::uint32_t>((n + 63) / 64), 1, 1};
    };
    tables.passes.push_back({"edges", "surfel/edges", {screen_depth}, {edges}, lines_of(count_of_words), {}});
    tables.passes.push_back({"runs",
                             "surfel/runs",
                             {edges},
                             {runs},
                             lines_of(static_cast<std::size_t>(tables.size.width + tables.size.height)),
                             {}});
    tables.add_pass("surfels", "surfel/surfels", {screen_depth, screen_normals, edges, runs}, {surfels});
    const cv::Size samples = samples_of(tables.size, options_.downsampled), plane = plane_of(samples);
    const auto count = static_cast<std::size_t>(samples.area());
    const int sampled = tables.add_buffer({"sampled", count * 8, none, Texels::rg32f});
    const int known = tables.add_buffer({"known", count * 4, none, Texels::r32f});
    const auto groups = [](int n) {
        return static_cast<std::uint32_t>((n + shared::screen_tile - 1) / shared::screen_tile);
    };
    const std::pair<int, int> spacing{shared::spec_spacing, options_.downsampled ? 2 : 1};
    tables.passes.push_back({"generate",
                             "surfel/generate",
                             {surfels, screen_normals, screen_noise},
                             {sampled, known},
                             {16 * groups(plane.width), groups(plane.height), 1},
                             {{shared::spec_slices, options_.slices}, {shared::spec_steps, options_.steps}, spacing}});
    tables.add_pass("resolve", "surfel/resolve", {surfels, screen_normals, sampled, known},
                    {screen_visibility, screen_coverage}, {{shared::spec_denoise, options_.screen.denoise}, spacing},
                    2);
}

std::vector<std::byte> Surfel::constants(const shared::ScreenConstants& screen) const {
    const cv::Size words = words_of({screen.size.x, screen.size.y});
    const cv::Size plane = plane_of({screen.size.x, screen.size.y});
    const cv::Size samples = samples_of({screen.size.x, screen.size.y}, options_.downsampled);
    const float r = screen.radius;
    return bytes_of(shared::SurfelConstants{
        screen,
        {words.width, words.height},
        {plane.width, plane.height},
        {samples.width, samples.height},
        options_.thinnest * r,
        options_.thickest * r,
        std::min(options_.hidden, options_.thickest) * r,
        options_.slices * options_.steps <= 4 ? 1.3F : 1.0F, // between few samples gaps would open
        0.05F * r,
        0.3F * r});
}

} // namespace scanshade
