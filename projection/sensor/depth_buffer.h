// Whether an image that should hold depth holds a renderer's depth buffer: numbers of 0 .. 1 that are linear in 1 / z.
#pragma once

#include "projection/maps.h"

namespace scanshade {

/// By the planes in it. Along a plane the numbers a - b / z of a depth buffer are linear in the pixel, as 1 / z is; z
/// is not. In a buffer whose near plane lies at 1 cm, all numbers are next to 1, and both differ by a millionth.
/// Renderers draw planes that are even to the last bits of a float, and only those are looked at: noise and steps of a
/// sensor have no say. Buffers where 1 is near (reversed z), and such of -1 .. 1, are told, too. False where a number
/// is larger than 1, where few planes are large enough, and where they have one slope.
[[nodiscard]] bool is_depth_buffer(const DepthImage& depth);

} // namespace scanshade
