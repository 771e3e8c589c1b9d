// The error to expect of each visibility, from what its pixel shows; and the confidence that follows from it.
#pragma once

#include "projection/maps.h"
#include "projection/sensor/noise.h"
#include "shaders/shared/expected_error.h"

#include <array>
#include <functional>
#include <span>
#include <vector>

namespace scanshade {

/// What tells of the error of a visibility, whatever the method.
struct ErrorSigns {
    /// Share of the ball's image that has depth and is not hidden by something in front of the ball, in steps of 1/16.
    /// Occluders outside the image, in a hole, or behind something near are unknown.
    float seen = 0;
    int edge = 0;    ///< of the rings around it, the nearest with a jump of depth; shared::error_rings = none
    int hole = 0;    ///< the nearest with a hole; likewise. Outside the image is no hole
    float reach = 0; ///< the radius in the image, pixels
    float noise = 0; ///< sigma(z) / radius
};

/// Of every pixel with a visibility, `found(v, u, signs)` is called. Pixels without visibility count as holes. Throws
/// Error where the sizes differ. Works on rows in parallel.
void for_each_sign(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m, const DepthNoise& noise,
                   const std::function<void(int, int, const ErrorSigns&)>& found);

/// Which factors of a table apply, and by which weight: the squared error is 2^sum(weight factor).
struct ErrorWeights {
    static constexpr std::size_t count = 10;
    std::array<int, count> factor;
    std::array<float, count> weight;
};
[[nodiscard]] ErrorWeights weights_of(const ErrorSigns& signs, float visibility);
/// RMS of visibility, 0 .. 1.
[[nodiscard]] float expected_error(const ErrorWeights& weights, const shared::ErrorTable& table);

/// Expected error of each pixel: RMS of visibility, 0 .. 1; NaN where `visibility` is NaN.
[[nodiscard]] cv::Mat1f expected_error_of(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m,
                                          const DepthNoise& noise, const shared::ErrorTable& table);

/// The RMS of these errors by an even sample of the pixels: quick, and within about 1 %. Errors above 0.3 count as
/// 0.3. NaN where no pixel has a visibility.
[[nodiscard]] double expected_rms_of(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m,
                                     const DepthNoise& noise, const shared::ErrorTable& table);

/// 1 - error / 0.3, at least 0: 1 = exact, 0.5 = off by 0.15, 0 = off by 0.3 and more. NaN stays NaN.
[[nodiscard]] float confidence_from(float expected_error);
[[nodiscard]] cv::Mat1f confidence_from(const cv::Mat1f& expected_error);
/// Of points, which have a confidence of 0 where nothing is known.
[[nodiscard]] std::vector<float> confidence_of_points(std::span<const float> expected_error);

/// Those positions on the unit disc, evenly spread: a sunflower's seeds (Vogel 1979).
[[nodiscard]] const std::array<cv::Point2f, shared::ball_seeds>& seeds_of_ball();

} // namespace scanshade
