// Before the walk: whether a recording's depths fit its poses.
#pragma once

#include "io/captures/capture.h"

#include <cstddef>
#include <string>
#include <vector>

namespace scanshade {

/// A sentence if pairs of the frames agree that all depths are too long or too short for the poses' motion, or that the
/// poses must be read in another way. Empty where they are right, where there are none, and where nothing can be told.
/// Decodes up to six depth images.
[[nodiscard]] std::string pose_warning(const Capture& capture, const std::vector<std::size_t>& frames);

} // namespace scanshade
