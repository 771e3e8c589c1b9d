// Means of visibility over the neighbours of a point.
#pragma once

#include "ao/cloud/surface/cloud_surface.h"

#include <vector>

namespace scanshade {

/// A neighbour's weight in the mean is e^(this distance^2): visibility hardly changes over a tenth of the radius.
[[nodiscard]] float mean_falloff(float radius);

/// The mean of a value and its neighbours' on the same surface: parallel planes, distances small against the radius.
[[nodiscard]] Untouched<float> smoothed(const CloudSurface& surface, const Untouched<float>& values, float radius);

/// 1 for each point whose value is wanted (not 0), or whose value the means of wanted points need.
[[nodiscard]] std::vector<char> asked_by_means(const CloudSurface& surface, std::vector<char> wanted, int passes);

} // namespace scanshade
