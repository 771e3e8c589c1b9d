#include "ao/gtao/bitmask.h"

namespace scanshade {

std::vector<Parameter> BitmaskOptions::parameters() {
    return joined(
        joined(screen.parameters(), slices.parameters()),
        {
            {"thickness", "how thick what is seen is taken to be", &thickness, "radii", 1e-4, 1e6},
            {"thickness-per-z", "and how much thicker per metre of depth", &thickness_per_z, "m/m", 0, 10},
            {"sectors",
             "cosine: of equal cosine-weighted measure; angle: of equal angle, as published",
             &sectors,
             "",
             {},
             {},
             {"cosine", "angle"}},
            {"unbounded", "samples beyond the radius count, too, as published: only the image's march ends there",
             &unbounded},
        });
}

Bitmask::Bitmask(gpu::Device& device, const BitmaskOptions& options)
    : ScreenMethod(device, checked(options).screen), options_(options) {}

void Bitmask::add_passes(ScreenTables& tables) const {
    // Unbounded is a linear falloff so slow that every sample keeps some weight; sectors know no weights.
    const int falloff = options_.unbounded ? shared::falloff_linear : shared::falloff_hard;
    add_slice_pass(tables, options_.slices,
                   {{shared::spec_bitmask, 1},
                    {shared::spec_falloff, falloff},
                    {shared::spec_uniform, options_.sectors == "angle"}});
}

std::vector<std::byte> Bitmask::constants(const shared::ScreenConstants& screen) const {
    shared::GtaoConstants block = slice_constants(options_.slices, screen);
    block.thickness = options_.thickness * screen.radius;
    block.thickness_per_z = options_.thickness_per_z;
    block.falloff_add = 1;
    return bytes_of(block);
}

} // namespace scanshade
