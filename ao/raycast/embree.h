// Embree's device, one for this room: it holds no geometry, only the choice of instructions.
#pragma once

#include <embree3/rtcore.h>

namespace scanshade {

/// Throws Error where Embree cannot run.
[[nodiscard]] RTCDevice embree_device();

} // namespace scanshade
