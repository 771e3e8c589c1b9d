// What recorded depth shows where it jumps from one surface to another.
#pragma once

#include "projection/noise.h"

#include <span>

namespace scanshade {

/// Of all images, on all cores. Unknown where jumps are of either kind; sharp where there are next to none.
[[nodiscard]] Jumps jumps_of(std::span<const DepthImage> images);

} // namespace scanshade
