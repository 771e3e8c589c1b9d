#include "ao/gtao/bitmask.h"

namespace scanshade {

std::vector<Parameter> BitmaskOptions::parameters() {
    return joined(joined(screen.parameters(), slices.parameters()), {{.name = "thickness",
                                                                      .help = "assumed thickness of surfaces",
                                                                      .value = &thickness,
                                                                      .unit = "radii",
                                                                      .low = 1e-4,
                                                                      .high = 1e6}});
}

Bitmask::Bitmask(gpu::Device& device, const BitmaskOptions& options)
    : ScreenMethod(device, checked(options).screen), options_(options) {}

void Bitmask::add_passes(ScreenTables& tables) const {
    add_slice_pass(tables, options_.slices, {{shared::spec_bitmask, 1}, {shared::spec_falloff, shared::falloff_hard}});
}

std::vector<std::byte> Bitmask::constants(const shared::ScreenConstants& screen) const {
    shared::GtaoConstants block = slice_constants(options_.slices, screen);
    block.thickness = options_.thickness * screen.radius;
    return bytes_of(block);
}

} // namespace scanshade
