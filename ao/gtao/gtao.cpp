#include "ao/gtao/gtao.h"

namespace scanshade {
namespace {

constexpr float linear_share = 0.615F; // of the radius over which XeGTAO's weight falls

/// XeGTAO: radius, falloff and power were fitted together, so a profile sets them together.
GtaoOptions resolved(GtaoOptions options) {
    options = checked(std::move(options));
    if (options.profile == "metric")
        return options;
    options.screen.radius *= 1.457F;
    options.screen.power *= 2.2F;
    options.falloff = "linear";
    return options;
}

int kind_of(const std::string& falloff) {
    if (falloff == "linear")
        return shared::falloff_linear;
    return falloff == "quadratic" ? shared::falloff_quadratic : shared::falloff_hard;
}

} // namespace

std::vector<Parameter> GtaoOptions::parameters() {
    return joined(
        joined(screen.parameters(), slices.parameters()),
        {
            {"profile",
             "metric: visibility within the radius; xegtao: 1.457 times the radius, linear falloff, power 2.2",
             &profile,
             "",
             {},
             {},
             {"metric", "xegtao"}},
            {"falloff",
             "how a sample's weight falls with distance: not before the radius, over its last 0.615, or with the "
             "square",
             &falloff,
             "",
             {},
             {},
             {"hard", "linear", "quadratic"}},
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
