// What a refinement found, whatever it was found from: cameras before and after, how sure, and what was wrong with the
// data.
#pragma once

#include "projection/calibration/model_selection.h"
#include "projection/calibration/quality.h"

#include <optional>

namespace scanshade::calibration {

enum class Outliers { keep, downweight, drop };
enum class ModelChoice { ladder, full };

struct RefineOptions {
    LadderOptions ladder;
    Outliers outliers = Outliers::keep;
    ModelChoice model = ModelChoice::ladder;
};

/// One view's row in the report.
struct ViewRow {
    std::string name;
    ViewScore score; ///< under the refined camera
    bool outlying = false, used = true;
    double weight = 1;
};

struct Refinement {
    std::string source; ///< "chessboard of 9x6 corners, 25 mm, in 13 images"
    std::string unit;   ///< of its errors: px, or mm of depth
    Camera before, after;
    Climb climb;
    std::optional<Climb> full; ///< the full model on the same views, for comparison
    std::vector<ViewRow> views;
    std::vector<std::pair<cv::Point2d, Eigen::Vector2d>> residuals; ///< of the views used: where, and predicted - seen
    Coverage coverage;
    cv::Mat1d pixel_sigma;          ///< pixels, over the image
    std::vector<Effect> effects;    ///< of the change, at the scene's depths
    std::vector<std::string> notes; ///< what was odd, what could not be determined; sentences

    [[nodiscard]] bool changed() const { return !climb.unchanged(); }
};

/// Climbs the ladder (or takes the full model) on the evidence. Views with more than 3 times the median error are
/// outlying: they are kept, weighed down to the median's error, or dropped, and the climb repeated. `cannot` is why the
/// evidence determines nothing, if it does not: then nothing is climbed, and a guessed camera is an Error.
[[nodiscard]] Refinement refine(Evidence& evidence, const Camera& before, const std::vector<Rung>& rungs,
                                const RefineOptions& options, const std::string& cannot);
/// The same where more than the camera is known before: its depth correction, its place. `before` is `first`'s camera
/// with its origin.
[[nodiscard]] Refinement refine(Evidence& evidence, const Model& first, const Camera& before,
                                const std::vector<Rung>& rungs, const RefineOptions& options,
                                const std::string& cannot);

} // namespace scanshade::calibration
