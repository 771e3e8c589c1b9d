// Reasons to doubt a result: what is implausible about a camera, a depth image, a cloud, or the values computed of
// them.
#pragma once

#include "ao/frame.h"
#include "projection/frame.h"
#include "projection/length_unit.h"
#include "projection/sensor/noise.h"

#include <string>
#include <vector>

namespace scanshade {

/// What a computed frame is judged by.
struct ComputedFrame {
    const Frame& frame; ///< as recorded, with doubts of its own
    const Camera& camera;
    double valid_share = 0;                     ///< of the pixels or points, those with a depth or position; 0 .. 1
    double coverage = 0;                        ///< of these, the ones with a value; 0 .. 1
    const DepthImage& depth;                    ///< of a view
    const cv::Mat1f& visibility;                ///< of a view
    const PointVisibility* of_points = nullptr; ///< by rays from every point; null = of a view
};

/// Sentences: what is implausible about a computed frame, its camera or its settings. Empty = nothing is. Real captures
/// are far from every limit; README.md has the table.
/// `noise`: of the depth, where it is an image. `unit`: of the capture, in which the sentences tell lengths.
[[nodiscard]] std::vector<std::string> doubts_about(const ComputedFrame& computed, double radius_m,
                                                    const DepthNoise& noise = {}, const LengthUnit& unit = {});

/// What is implausible before anything is computed: about a camera, and about a depth image that it took.
[[nodiscard]] std::vector<std::string> doubts_about(const Camera& camera, const DepthImage& depth,
                                                    const LengthUnit& unit = {});

} // namespace scanshade
