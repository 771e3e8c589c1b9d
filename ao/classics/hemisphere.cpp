#include "ao/classics/hemisphere.h"

#include "shaders/shared/point_samples.h"

#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace scanshade {
namespace {

constexpr double shortest = 0.01; // of the radius
constexpr double lowest = 0.05;   // height above the tangent plane: lower points only hit the surface itself

struct Count {
    Quality quality;
    int points;
};
constexpr std::array counts{Count{Quality::lowest, 8}, Count{Quality::low, 16}, Count{Quality::medium, 32},
                            Count{Quality::high, 64}, Count{Quality::highest, 256}};

int points_of(const HemisphereOptions& options) {
    return options.points > 0 ? options.points : level_of(counts, options.quality).points;
}

double fraction(double x) { return x - std::floor(x); }

void append(std::vector<float>& kernel, double x, double y, double z, double share) {
    const double scale = (shortest + (1 - shortest) * share * share) / std::sqrt(x * x + y * y + z * z);
    for (const double c : {x * scale, y * scale, z * scale, 0.0})
        kernel.push_back(static_cast<float>(c));
}

} // namespace

std::vector<float> hemisphere_kernel(int points) {
    std::vector<float> kernel;
    for (int i = 0; i < points; ++i) {
        const double away2 = (i + 0.5) / points, phi = 2 * std::numbers::pi * fraction(i * 0.6180339887);
        // Distances come from another sequence, so that they are independent of the directions.
        const double share = fraction(0.5 + i * 0.7548776662);
        append(kernel, std::sqrt(away2) * std::cos(phi), std::sqrt(away2) * std::sin(phi),
               std::max(std::sqrt(1 - away2), lowest), share);
    }
    return kernel;
}

std::vector<float> published_kernel(int points) {
    std::mt19937 random(1);
    const auto next = [&] { return static_cast<double>(random()) / 4294967296.0; };
    std::vector<float> kernel;
    for (int i = 0; i < points; ++i) {
        const double x = 2 * next() - 1, y = 2 * next() - 1, z = next();
        append(kernel, x, y, z + 1e-9, static_cast<double>(i) / points);
    }
    return kernel;
}

std::vector<Parameter> HemisphereOptions::parameters() {
    return joined(screen.parameters(),
                  {
                      {.name = "profile",
                       .help = "metric has open planes and a normalised mean; published tests against the surface's "
                               "own depth, as the tutorial does",
                       .value = OneOf(&profile, profile_words)},
                      {.name = "quality",
                       .help = "number of points: lowest 8, low 16, medium 32, high 64, highest 256",
                       .value = OneOf(&quality, quality_words)},
                      {.name = "points",
                       .help = "points of the kernel; 0 = as the quality says",
                       .value = &points,
                       .low = 0,
                       .high = 1024},
                      {.name = "renormalise",
                       .help = "samples of unknown depth are left out where at least half are known; "
                               "otherwise they count as open",
                       .value = &renormalise},
                      {.name = "blurs",
                       .help = "iterations of the published 7-tap blur, before denoise",
                       .value = &blurs,
                       .low = 0,
                       .high = 16},
                  });
}

Hemisphere::Hemisphere(gpu::Device& device, const HemisphereOptions& options)
    : ScreenMethod(device, checked(options).screen), options_(options) {}

void Hemisphere::add_passes(ScreenTables& tables) const {
    const bool published = options_.profile == Profile::published;
    const int points = points_of(options_);
    const auto kernel = published ? published_kernel(points) : hemisphere_kernel(points);
    const int table = tables.add_buffer(
        {"kernel", kernel.size() * 4, gpu::BufferRow::Host::none, gpu::BufferRow::Texels::rgba32f, kernel});
    tables.add_pass("generate", "hemisphere/generate", {screen_depth, screen_surfaces, screen_noise, table},
                    {screen_raw},
                    {{shared::spec_published, published}, {shared::spec_renormalise, options_.renormalise}});
    tables.add_blurs(options_.blurs, {0.370F, 0.317F, 0.198F, 0.115F});
}

std::vector<std::byte> Hemisphere::constants(const shared::ScreenConstants& screen) const {
    return bytes_of(shared::HemisphereConstants{screen, points_of(options_), 0.02F * screen.radius});
}

} // namespace scanshade
