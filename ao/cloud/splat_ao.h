// Visibility of Gaussian splats: each is an oriented disc of soft edge, and takes the share of light that renderers
// blend.
#pragma once

#include "ao/base/method.h"
#include "ao/cloud/cloud_work.h"

#include <optional>

namespace scanshade {

/// Of `cloud.splats`, one per point. A ray's share of light is the product of 1 - a over the discs that it crosses,
/// with a = opacity e^(-x^2 / 2) at x sigmas (Kerbl et al. 2023, equation 3, in the disc's plane as in Huang et al.,
/// "2D Gaussian Splatting", 2024). Visibility is the cosine-weighted mean over the rays. Haze has the visibility of the
/// nearest surface, 1 where none is within the radius; so have splats much larger than the others.
/// Sides are those that most of the cameras in `cloud.frames` see, where their images and settings allow it.
/// Normals of flat splats are their shortest axes, those of others are of planes through neighbours. Always on the
/// processor, and as a whole.
[[nodiscard]] PointVisibility visibility_of_splats(const CloudSetup& setup, const PointSet& cloud,
                                                   const std::optional<Eigen::Vector3d>& scanner);

} // namespace scanshade
