#include "ao/luna/luna.h"

#include "projection/error.h"
#include "shaders/shared/point_samples.h"

#include <array>
#include <cmath>

namespace scanshade {
namespace {

/// Corners and face centres of a cube, opposite pairs together: any even number of them points nowhere on the whole.
constexpr std::array<std::array<int, 3>, 14> directions{{{1, 1, 1},
                                                         {-1, -1, -1},
                                                         {-1, 1, 1},
                                                         {1, -1, -1},
                                                         {1, 1, -1},
                                                         {-1, -1, 1},
                                                         {-1, 1, -1},
                                                         {1, -1, 1},
                                                         {-1, 0, 0},
                                                         {1, 0, 0},
                                                         {0, -1, 0},
                                                         {0, 1, 0},
                                                         {0, 0, -1},
                                                         {0, 0, 1}}};

struct Count {
    Quality quality;
    int sets, count;
};
constexpr std::array counts{Count{Quality::lowest, 1, 8}, Count{Quality::low, 1, 14}, Count{Quality::medium, 2, 14},
                            Count{Quality::high, 4, 14}, Count{Quality::highest, 16, 14}};

/// The companion code's power and blur belong to its look.
LunaOptions resolved(LunaOptions options) {
    options = checked(std::move(options));
    if (options.fade_to <= options.fade_from)
        throw Misuse("fade-to must lie beyond fade-from");
    if (options.profile == Profile::metric)
        return options;
    options.screen.power *= 6;
    options.screen.denoise = false;
    options.blurs = 4;
    options.epsilon = 0.05F; // in metres, as the next two
    options.fade_from = 0.2F;
    options.fade_to = 1;
    return options;
}

} // namespace

std::vector<float> luna_vectors(int sets, int count) {
    std::vector<float> vectors;
    for (int i = 0; i < sets * count; ++i) {
        const auto& [x, y, z] = directions[static_cast<std::size_t>(i % count)];
        const double place = 0.5 + i * 0.6180339887;
        const double length = (0.25 + 0.75 * (place - std::floor(place))) / std::sqrt(x * x + y * y + z * z);
        for (const int c : {x, y, z, 0})
            vectors.push_back(static_cast<float>(c * length));
    }
    return vectors;
}

std::vector<Parameter> LunaOptions::parameters() {
    return joined(
        screen.parameters(),
        {
            {.name = "profile",
             .help = "metric respects the radius; published takes the companion code's constants in metres, power 6 "
                     "and four blurs",
             .value = OneOf(&profile, profile_words)},
            {.name = "quality",
             .help = "number of vectors: lowest 8, low 14 as published, medium 28, high 56, highest 224",
             .value = OneOf(&quality, quality_words)},
            {.name = "epsilon",
             .help = "what stands less than this in front of the surface does not occlude",
             .value = &epsilon,
             .unit = "radii",
             .low = 0,
             .high = 1},
            {.name = "fade-from",
             .help = "what stands farther in front than this occludes less",
             .value = &fade_from,
             .unit = "radii",
             .low = 0,
             .high = 10},
            {.name = "fade-to",
             .help = "what stands farther in front than this does not occlude",
             .value = &fade_to,
             .unit = "radii",
             .low = 1e-3,
             .high = 10},
            {.name = "renormalise",
             .help = "samples that met nothing known are left out where at least half met something; otherwise they "
                     "count as open",
             .value = &renormalise},
            {.name = "blurs",
             .help = "iterations of the published 11-tap blur, before denoise",
             .value = &blurs,
             .low = 0,
             .high = 16},
        });
}

Luna::Luna(gpu::Device& device, const LunaOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Luna::add_passes(ScreenTables& tables) const {
    const Count& count = level_of(counts, options_.quality);
    const auto vectors = luna_vectors(count.sets, count.count);
    const int table = tables.add_buffer(
        {"vectors", vectors.size() * 4, gpu::BufferRow::Host::none, gpu::BufferRow::Texels::rgba32f, vectors});
    tables.add_pass("generate", "luna/generate", {screen_depth, screen_surfaces, screen_noise, table}, {screen_raw},
                    {{shared::spec_published, options_.profile == Profile::published},
                     {shared::spec_renormalise, options_.renormalise}});
    tables.add_blurs(options_.blurs, {0.16397F, 0.15136F, 0.11906F, 0.07981F, 0.04559F, 0.02219F}); // sigma 2.5 pixels
}

std::vector<std::byte> Luna::constants(const shared::ScreenConstants& screen) const {
    const Count& count = level_of(counts, options_.quality);
    const float unit = options_.profile == Profile::published ? 1 : screen.radius;
    return bytes_of(shared::LunaConstants{screen, count.sets, count.count, options_.epsilon * unit,
                                          options_.fade_from * unit, options_.fade_to * unit});
}

} // namespace scanshade
