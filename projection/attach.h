// AoMap -> one value per recorded pixel or point.
#pragma once

#include "projection/frame.h"
#include "projection/maps.h"

#include <vector>

namespace scanshade {

/// Visibility of the recorded pixels or points, and the share of the valid ones that received a value.
struct Attached {
    cv::Mat1f visibility; ///< per recorded pixel (distorted geometry) or point of an organised cloud's grid, NaN = no
                          ///< surface; of an unorganised cloud, the view it was seen in
    std::vector<float> per_point; ///< per point of frame.cloud, file order; NaN where unknown; empty without a cloud
    double coverage = 0; ///< points or pixels with a value / points or pixels with valid depth; 0 when none valid
    double mean_visibility = 0; ///< over the values attached; NaN when there are none
};

[[nodiscard]] Attached attach(const Frame& frame, const DepthImage& depth, const AoMap& ao);

/// Colour times visibility in linear light: srgb(linear(colour) * (1 - strength + strength * visibility)).
/// Pixels without a surface keep their colour. `colour` and `visibility` have the same size.
[[nodiscard]] cv::Mat3b shade(const cv::Mat3b& colour, const cv::Mat1f& visibility, double strength = 1.0);

} // namespace scanshade
