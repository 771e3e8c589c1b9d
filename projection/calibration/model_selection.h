// Model selection: ever more parameter groups are freed, only as far as the observations support them.
#pragma once

#include "projection/calibration/problem.h"

#include <functional>
#include <optional>

namespace scanshade::calibration {

/// Whether one parameter group was freed, and why.
struct Step {
    std::string name;
    bool freed = false;
    std::string why; ///< "41.0 sigma, held-out error falls by ..." or "not supported: 0.8 sigma"
};

struct SelectionOptions {
    int folds = 5; ///< of the views, held out in turn; fewer views, fewer folds
    /// A new number must differ from its start by this much (a group by what is as unlikely as that).
    double least_sigmas = 3;
    /// Of the focal length's sigma, the principal point's, and the pixel's sigma over the image.
    double most_inflation = 2;
    double worst_condition = 1e7; ///< of the free numbers' correlation matrix
    double enough_px = 1e-3;      ///< an error below this needs no better model
    bool guessed = false;         ///< the first camera is a guess: its focal length holds no information to keep
    std::function<void(const std::string&)> say = {}; ///< takes each decision as it is made; none: nobody waits for it
};

struct Selection {
    Fit start, fit; ///< before and after; `fit` with covariance
    Free free{};    ///< which numbers were freed
    /// The last fit that had the focal length free, where it was not freed in the end: how sure the observations are of
    /// it all the same.
    std::optional<Fit> focal_length_free = {};
    std::vector<Step> steps; ///< in the order tried, the last decision on each group
    double train_px = 0, train_before_px = 0, held_out_px = 0, held_out_before_px = 0; ///< rms over the views used
    /// Nothing was freed: the input stays as it is.
    [[nodiscard]] bool unchanged() const;
};

/// Frees groups one after another, warm-started from `start`, over the views used. A group is freed only if
/// - BIC falls,
/// - its numbers differ from their start by least_sigmas (where it has a rival, also while that one is free),
/// - sigmas do not inflate,
/// - the lens stays monotone to the image's corners,
/// - the normal matrix stays well-conditioned,
/// - the error of held-out views falls by more than its standard error.
/// Rejected groups are tried again once others were freed. A group that is no longer significant at the end is fixed
/// again.
[[nodiscard]] Selection select_model(const Problem& problem, const Fit& start,
                                     const std::vector<ParameterGroup>& groups, const Views& used,
                                     const SelectionOptions& options = {});

/// All groups at once, without tests: what a full model would give, for comparison.
[[nodiscard]] Selection full_model(const Problem& problem, const Fit& start, const std::vector<ParameterGroup>& groups,
                                   const Views& used, const SelectionOptions& options = {});

} // namespace scanshade::calibration
