// After a frame is computed: the reasons to doubt its result.
#pragma once

#include "apps/walk/work.h"
#include "projection/noise.h"

#include <string>
#include <vector>

namespace scanshade {

/// Sentences: what is implausible about a computed frame, its camera or its settings. Empty = nothing is. Reads
/// `row.valid_share` and `row.coverage`. Real captures are far from every limit; README.md has the table.
/// `noise`: of the depth, where it is an image. `unit`: of the capture, in which the sentences tell lengths.
[[nodiscard]] std::vector<std::string> doubts_about(const Work& work, double radius_m, const DepthNoise& noise = {},
                                                    const LengthUnit& unit = {});

/// What is implausible before anything is computed: about a camera, and about a depth image that it took.
[[nodiscard]] std::vector<std::string> doubts_about(const Camera& camera, const DepthImage& depth,
                                                    const LengthUnit& unit = {});

} // namespace scanshade
