// Heaps of boxes, balls, cans and bowls, as they lie in store rooms.
#pragma once

#include "apps/scenes/parts.h"

namespace scanshade::scene {

/// Lets `count` things fall on the floor's rectangle from `low` to `high`, at random but the largest first; sizes
/// shrink evenly from `largest` to `smallest`.
void drop_many(Bodies& bodies, const Vector2d& low, const Vector2d& high, double floor_z, int count, double smallest,
               double largest, Dice& dice);

} // namespace scanshade::scene
