// Where rays cross the grid: the same for every cell, so that they are found once for each direction.
#pragma once

#include "ao/horizon/horizon.h"

#include <cstddef>
#include <vector>

namespace scanshade::horizon {

/// A weighted mean of two cells less the cell looked at, over its distance: the slope to a point of the surface.
struct Sample {
    std::ptrdiff_t a = 0, b = 0; ///< offsets of the two
    float weight_a = 0, weight_b = 0;
    float t = 0;                           ///< distance in cells; 0 for the limit
    std::ptrdiff_t before = 0, behind = 0; ///< north-west corners of the squares that share this point
};

/// A point within a square: four cells from its north-west corner on.
struct InnerSample {
    std::ptrdiff_t corner = 0;
    float north_west = 0, north_east = 0, south_west = 0, south_east = 0, t = 0;
};

/// A sample, or one within a square.
struct Step {
    bool inner = false;
    std::size_t index = 0;
    float t = 0;
};

/// One direction of profile exact. `scale` turns a difference of heights over one cell into a slope.
struct Ray {
    double azimuth = 0;             ///< radians clockwise from north
    float east = 0, north = 0;      ///< unit vector
    std::ptrdiff_t stride = 0;      ///< floats from row to row
    std::vector<Sample> samples;    ///< by distance: the limit, or none with noise removed; then crossings
    std::vector<InnerSample> inner; ///< within squares: the middles of near ones, and the ends of the search
    std::vector<Step> steps;        ///< all of both by distance
};

/// Azimuths (k + 1/2) 2 pi / directions. `radius` and `from` in cells, `stride` in floats from row to row.
[[nodiscard]] std::vector<Ray> rays_of(int directions, double radius, double from, double scale, std::ptrdiff_t stride);

/// A cell that RVT looks at.
struct Offset {
    std::ptrdiff_t at = 0;
    float scale = 0; ///< 1 / distance in cells
};

/// The cells of RVT for direction i, angle 2 pi i / directions from north counterclockwise.
[[nodiscard]] std::vector<std::vector<Offset>> rvt_offsets(int directions, int radius, int from, std::ptrdiff_t stride);

/// Profile rvt's least distance in whole cells, max(1, rnd(radius q)).
[[nodiscard]] int least_distance(double radius, Noise noise);

} // namespace scanshade::horizon
