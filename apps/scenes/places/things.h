// Furniture that several scenes share.
#pragma once

#include "apps/scenes/places/parts.h"

namespace scanshade::scene {

void add_table(Bodies& bodies, const LocalFrame& at, double width, double depth, double height);
/// A wooden chair with a back of spindles, its front towards -y.
void add_chair(Bodies& bodies, const LocalFrame& at, double spindle_radius = 0.008);
/// Boards between two sides, with random objects on each board.
void add_shelf(Bodies& bodies, const LocalFrame& at, double width, double height, int levels, Random& random);
/// Posts and rails along a line, with a handrail. `pitch` is the distance between posts.
void add_railing(Bodies& bodies, const Vector3d& from, const Vector3d& to, double height, double pitch, double radius);
/// A column radiator on short feet.
void add_radiator(Bodies& bodies, const LocalFrame& at, int columns);
void add_pot_plant(Bodies& bodies, const Vector3d& foot, double size, Random& random);
/// It leans against a wall towards +y.
void add_bicycle(Bodies& bodies, const LocalFrame& at);

} // namespace scanshade::scene
