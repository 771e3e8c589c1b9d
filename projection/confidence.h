// The confidence of a visibility, for any method: how much of the ball around each point the camera saw.
#pragma once

#include "projection/maps.h"
#include "projection/noise.h"

#include <array>

namespace scanshade {

/// Confidence of each pixel's visibility, 0 .. 1; NaN where `visibility` is NaN. The product of three shares:
/// - seen: the part of the ball's image that has depth and is not hidden by something in front of the ball. Occluders
///   outside the image, in a hole, or behind something near are unknown;
/// - resolved: 0 where the radius is one pixel or less in the image, 1 from three pixels on;
/// - above noise: 1 - 3 sigma(z) / radius, at least 0.
/// `depth` and `visibility` have the same size; pixels without visibility count as holes. 16 positions are tested per
/// pixel, so values come in steps of 1/16.
[[nodiscard]] cv::Mat1f confidence_of(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m,
                                      const DepthNoise& noise);

/// Those positions on the unit disc, evenly spread: a sunflower's seeds (Vogel 1979).
[[nodiscard]] const std::array<cv::Point2f, 16>& confidence_seeds();

} // namespace scanshade
