// One refinement of a calibration problem: cameras before and after, their uncertainty, and notes about the data.
#pragma once

#include "projection/calibration/model_selection.h"
#include "projection/calibration/quality.h"

#include <optional>

namespace scanshade::calibration {

enum class Outliers { keep, downweight, drop };
enum class ModelChoice { selected, full };

struct RefineOptions {
    SelectionOptions selection;
    Outliers outliers = Outliers::keep;
    ModelChoice model = ModelChoice::selected;
    // Sentences for people.
    std::string what_helps = {};       ///< how to get observations that tell more
    std::string what_contradicts = {}; ///< where views that contradict each other come from
};

/// One view's row in the report.
struct ViewRow {
    std::string name;
    ViewScore score; ///< under the refined camera
    bool outlying = false, used = true;
    double weight = 1;
};

struct Refinement {
    std::string source;                       ///< "chessboard of 9x6 corners, 25 mm, in 13 images"
    std::string unit;                         ///< of its errors: px, or mm of depth
    std::string what_helps, what_contradicts; ///< as RefineOptions has them
    Camera before, after;
    Selection selection;
    std::optional<Selection> full; ///< the full model on the same views, for comparison
    std::vector<ViewRow> views;
    std::vector<std::pair<cv::Point2d, Eigen::Vector2d>>
        residuals; ///< of the views used: pixel, and predicted - observed
    Coverage coverage;
    cv::Mat1d pixel_sigma;          ///< pixels, over the image
    std::vector<Effect> effects;    ///< of the change, at the scene's depths
    std::vector<std::string> notes; ///< sentences about oddities and about what could not be determined

    [[nodiscard]] bool changed() const { return !selection.unchanged(); }
};

/// Selects a model (or takes the full one) for the problem. Views with more than 3 times the median error are outlying:
/// they are kept, downweighted to the median's error, or dropped; the last two repeat the selection. `degeneracy` is
/// why the observations determine nothing, empty where they do. Nothing is freed then, and a guessed camera is an
/// Error.
[[nodiscard]] Refinement refine(Problem& problem, const Camera& before, const std::vector<ParameterGroup>& groups,
                                const RefineOptions& options, const std::string& degeneracy);
/// The same where more than the camera is known before: its depth correction, its extrinsics. `before` is the camera of
/// `first`, with its origin.
[[nodiscard]] Refinement refine(Problem& problem, const Model& first, const Camera& before,
                                const std::vector<ParameterGroup>& groups, const RefineOptions& options,
                                const std::string& degeneracy);

} // namespace scanshade::calibration
