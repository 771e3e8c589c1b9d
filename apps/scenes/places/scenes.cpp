// The table of scenes.
#include "apps/scenes/places/scenes.h"

#include "projection/base/named.h"

namespace scanshade::scene {

const std::vector<Scene>& scenes() {
    static const std::vector<Scene> table{office(), staircase(), columns(), clutter(), outdoor(),
                                          thin(),   kitchen(),   attic(),   library()};
    return table;
}

const Scene& scene_named(std::string_view name) { return one_named(scenes(), name, "scene"); }

} // namespace scanshade::scene
