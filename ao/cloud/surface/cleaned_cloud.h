// A cloud whose noise is larger than its spacing, as of merged depth frames, made a surface: discs in place of a slab.
#pragma once

#include "ao/cloud/surface/fitted_cloud.h"

#include <optional>
#include <span>
#include <vector>

namespace scanshade {

/// The slab of noise in the ball around a point.
struct Slab {
    float sigma = 0;   ///< across the surface, in the tree's unit
    float spacing = 0; ///< of the points if they lay on the surface: the side of a square that holds one
};
/// Of points of the tree: the first of growing balls whose radius is five sigma of its points or more. Nothing where
/// none up to `widest` is. `normals` is empty or holds one per point of the cloud: points that face away are another
/// surface then.
[[nodiscard]] std::vector<std::optional<Slab>> slabs_around(const NeighbourTree& tree,
                                                            std::span<const Eigen::Vector3d> normals,
                                                            std::span<const std::size_t> indices, float widest);
/// Whether windows of a few spacings see slabs, no surfaces: sigma is above 0.36 of the spacing at 40 % of the places.
[[nodiscard]] bool noise_exceeds_spacing(std::span<const std::optional<Slab>> slabs);

/// Discs on the surface that the points scatter about; each stands for the points that were moved to it.
///
/// 1. Robust planes of seeds, one per voxel: sigma there is that of the first growing ball whose radius is five sigma.
/// 2. Every point chooses the plane, among those of its nearest seeds, that explains it best. So edges stay sharp: this
///    is the best of shifted windows, not their mean. It moves onto the mean of those that agree with the chosen one.
/// 3. Moved points are taken together in voxels as large as the noise, and these discs are projected onto each other
///    once more.
///
/// Points that no plane explains make no disc, and have the value of the nearest one. `normals` is empty or holds one
/// per point, whose signs tell surfaces apart. Windows are at most 0.7 `radius` wide. Empty where there are no
/// planes. Depends on nothing but points near by, but for the seeds' voxels, which are those of `grid`.
[[nodiscard]] FittedCloud cleaned_cloud(const LocalCloud& local, std::span<const Eigen::Vector3d> points,
                                        std::span<const Eigen::Vector3d> normals, double radius,
                                        const ThinningGrid& grid);

} // namespace scanshade
