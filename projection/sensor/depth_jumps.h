// What recorded depth shows where it jumps from one surface to another.
#pragma once

#include "projection/sensor/noise.h"

#include <span>

namespace scanshade {

struct JumpsSeen {
    Jumps kind = Jumps::unknown; ///< unknown where jumps are of either kind; sharp where there are next to none
    double sharp_share = 0;      ///< of all jumps; 0 where there are next to none
};

/// Of all images, on all cores.
[[nodiscard]] JumpsSeen jumps_of(std::span<const DepthImage> images);

} // namespace scanshade
