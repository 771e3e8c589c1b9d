// A scene as a cloud: points spread evenly over all visible surfaces, with exact truth.
#pragma once

#include "apps/scenes/world/scene.h"

#include <vector>

namespace scanshade::scene {

/// Points in world coordinates (z up, metres), with unit normals that face the viewer.
struct SceneCloud {
    std::vector<Eigen::Vector3d> points, normals; ///< normals are zero for points on no surface
    std::vector<Eigen::Vector3d> surface = {};    ///< where the points would be without noise; empty = the points
    std::vector<Eigen::Vector3d> stations = {};   ///< where a scanner stood; empty = nowhere
    std::vector<std::size_t> starts = {};         ///< the first point of each station
};

/// `count` points of equal density on the tessellated surfaces, within the box that is seen from the walk. Each point
/// is seen from the walk, or from a free position that the walk sees. So there are points below tables, but none on the
/// floor under a rug. The same seed gives the same points.
[[nodiscard]] SceneCloud scene_cloud(const World& world, std::size_t count, int seed = 1);

/// True visibility of each point's surface (all of them or every `step`-th): rays against the scene itself. NaN for the
/// rest, and for points on no surface.
[[nodiscard]] std::vector<float> true_visibility(const World& world, const SceneCloud& cloud,
                                                 const TruthOptions& options, std::size_t step = 1);

} // namespace scanshade::scene
