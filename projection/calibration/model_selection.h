// Model selection: a ladder of ever richer models, climbed only as far as the evidence carries.
#pragma once

#include "projection/calibration/problem.h"

namespace scanshade::calibration {

/// What became of one rung, and why.
struct Step {
    std::string name;
    bool climbed = false;
    std::string why; ///< "held-out error falls by 12 %, 41 sigma" or "not supported: 0.8 sigma"
};

struct LadderOptions {
    int folds = 5;           ///< of the views, held out in turn; fewer views, fewer folds
    double least_sigmas = 3; ///< a new number must be this far from where it was (a group: as unlikely as that)
    double most_inflation =
        2; ///< of the focal length's sigma, the principal point's, and the pixel's sigma over the image
    double worst_condition = 1e7; ///< of the free numbers' correlation matrix
    double enough_px = 1e-3;      ///< an error below this needs no better model
    bool guessed = false;         ///< the first camera is a guess: its focal length holds no information to keep
};

struct Climb {
    Fit start, fit;          ///< before and after; `fit` with covariance
    Free free{};             ///< what was climbed
    std::vector<Step> steps; ///< in the order tried, the last word on each rung
    double train_px = 0, train_before_px = 0, held_out_px = 0, held_out_before_px = 0; ///< rms over the views used
    /// Nothing was climbed: the input stays as it is.
    [[nodiscard]] bool unchanged() const;
};

/// Climbs warm-started from `start` over the views used. A rung is climbed only if BIC falls, each new number (jointly,
/// for a pair) is least_sigmas from its value at the start (where it has a rival, also with that one free), sigmas do
/// not inflate, the lens stays monotone to the image's corners, the normal matrix stays well-conditioned, and the error
/// of held-out views falls by more than its standard error. Rungs that failed are tried again once others were climbed;
/// what no longer stands at the end is taken back.
[[nodiscard]] Climb climb(const Evidence& evidence, const Fit& start, const std::vector<Rung>& rungs, const Views& used,
                          const LadderOptions& options = {});

/// All rungs at once, no questions asked: what a full model would give, for comparison.
[[nodiscard]] Climb climb_all(const Evidence& evidence, const Fit& start, const std::vector<Rung>& rungs,
                              const Views& used, const LadderOptions& options = {});

} // namespace scanshade::calibration
