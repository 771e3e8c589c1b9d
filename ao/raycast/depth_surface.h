// A depth image as a surface for rays, cut at steps in depth, and its normals.
#pragma once

#include "ao/raycast/ray_surface.h"
#include "projection/maps.h"
#include "projection/sensor/noise.h"

namespace scanshade {

/// Two triangles per block of 2x2 pixels with depth, split along the diagonal where 1/z bends less. An edge crosses a
/// step where 1/z, linear on any plane, neither continues nor follows from either side (methods.md's 1.4).
/// Thickness 0: triangles across a step are left out; what remains is the sheet that the sensor saw. Otherwise surfaces
/// are slabs: a copy of the sheet at thickness_m behind it, and curtains at its outlines. A curtain extends from the
/// nearer rim by the thickness, or to the farther rim. A great thickness joins both rims everywhere (solid).
[[nodiscard]] Mesh surface_of(const DepthImage& depth, const DepthNoise& noise, double thickness_m);

/// Normals of clean depth. Each axis uses the neighbour towards which 1/z bends less (surfel.md's 3.6), or diagonals
/// where it has none. With one tangent only, as on wires, the normal is tilted to the camera as far as the tangent
/// allows; with none it faces the camera. Every pixel with depth has a normal.
[[nodiscard]] NormalImage normals_of(const DepthImage& depth);

} // namespace scanshade
