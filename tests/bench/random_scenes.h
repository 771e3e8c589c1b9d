// Random rooms, bodies, things on the ground and hills: scenes of which no two are alike, for fits that must hold
// anywhere.
#pragma once

#include "apps/scenes/world/scene.h"

#include <string_view>

namespace scanshade::bench {

/// Names of the kinds: room, body, things, hills.
[[nodiscard]] std::vector<std::string_view> random_kinds();

/// A scene of a kind; the same seed gives the same one. Its walk stays where nothing stands.
/// room: 2.2 to 9 m wide, nearly empty to crowded. body: a few solids grown together, 0.1 to 3 m large, seen from all
/// round. things: such bodies on a ground that ends. hills: relief, with bushes and blocks, seen from above. Throws
/// Misuse listing the kinds.
[[nodiscard]] scene::Scene random_scene(std::string_view kind, int seed);

} // namespace scanshade::bench
