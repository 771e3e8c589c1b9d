// The walk along one row of cells: loops over neighbouring cells, which compilers turn into vectors.
#pragma once

#include "ao/horizon/tables.h"

#include <array>
#include <span>

namespace scanshade::horizon {

/// Cells of one row that are computed at once: with the rows around them they fit into a first-level cache.
constexpr int most_cells = 256;
using Row = std::array<float, most_cells>;

/// Slopes of the largest and the smallest elevation in one direction; -infinity and infinity where a ray meets nothing.
struct Horizons {
    Row high, low;
};

/// Cells of a padded field. `z` points at the first of `count` cells, all of whose offsets lie in memory.
struct Cells {
    const float* z = nullptr;
    int count = 0;
    const unsigned char* known = nullptr; ///< of squares by north-west corner, for z; null where none around lacks data
};

/// What a row's horizons become; sums over directions. Null = not wanted.
struct Sums {
    float *svf = nullptr, *asvf = nullptr, *openness = nullptr, *openness_neg = nullptr, *ao = nullptr;
    Definition definition = Definition::solid_angle;
};

/// One direction's part in the sums.
struct Part {
    float weight = 0;             ///< of the anisotropic sky
    const float* plane = nullptr; ///< the cell's own plane in this direction, as a slope
};

/// Functions compiled for one kind of processor; the values are those of all kinds.
struct Kernels {
    /// `both`: the smallest elevations, too.
    void (*look)(const Cells&, const Ray&, bool both, Horizons&);
    /// Only points of the surface within a ball of `radius` cells.
    void (*look_in_ball)(const Cells&, const Ray&, float radius, Horizons&);
    void (*look_at)(const Cells&, std::span<const Offset>, Horizons&);
    void (*add)(const Horizons&, int count, const Part&, const Sums&);
};

/// Those of this processor.
[[nodiscard]] const Kernels& kernels();

} // namespace scanshade::horizon
