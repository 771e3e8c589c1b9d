// One refinement from evidence to findings: climb, outlying views, coverage, effect.
#include "projection/calibration/refinement.h"

#include "projection/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade::calibration {
namespace {

constexpr double outlying_ratio = 3;

double median(std::vector<double> values) {
    if (values.empty())
        return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

std::vector<ViewRow> rows_of(const Evidence& evidence, const Fit& fit) {
    const std::vector<ViewScore> scores = evidence.score(fit, Views(evidence.views(), true));
    std::vector<ViewRow> rows;
    std::vector<double> errors;
    for (std::size_t i = 0; i < scores.size(); ++i) {
        rows.push_back({evidence.view_name(i), scores[i]});
        if (scores[i].points > 0)
            errors.push_back(scores[i].rms());
    }
    const double usual = median(errors);
    for (ViewRow& row : rows) {
        row.outlying = row.score.rms() > outlying_ratio * usual;
        row.weight = row.outlying ? usual / row.score.rms() : 1;
    }
    return rows;
}

Climb climbed(const Evidence& evidence, const Fit& start, const std::vector<Rung>& rungs, const Views& used,
              const RefineOptions& options) {
    return options.model == ModelChoice::full ? climb_all(evidence, start, rungs, used, options.ladder)
                                              : climb(evidence, start, rungs, used, options.ladder);
}

std::string names_of_outlying(const std::vector<ViewRow>& rows, const std::string& unit) {
    std::vector<std::string> names;
    for (const ViewRow& row : rows)
        if (row.outlying)
            names.push_back(fmt::format("{} ({:.2f} {})", row.name, row.score.rms(), unit));
    constexpr std::size_t most = 10;
    const std::string more = names.size() > most ? fmt::format(" and {} more", names.size() - most) : "";
    names.resize(std::min(names.size(), most));
    return fmt::format("{}{}", fmt::join(names, ", "), more);
}

} // namespace

Refinement refine(Evidence& evidence, const Camera& before, const std::vector<Rung>& rungs,
                  const RefineOptions& options, const std::string& cannot) {
    return refine(evidence, model_of(before), before, rungs, options, cannot);
}

Refinement refine(Evidence& evidence, const Model& first, const Camera& before, const std::vector<Rung>& rungs,
                  const RefineOptions& options, const std::string& cannot) {
    if (!cannot.empty() && options.ladder.guessed)
        throw Error("no camera can be found: " + cannot);
    Refinement result;
    result.before = before;
    result.unit = evidence.unit();
    Views used(evidence.views(), true);
    const Fit start = evidence.start(first);
    if (!cannot.empty()) {
        result.notes.push_back("nothing is determined: " + cannot + ".");
        result.climb = climb(evidence, start, {}, used, options.ladder);
        result.views = rows_of(evidence, result.climb.fit);
    } else {
        result.climb = climbed(evidence, start, rungs, used, options);
        result.views = rows_of(evidence, result.climb.fit);
        const auto outlying =
            std::count_if(result.views.begin(), result.views.end(), [](const auto& v) { return v.outlying; });
        if (outlying > 0) {
            const char* done = options.outliers == Outliers::keep   ? "kept; --outliers downweight or drop"
                               : options.outliers == Outliers::drop ? "dropped"
                                                                    : "weighed down to the median's error";
            result.notes.push_back(fmt::format("outlying views, more than {:.0f} times the median error: {}; {}.",
                                               outlying_ratio, names_of_outlying(result.views, result.unit), done));
        }
        if (outlying > 0 && options.outliers != Outliers::keep) {
            std::vector<double> weights(result.views.size(), 1.0);
            for (std::size_t i = 0; i < result.views.size(); ++i) {
                used[i] = !(result.views[i].outlying && options.outliers == Outliers::drop);
                weights[i] = options.outliers == Outliers::downweight ? result.views[i].weight : 1;
            }
            evidence.weigh(weights);
            const std::vector<ViewRow> all = result.views;
            result.climb = climbed(evidence, start, rungs, used, options);
            result.views = rows_of(evidence, result.climb.fit);
            for (std::size_t i = 0; i < all.size(); ++i) {
                result.views[i].outlying = all[i].outlying;
                result.views[i].weight = weights[i];
                result.views[i].used = used[i];
            }
        }
        if (options.model != ModelChoice::full)
            result.full = climb_all(evidence, result.climb.fit, rungs, used, options.ladder);
    }
    if (options.ladder.guessed && !result.climb.free[f])
        throw Error("no camera can be found: " + result.climb.steps.front().why);
    result.after = result.changed() ? camera_of(result.climb.fit.model, "refined") : before;
    std::vector<cv::Point2d> seen;
    for (std::size_t i = 0; i < evidence.views(); ++i) {
        if (!used[i])
            continue;
        const std::vector<cv::Point2d> pixels = evidence.pixels_of(i);
        const std::vector<Eigen::Vector2d> residuals = evidence.residuals(result.climb.fit, i);
        for (std::size_t point = 0; point < pixels.size(); ++point) {
            seen.push_back(pixels[point]);
            if (point < residuals.size())
                result.residuals.emplace_back(pixels[point], residuals[point]);
        }
    }
    result.coverage = coverage_of(seen, before.pinhole.size);
    result.pixel_sigma = pixel_sigmas(result.climb.fit);
    const auto& free = result.climb.free;
    const bool of_camera = std::any_of(free.begin(), free.begin() + camera_unknowns, [](bool open) { return open; });
    if (of_camera && !options.ladder.guessed) // a change from a guess says nothing
        result.effects = effects(before, result.after, evidence.depths_m(result.climb.fit));
    return result;
}

} // namespace scanshade::calibration
