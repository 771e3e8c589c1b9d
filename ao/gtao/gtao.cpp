#include "ao/gtao/gtao.h"

namespace scanshade {
namespace {

constexpr float linear_share = 0.615F; // of the radius over which XeGTAO's weight falls

/// XeGTAO: radius, falloff and power were fitted together, so a profile sets them together.
GtaoOptions resolved(GtaoOptions options) {
    options = checked(std::move(options));
    if (options.profile == GtaoProfile::metric)
        return options;
    options.screen.radius *= 1.457F;
    options.screen.power *= 2.2F;
    options.falloff = GtaoFalloff::linear;
    return options;
}

/// The specialization constant of a falloff.
int kind_of(GtaoFalloff falloff) {
    switch (falloff) {
    case GtaoFalloff::linear:
        return shared::falloff_linear;
    case GtaoFalloff::quadratic:
        return shared::falloff_quadratic;
    case GtaoFalloff::hard:
        break;
    }
    return shared::falloff_hard;
}

constexpr std::array gtao_profile_words{Named{"metric", GtaoProfile::metric}, Named{"xegtao", GtaoProfile::xegtao}};
constexpr std::array gtao_falloff_words{Named{"hard", GtaoFalloff::hard}, Named{"linear", GtaoFalloff::linear},
                                        Named{"quadratic", GtaoFalloff::quadratic}};

} // namespace

std::vector<Parameter> GtaoOptions::parameters() {
    return joined(
        joined(screen.parameters(), slices.parameters()),
        {
            {.name = "profile",
             .help = "metric estimates visibility within the radius; xegtao uses 1.457 times the radius, linear "
                     "falloff and power 2.2",
             .value = OneOf(&profile, gtao_profile_words)},
            {.name = "falloff",
             .help =
                 "how the weight of a sample falls with distance: hard, at the radius; linear, over its last 0.615; "
                 "or quadratic",
             .value = OneOf(&falloff, gtao_falloff_words)},
        });
}

Gtao::Gtao(gpu::Device& device, const GtaoOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)) {}

void Gtao::add_passes(ScreenTables& tables) const {
    add_slice_pass(tables, options_.slices, {{shared::spec_falloff, kind_of(options_.falloff)}});
}

std::vector<std::byte> Gtao::constants(const shared::ScreenConstants& screen) const {
    shared::GtaoConstants block = slice_constants(options_.slices, screen);
    const float r = screen.radius;
    const bool linear = kind_of(options_.falloff) == shared::falloff_linear;
    block.falloff_scale = linear ? -1 / (linear_share * r) : -1 / (r * r);
    block.falloff_add = linear ? 1 / linear_share : 1;
    return bytes_of(block);
}

} // namespace scanshade
