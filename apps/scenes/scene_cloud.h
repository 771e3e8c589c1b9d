// A scene as a cloud: points spread evenly over all surfaces that anything in its free space sees, with exact truth.
#pragma once

#include "apps/scenes/scene.h"

#include <vector>

namespace scanshade::scene {

/// Points in world coordinates (z up, metres), with the unit normals of the sides they were seen from.
struct SceneCloud {
    std::vector<Eigen::Vector3d> points, normals;
};

/// `count` points of equal density on the tessellated surfaces, within the box that is seen from the walk, as far as
/// they are seen from the walk or from one of many places that are: below tables, too, but not where a rug lies on the
/// floor. The same seed gives the same points.
[[nodiscard]] SceneCloud scene_cloud(const World& world, std::size_t count, int seed = 1);

/// True visibility of each point (all of them or every `step`-th, the rest NaN): rays against the scene itself.
[[nodiscard]] std::vector<float> true_visibility(const World& world, const SceneCloud& cloud,
                                                 const TruthOptions& options, std::size_t step = 1);

} // namespace scanshade::scene
