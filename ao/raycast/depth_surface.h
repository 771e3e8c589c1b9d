// A depth image as a surface for rays: what the sensor saw, cut where it saw a step, and how it is oriented.
#pragma once

#include "ao/raycast/ray_surface.h"
#include "projection/maps.h"
#include "projection/noise.h"

namespace scanshade {

/// Two triangles per block of 2x2 pixels with depth, the diagonal where 1/z bends less. A triangle with an edge across
/// a step (methods.md's 1.4: 1/z, which is linear on any plane, neither continues nor can be predicted from either
/// side) is left out with a thickness of 0: the sheet that the sensor proved. With a thickness surfaces are slabs: the
/// sheet once more at thickness_m behind itself, and at its outlines a curtain that hangs from the nearer rim as deep,
/// or to the farther rim; a great thickness joins both rims everywhere (solid: the most that can be there).
[[nodiscard]] Mesh surface_of(const DepthImage& depth, const DepthNoise& noise, double thickness_m);

/// Normals of clean depth: along each axis from the neighbour towards which 1/z bends less (surfel.md's 3.6), along
/// diagonals where an axis has none. With one direction only, as on wires, the normal leans to the camera; with none it
/// faces it: every pixel with depth has a normal.
[[nodiscard]] NormalImage normals_of(const DepthImage& depth);

} // namespace scanshade
