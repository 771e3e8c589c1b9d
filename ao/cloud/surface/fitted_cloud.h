// A noisy cloud made smooth: thinned to what its noise carries, and moved onto its surface.
#pragma once

#include "ao/cloud/surface/neighbours.h"
#include "ao/cloud/surface/shared_noise.h"

#include <cstdint>
#include <Eigen/Core>
#include <span>
#include <vector>

namespace scanshade {

/// Points on the surface, each standing for one or several of the points given.
struct FittedCloud {
    std::vector<Eigen::Vector3d> points;
    std::vector<Eigen::Vector3d> normals; ///< the mean of the recorded ones; empty where none are given
    std::vector<Eigen::Vector3f> axes;    ///< fitted, not oriented; zero for points that no noise concerns
    std::vector<char> alone;              ///< 1: off all surfaces near it by more than noise explains
    std::vector<std::uint32_t> fitted_of; ///< by point given: its index in `points`
    float noise = 0;                      ///< sigma across the surface, the median over the cloud, in its unit
    std::size_t moved = 0;                ///< points given that noise concerns

    [[nodiscard]] bool empty() const { return points.empty(); }
};

/// Acts where sigma (CloudNoise) is above a fiftieth of the points' spacing. Points closer together than six sigma are
/// taken together. Then all move along their normals onto the local surface. That is the mean, weighted by distance, of
/// the points whose planes are alike and which lie within three sigma of it. Windows hold 16 to 64 of the thinned
/// points, so that what noise is left is small against their spacing. Near edges, where a window holds two surfaces,
/// the plane is that of a neighbour whose window is flat. Empty where that concerns less than a hundredth of the
/// points. `local` is made of `points`; `normals` is empty or holds one per point. Noise is looked for in balls up to a
/// third of `radius`.
[[nodiscard]] FittedCloud fitted_cloud(const LocalCloud& local, std::span<const Eigen::Vector3d> points,
                                       std::span<const Eigen::Vector3d> normals, double radius);
/// The same for a part of a cloud with the noise of the whole. However few points noise concerns, they are moved, since
/// other parts may hold more.
[[nodiscard]] FittedCloud fitted_cloud(const LocalCloud& local, std::span<const Eigen::Vector3d> points,
                                       std::span<const Eigen::Vector3d> normals, const SharedNoise& noise);

/// Whether the signs of recorded normals are more than chance; else both sides of a plane are one.
[[nodiscard]] bool sides_agree(const NeighbourTree& tree, std::span<const Eigen::Vector3d> normals);

} // namespace scanshade
