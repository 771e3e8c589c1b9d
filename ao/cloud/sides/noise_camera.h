// Where the depth camera stood whose frames were merged: noise and sparseness of its points grow with the distance.
#pragma once

#include "ao/cloud/surface/cloud_surface.h"
#include "ao/cloud/surface/disc_rays.h"

#include <optional>

namespace scanshade {

/// A place relative to the surface's middle, and why it is taken.
struct NoiseCamera {
    Eigen::Vector3f position = Eigen::Vector3f::Zero();
    double seen = 0;    ///< share of the surface that nothing hides from it, from either side
    double noise = 0;   ///< rank correlation of sigma with the distance, over what it sees
    double density = 0; ///< the same of the points on an area with cosine / distance^2
};

/// Of places in and round the cloud, the one with the largest sum of the three. What is seen alone does not tell:
/// behind a table as much is seen as before it. Nothing where sigma does not grow from any such place, as where leaves
/// and wires are taken for noise. `rays` are made of the surface, whose `noise` is known. Deterministic.
[[nodiscard]] std::optional<NoiseCamera> camera_of_noise(const CloudSurface& surface, const DiscRays& rays);

} // namespace scanshade
