#include "ao/gtao/bitmask.h"

namespace scanshade {
namespace {

constexpr std::array sector_words{Named{"cosine", Sectors::cosine}, Named{"angle", Sectors::angle}};

} // namespace

std::vector<Parameter> BitmaskOptions::parameters() {
    return joined(
        joined(screen.parameters(), slices.parameters()),
        {
            {.name = "thickness",
             .help = "assumed thickness of surfaces",
             .value = &thickness,
             .unit = "radii",
             .low = 1e-4,
             .high = 1e6},
            {.name = "thickness-per-z",
             .help = "additional thickness per metre of depth",
             .value = &thickness_per_z,
             .unit = "m/m",
             .low = 0,
             .high = 10},
            {.name = "sectors",
             .help = "cosine: sectors of equal cosine-weighted measure; angle: of equal angle, as published",
             .value = OneOf(&sectors, sector_words)},
            {.name = "unbounded",
             .help = "samples beyond the radius count, too, as published; the march in the image still ends there",
             .value = &unbounded},
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
                    {shared::spec_uniform, options_.sectors == Sectors::angle}});
}

std::vector<std::byte> Bitmask::constants(const shared::ScreenConstants& screen) const {
    shared::GtaoConstants block = slice_constants(options_.slices, screen);
    block.thickness = options_.thickness * screen.radius;
    block.thickness_per_z = options_.thickness_per_z;
    block.falloff_add = 1;
    return bytes_of(block);
}

} // namespace scanshade
