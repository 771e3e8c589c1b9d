// The table of scenes.
#include "apps/scenes/scenes.h"

#include "projection/error.h"

#include <fmt/format.h>

namespace scanshade::scene {

const std::vector<Scene>& scenes() {
    static const std::vector<Scene> table{office(), staircase(), columns(), clutter(), outdoor(), thin()};
    return table;
}

const Scene& scene_named(std::string_view name) {
    std::string names;
    for (const Scene& scene : scenes()) {
        if (scene.name == name)
            return scene;
        names += fmt::format("{}{}", names.empty() ? "" : ", ", scene.name);
    }
    throw Misuse(fmt::format("no scene '{}', there are: {}", name, names));
}

} // namespace scanshade::scene
