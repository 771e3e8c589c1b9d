// The number of slices and steps of the slice methods: by a named quality, or given.
#pragma once

#include "ao/screen/screen.h"
#include "shaders/shared/gtao.h"

#include <string>
#include <vector>

namespace scanshade {

/// Slices through the eye's ray, and steps to either side of each: 2 x slices x steps reads a pixel.
struct SliceOptions {
    Quality quality = Quality::medium; ///< lowest 8 reads, low 16, medium 32, high 64, highest 512
    int slices = 0, steps = 0;         ///< above 0: instead of the quality's
    float distribution = 2;            ///< exponent of the steps' distances: above 1, they are denser close by

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// The block of one view, without falloff and thickness.
[[nodiscard]] shared::GtaoConstants slice_constants(const SliceOptions& options, const shared::ScreenConstants& screen);

/// Appends the one pass of gtao and bitmask; `constants` are specializations (shared/gtao.h).
void add_slice_pass(ScreenTables& tables, const SliceOptions& options, std::vector<std::pair<int, int>> constants);

} // namespace scanshade
