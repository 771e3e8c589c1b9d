// The noise of a capture's depth, measured on a few of its frames before the walk begins.
#pragma once

#include "io/captures/capture.h"
#include "projection/noise.h"

#include <cstddef>
#include <limits>
#include <map>
#include <string>
#include <vector>

namespace scanshade {

/// Frames that were decoded before the walk began, so that it need not decode them again.
struct LoadedFrame {
    Frame frame;
    double took_ms = 0;
};
using LoadedFrames = std::map<std::size_t, LoadedFrame>; ///< by index in the capture

/// sigma(z) of a capture, measured on up to five of the frames. Clouds without a grid are not a sensor's image, and
/// have no noise. Frames that cannot be loaded are left out. `kept`, if given, receives the frames, with their colour
/// if `with_colour`. Of several clouds without a grid it keeps none, since they may be large.
/// Clouds without a grid of more than `most_points` are not looked at, if they are computed from disk.
[[nodiscard]] DepthNoise noise_of(const Capture& capture, const std::vector<std::size_t>& frames,
                                  LoadedFrames* kept = nullptr, bool with_colour = false,
                                  std::size_t most_points = std::numeric_limits<std::size_t>::max());

} // namespace scanshade
