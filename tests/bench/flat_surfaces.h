// Where a recording without truth is known to be open: on its largest planes, away from all that stands on them.
#pragma once

#include "apps/budget/trial.h"

#include <span>
#include <vector>

namespace scanshade {

struct FlatSurfaces {
    int planes = 0;
    /// By frame, on the recorded pixels: 0 = on no plane, 1 = on a plane, 255 = and nothing stands before it.
    std::vector<cv::Mat1b> of_planes;
};

/// Planes are found robustly (RANSAC: Fischler and Bolles 1981) among the points of all frames together, if all have
/// poses, else in every frame by itself; each holds 4 % of the points or more. A pixel belongs to a plane within 0.01 z
/// + 0.003 z^2 m, which holds for the sensors of today. What stands farther before the plane on the camera's side, up
/// to `radius_m`, keeps `radius_m` round it from counting.
[[nodiscard]] FlatSurfaces flat_surfaces(std::span<const TrialFrame> frames, double radius_m);

} // namespace scanshade
