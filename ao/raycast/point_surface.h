// A cloud as a surface for rays: one disc per point; its neighbours give size and orientation.
#pragma once

#include "ao/raycast/ray_surface.h"

namespace scanshade {

/// One disc per point, in order; discs of points that are not finite have radius 0. Where `normals` holds one per
/// point, discs use them (non-finite and zero ones are replaced). Otherwise they use the plane through the 20 nearest
/// points, oriented towards the sensor at the origin of the coordinates; points without a plane face the origin.
/// Radius: 1.2 times the distance to the sixth neighbour, within 0.5 .. 3 times the median over all points
/// (methods.md's 2.4).
[[nodiscard]] std::vector<Disc> discs_of(std::span<const Eigen::Vector3d> points,
                                         std::span<const Eigen::Vector3d> normals = {});

} // namespace scanshade
