// How good a calibration is: coverage of the image, uncertainty of pixels, and the change in millimetres.
#pragma once

#include "projection/calibration/problem.h"

namespace scanshade::calibration {

/// Counts of observations in cells of the image, and their share of cells with any.
struct Coverage {
    cv::Mat1i counts; ///< 6 rows of 8 cells
    double share = 0;
};
[[nodiscard]] Coverage coverage_of(const std::vector<cv::Point2d>& pixels, cv::Size size);

/// One standard deviation of the pixel that a direction projects to, over a grid of the image (pixels, both axes
/// together). The model's covariance is propagated through the projection. What a rotation of the whole camera
/// compensates is left out, since it changes no shape (after mrcal's projection uncertainty). 0 where nothing was free,
/// NaN beyond the lens.
[[nodiscard]] cv::Mat1d pixel_sigmas(const Fit& fit, cv::Size cells = {9, 7});
[[nodiscard]] double mean_pixel_sigma(const Fit& fit);

/// Whether the lens maps wider angles to larger radii, out to the image's corners.
[[nodiscard]] bool monotone(const Model& model);

/// How far the surface point behind a pixel moves from one camera to the other, at a depth. The best common rotation is
/// left out.
struct Effect {
    double depth_m = 0, rms_mm = 0, worst_mm = 0;
};
[[nodiscard]] Effect effect_at(const Camera& before, const Camera& after, double depth_m);
/// At the 10th, 50th and 90th percentile of the depths; empty where there are none.
[[nodiscard]] std::vector<Effect> effects(const Camera& before, const Camera& after, std::vector<double> depths_m);

/// Sigma of fy, which the model stores as f times aspect.
[[nodiscard]] double sigma_fy(const Fit& fit);

} // namespace scanshade::calibration
