// Backs that rays from fronts meet first: where noise or wrong sides have left layers that free space does not have.
#pragma once

#include "ao/cloud/surface/disc_rays.h"

#include <cstddef>
#include <limits>
#include <vector>

namespace scanshade {

/// Cosine-weighted rays that leave the front of a surface meet fronts or nothing, but behind sheets that were seen from
/// one side only. What noise has left of a surface is layers, whose backs they meet.
struct BackShare {
    /// By index in the tree: of rays near by, the share that meets a back within the radius, whose square is unbiased.
    std::vector<float> near;
    double mean = 0; ///< of all rays
};
/// From a point of each leaf, which has a normal, or of `most_leaves` of them. Deterministic.
[[nodiscard]] BackShare back_share(const CloudSurface& surface, const DiscRays& rays, float radius,
                                   std::size_t most_leaves = std::numeric_limits<std::size_t>::max());

} // namespace scanshade
