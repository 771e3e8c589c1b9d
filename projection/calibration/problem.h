// A calibration problem as model selection sees it: views that a model can be fitted to, and tested on.
#pragma once

#include "projection/calibration/model.h"

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::calibration {

using Views = std::vector<bool>; ///< which views take part

/// A model fitted to some views.
struct Fit {
    Model model;
    std::vector<double> nuisance = {}; ///< the problem's own unknowns (poses, points): where the next fit starts
    double rss = 0;                    ///< sum of squared residuals of the views used, in units of `unit()`
    int residuals = 0, unknowns = 0;   ///< how many of each; the problem's own unknowns count, too
    /// Covariance of the model's numbers, scaled by the residual variance; rows and columns of fixed numbers are 0.
    /// Empty when it was not asked for, or when the views do not determine the free numbers.
    Eigen::MatrixXd covariance = {};
    bool converged = false;
    Views used = {}; ///< the views it was fitted to

    [[nodiscard]] double sigma(Unknown unknown) const { return std::sqrt(covariance(unknown, unknown)); }
};

/// One view's residuals under a model.
struct ViewScore {
    double squared = 0; ///< sum
    int points = 0;
    /// Root of the mean squared distance, as OpenCV counts it: per point, not per coordinate.
    [[nodiscard]] double rms() const { return points > 0 ? std::sqrt(squared / points) : 0; }
};

/// Observations of a camera and what they say of a model.
class Problem {
  public:
    virtual ~Problem() = default;

    [[nodiscard]] virtual std::size_t views() const = 0;
    [[nodiscard]] virtual std::string view_name(std::size_t view) const = 0;
    /// The unit of residuals.
    [[nodiscard]] virtual std::string_view unit() const { return "px"; }
    /// Sets each view's weight, the factor on its residuals; 1 until set.
    virtual void set_weights(const std::vector<double>& weights) = 0;
    /// Fits the problem's own unknowns to the model as it is.
    [[nodiscard]] virtual Fit start(const Model& model) const = 0;
    /// Least squares over the views used, warm-started.
    [[nodiscard]] virtual Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const = 0;
    /// Each wanted view's residuals under the model; the view's own unknowns are fitted, the model's are not.
    [[nodiscard]] virtual std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const = 0;
    /// The pixels that a view has observed.
    [[nodiscard]] virtual std::vector<cv::Point2d> pixels_of(std::size_t view) const = 0;
    /// Predicted less observed pixel for each of them; empty where residuals are not of pixels.
    [[nodiscard]] virtual std::vector<Eigen::Vector2d> residuals(const Fit& fit, std::size_t view) const = 0;
    /// Depths of what was observed, metres, for the effect in millimetres.
    [[nodiscard]] virtual std::vector<double> depths_m(const Fit& fit) const = 0;
};

} // namespace scanshade::calibration
