// The scenes, one per file, and their table. Rooms are made of furniture, furniture of parts.
#pragma once

#include "apps/scenes/world/scene.h"

namespace scanshade::scene {

/// The table of scenes.
[[nodiscard]] const std::vector<Scene>& scenes();
/// Throws Misuse listing the known names.
[[nodiscard]] const Scene& scene_named(std::string_view name);

/// A room of 4.2 x 5.2 x 2.6 m with furniture against its walls and objects on the floor.
[[nodiscard]] Scene office();
/// A stairwell of 5 x 6.5 x 5.6 m: two flights with a landing, and objects stored below and beside them.
[[nodiscard]] Scene staircase();
/// A hall of 8 x 13 x 6 m with two arcades, niches, a coffered ceiling and fallen stones.
[[nodiscard]] Scene columns();
/// A store room of 4.6 x 5.4 x 2.7 m with shelves, a workbench and heaps of several hundred objects.
[[nodiscard]] Scene clutter();
/// A lane between houses, to 150 m.
[[nodiscard]] Scene outdoor();
/// A conservatory of 4.4 x 5 x 2.7 m whose objects are 5 to 20 mm thick.
[[nodiscard]] Scene thin();
/// A kitchen of 3.6 x 4.4 x 2.5 m with cupboards, some of them open, crowded worktops and a table. No method was fitted
/// to it.
[[nodiscard]] Scene kitchen();
/// An attic of 5 x 6 x 3 m under a pitched roof with rafters, crates and a chimney. No method was fitted to it.
[[nodiscard]] Scene attic();
/// A library of 3.8 x 4.8 x 2.7 m: books, masonry, slats and battens, as fine as what noise hides.
[[nodiscard]] Scene library();

} // namespace scanshade::scene
