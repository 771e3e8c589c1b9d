// A noisy cloud made smooth: thinned to what its noise carries, and moved onto its surface.
#pragma once

#include "ao/cloud/surface/neighbours.h"
#include "ao/cloud/surface/shared_noise.h"

#include <cstdint>
#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

namespace scanshade {

/// Points on the surface, each standing for one or several of the points given.
struct FittedCloud {
    std::vector<Eigen::Vector3d> points;
    std::vector<Eigen::Vector3d> normals; ///< the mean of the recorded ones; empty where none are given
    std::vector<Eigen::Vector3f> axes;    ///< fitted, not oriented; zero for points that no noise concerns
    std::vector<char> alone;              ///< 1: off all surfaces near it by more than noise explains
    std::vector<float> sigma;             ///< of the noise round them; empty where it is below the spacing
    std::vector<float> largest_disc;      ///< radii that no disc may exceed; empty = any
    std::vector<std::uint32_t> fitted_of; ///< by point given: its index in `points`
    float noise = 0;                      ///< sigma across the surface, the median over the cloud, in its unit
    std::size_t moved = 0;                ///< points given that noise concerns

    [[nodiscard]] bool empty() const { return points.empty(); }
};

/// Boxes of a grid that is the same for every part of a cloud. What is taken together lies in one box, so that a part
/// thins its points as the whole does.
struct ThinningGrid {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    double side = 0;
};
/// Boxes of about 20 spacings hold 400 points of a surface; smaller ones cut more of what belongs together. Their sides
/// are powers of two, and they stay where they are when the centre or the spacing changes a little.
[[nodiscard]] ThinningGrid thinning_grid(const Eigen::Vector3d& centre, double spacing);

/// Acts where sigma (CloudNoise) is above a fiftieth of the points' spacing. Points closer together than six sigma are
/// taken together. Then all move along their normals onto the local surface. That is the mean, weighted by distance, of
/// the points whose planes are alike and which lie within three sigma of it. Windows hold 16 to 64 of the thinned
/// points, so that what noise is left is small against their spacing. Near edges, where a window holds two surfaces,
/// the plane is that of a neighbour whose window is flat. Empty where that concerns less than a hundredth of the
/// points. `local` is made of `points`; `normals` is empty or holds one per point. Noise is looked for in balls up to a
/// third of `radius`. `exceeds_spacing`: that of the cloud whose part these points are does; see SharedNoise.
[[nodiscard]] FittedCloud fitted_cloud(const LocalCloud& local, std::span<const Eigen::Vector3d> points,
                                       std::span<const Eigen::Vector3d> normals, double radius,
                                       const ThinningGrid& grid, bool exceeds_spacing = false);
/// The same with noise that is known. However few points it concerns, they are moved: the points may be a part of a
/// cloud whose other parts hold more. Noise that exceeds the spacing is left to cleaned_cloud().
[[nodiscard]] FittedCloud fitted_cloud(const LocalCloud& local, std::span<const Eigen::Vector3d> points,
                                       std::span<const Eigen::Vector3d> normals, double radius,
                                       const SharedNoise& noise, const ThinningGrid& grid);

/// Whether the recorded normals of a point and of its nearest neighbour are opposed; nothing where it has none.
[[nodiscard]] std::optional<bool> opposed_beside(const NeighbourTree& tree, std::span<const Eigen::Vector3d> normals,
                                                 std::size_t index);
/// By that of many points, whether the signs of recorded normals are more than chance; else both sides of a plane are
/// one. Where noise exceeds the spacing, few wrong signs make layers of a slab, so nearly all must agree.
[[nodiscard]] bool sides_agree(std::span<const std::optional<bool>> opposed, bool exceeds_spacing);

} // namespace scanshade
