// Furniture and the like, which several scenes are furnished with.
#pragma once

#include "apps/scenes/parts.h"

namespace scanshade::scene {

void add_table(Bodies& bodies, const Place& at, double width, double depth, double height);
/// A wooden chair with a back of spindles, its front towards -y.
void add_chair(Bodies& bodies, const Place& at, double spindle_radius = 0.008);
/// Boards between two sides, each bearing what dice put there.
void add_shelf(Bodies& bodies, const Place& at, double width, double height, int levels, Dice& dice);
/// Posts and rails along a line, with a handrail; `pitch` between the posts.
void add_railing(Bodies& bodies, const Vector3d& from, const Vector3d& to, double height, double pitch, double radius);
/// A column radiator on short feet.
void add_radiator(Bodies& bodies, const Place& at, int columns);
void add_pot_plant(Bodies& bodies, const Vector3d& foot, double size, Dice& dice);
/// Leaning against a wall towards +y.
void add_bicycle(Bodies& bodies, const Place& at);

} // namespace scanshade::scene
