// Heaps of boxes, balls, cans and bowls, as in store rooms.
#pragma once

#include "apps/scenes/places/parts.h"

namespace scanshade::scene {

/// Drops `count` objects at random positions of the floor's rectangle from `low` to `high`, the largest first. Sizes
/// shrink evenly from `largest` to `smallest`.
void drop_many(Bodies& bodies, const Vector2d& low, const Vector2d& high, double floor_z, int count, double smallest,
               double largest, Random& random);

} // namespace scanshade::scene
