// What recorded depth shows where it jumps from one surface to another.
#pragma once

#include "projection/noise.h"

#include <span>

namespace scanshade {

/// Of all images, on all cores. Unknown where they show few jumps, or some of either kind.
[[nodiscard]] Jumps jumps_of(std::span<const DepthImage> images);

} // namespace scanshade
