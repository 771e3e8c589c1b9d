// A look at a few of a capture's frames before the walk begins: its noise and the size of its scene are measured there.
#pragma once

#include "apps/frame/frame_options.h"
#include "io/captures/capture.h"
#include "projection/project.h"

#include <cstddef>
#include <limits>
#include <vector>

namespace scanshade {

/// Depth images of up to five of the frames, spread evenly; empty ones of frames that cannot be loaded, and of clouds
/// without a grid, which are no sensor's image: but, with `one_view`, those that is_one_view() tells. `kept`, if given,
/// receives the frames, with their colour if `with_colour`. Of several clouds without a grid it keeps none, since they
/// may be large. Clouds without a grid of more than `most_points` are not looked at, if they are computed from disk.
[[nodiscard]] std::vector<DepthImage> first_look(const Capture& capture, const std::vector<std::size_t>& frames,
                                                 LoadedFrames* kept = nullptr, bool with_colour = false,
                                                 std::size_t most_points = std::numeric_limits<std::size_t>::max(),
                                                 bool one_view = false);

} // namespace scanshade
