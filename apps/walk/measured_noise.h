// The noise of a capture's depth, measured on a few of its frames before the walk begins.
#pragma once

#include "io/captures/capture.h"
#include "projection/noise.h"

#include <string>
#include <vector>

namespace scanshade {

/// sigma(z) of a capture, measured on up to five of the frames. No noise for clouds without a grid, which no sensor's
/// image backs. Frames that cannot be loaded are left out.
[[nodiscard]] DepthNoise noise_of(const Capture& capture, const std::vector<std::size_t>& frames);
/// `text` is "auto" (measured) or as noise_from_text() takes it.
[[nodiscard]] DepthNoise noise_of(const Capture& capture, const std::vector<std::size_t>& frames,
                                  const std::string& text);

/// `count` of `total` indices, spread evenly from the first on.
[[nodiscard]] std::vector<std::size_t> spread(std::size_t count, std::size_t total);

} // namespace scanshade
