#include "ao/classics/luna.h"

#include "projection/base/error.h"
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

/// Samples less than `epsilon` in front of the surface do not occlude; occlusion fades out between the other two.
struct Falloff {
    float epsilon, fade_from, fade_to;
};
constexpr Falloff published_m{0.05F, 0.2F, 1};
Falloff falloff_of(float radius_m) { return {0.02F * radius_m, 0.4F * radius_m, radius_m}; }

/// The companion code's power and blur belong to its tone curve.
LunaOptions resolved(LunaOptions options) {
    options = checked(std::move(options));
    if (options.profile == Profile::metric)
        return options;
    options.screen.power *= 6;
    options.screen.denoise = false;
    options.blurs = 4;
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
             .help = "metric respects the radius; published uses the companion code's constants in metres, power 6 "
                     "and four blurs",
             .value = OneOf(&profile, profile_words)},
            {.name = "quality",
             .help = "number of vectors: lowest 8, low 14 as published, medium 28, high 56, highest 224",
             .value = OneOf(&quality, quality_words)},
            {.name = "renormalise",
             .help = "samples of unknown depth are left out where at least half are known; otherwise they "
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
    const Falloff how = options_.profile == Profile::published ? published_m : falloff_of(screen.radius);
    return bytes_of(shared::LunaConstants{screen, count.sets, count.count, how.epsilon, how.fade_from, how.fade_to});
}

} // namespace scanshade
