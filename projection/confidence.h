// How far a visibility can be believed: from what the camera saw of the ball around each pixel's point, whatever the
// method.
#pragma once

#include "projection/maps.h"
#include "projection/noise.h"

namespace scanshade {

/// Confidence of each pixel's visibility, 0 .. 1; NaN where `visibility` is NaN. The product of three shares:
/// - seen: of the image of the ball of that radius around the point, the part with depth that is not hidden by
/// something in
///   front of the ball. What lies outside the image, in a hole, or behind something near might occlude or not;
/// - resolved: none where the radius shows as one pixel or less, all of it from three pixels on;
/// - told from noise: 1 - 3 sigma(z) / radius, at least 0.
/// `depth` and `visibility` have the same size; pixels without visibility count as holes. 16 places are looked at per
/// pixel, so that steps of a sixteenth are to be expected.
[[nodiscard]] cv::Mat1f confidence_of(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m,
                                      const DepthNoise& noise);

} // namespace scanshade
