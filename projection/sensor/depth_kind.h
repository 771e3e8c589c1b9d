// What kind of number a depth image holds, told by the planes in it: depth along z, distance, or an inverse of depth.
#pragma once

#include "projection/maps.h"

namespace scanshade {

enum class DepthKind {
    unknown,
    z,
    range,  ///< distances from the camera's centre: planes read as z bulge towards the camera
    inverse ///< disparities, or other numbers that are linear in 1 / z and larger where a surface is nearer
};

/// By how patches of the image bend. Along a plane 1 / z is linear in the pixel; each kind makes another bend of it,
/// whatever the unit. Patches that are not even, or whose noise hides the bend, have no say. `unknown` where few
/// patches can tell, or where they disagree: surfaces bend, too, but not alike everywhere.
/// What speaks against z must lie on planes that go on elsewhere. Ramps of one slope are unknown, too: disparities of a
/// single plane, or depth that somebody drew; and ranges of one plane, which look like a ball. Range needs a right
/// camera.
[[nodiscard]] DepthKind depth_kind(const DepthImage& depth);

} // namespace scanshade
