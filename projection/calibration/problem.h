// A source of evidence about a camera, as the ladder sees it: views that a model can be fitted to, and tested on.
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
    std::vector<double> nuisance = {}; ///< the evidence's own unknowns (poses, landmarks): where the next fit starts
    double rss = 0;                    ///< sum of squared residuals of the views used, in units of `unit()`
    int residuals = 0, unknowns = 0;   ///< how many of each; unknowns count the evidence's own, too
    /// Of the model's numbers; rows and columns of frozen ones are 0. Scaled by the residual variance.
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

class Evidence {
  public:
    virtual ~Evidence() = default;

    [[nodiscard]] virtual std::size_t views() const = 0;
    [[nodiscard]] virtual std::string view_name(std::size_t view) const = 0;
    /// What residuals are counted in.
    [[nodiscard]] virtual std::string_view unit() const { return "px"; }
    /// How much each view counts from now on, as the factor on its residuals; 1 until set.
    virtual void weigh(const std::vector<double>& weights) = 0;
    /// Nothing free yet: the evidence's own unknowns fitted to the model as it is.
    [[nodiscard]] virtual Fit start(const Model& model) const = 0;
    /// Least squares over the views used, warm-started.
    [[nodiscard]] virtual Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const = 0;
    /// Each marked view's residuals under the model; the view's own unknowns are fitted, the model's are not.
    [[nodiscard]] virtual std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const = 0;
    /// Where in the image a view saw something, and by how much the model misses it there (predicted - seen), pixels;
    /// no residuals where they are not of pixels.
    [[nodiscard]] virtual std::vector<cv::Point2d> pixels_of(std::size_t view) const = 0;
    [[nodiscard]] virtual std::vector<Eigen::Vector2d> residuals(const Fit& fit, std::size_t view) const = 0;
    /// Depths of what was seen, metres, for the effect in millimetres.
    [[nodiscard]] virtual std::vector<double> depths_m(const Fit& fit) const = 0;
};

} // namespace scanshade::calibration
