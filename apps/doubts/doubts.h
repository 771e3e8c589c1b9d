// Reasons to doubt a result: what is implausible about a camera, a depth image, a cloud, or the values computed of
// them.
#pragma once

#include "ao/frame.h"
#include "projection/base/finding.h"
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

/// What speaks for and against a computed frame, its camera and its settings. Real captures are far from every limit;
/// checks.h has the table. The frame's own findings come first.
/// `noise`: of the depth, where it is an image. `unit`: of the capture, in which the sentences tell lengths.
[[nodiscard]] Findings findings_about(const ComputedFrame& computed, double radius_m, const DepthNoise& noise = {},
                                      const LengthUnit& unit = {});

/// Before anything is computed: about a camera, and about a depth image that it took.
[[nodiscard]] Findings findings_about(const Camera& camera, const DepthImage& depth, const LengthUnit& unit = {});

} // namespace scanshade
