// Published numbers of common data sets' and devices' cameras, by name.
#pragma once

#include "projection/camera.h"

#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// The camera of that name, its origin saying whose numbers they are; none where the name is not known.
[[nodiscard]] std::optional<Camera> known_camera(const std::string& name);
[[nodiscard]] std::vector<std::string> known_camera_names();

} // namespace scanshade
