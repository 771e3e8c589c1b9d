// One refinement from observations to findings: model selection, outlying views, coverage, effect.
#include "projection/calibration/refinement.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade::calibration {
namespace {

constexpr double outlying_ratio = 3;

std::vector<ViewRow> rows_of(const Problem& problem, const Fit& fit) {
    const std::vector<ViewScore> scores = problem.score(fit, Views(problem.views(), true));
    std::vector<ViewRow> rows;
    std::vector<double> errors;
    for (std::size_t i = 0; i < scores.size(); ++i) {
        rows.push_back({problem.view_name(i), scores[i]});
        if (scores[i].points > 0)
            errors.push_back(scores[i].rms());
    }
    const double typical = median(errors);
    for (ViewRow& row : rows) {
        row.outlying = row.score.rms() > outlying_ratio * typical;
        row.weight = row.outlying ? typical / row.score.rms() : 1;
    }
    return rows;
}

Selection selected(const Problem& problem, const Fit& start, const std::vector<ParameterGroup>& groups,
                   const Views& used, const RefineOptions& options) {
    return options.model == ModelChoice::full ? full_model(problem, start, groups, used, options.selection)
                                              : select_model(problem, start, groups, used, options.selection);
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

std::string why_not_free(Unknown unknown, const std::vector<ParameterGroup>& groups, const Selection& selection) {
    for (std::size_t i = 0; i < groups.size(); ++i)
        if (groups[i].unknowns.front() == unknown)
            return selection.steps[i].why;
    return "not asked for";
}

} // namespace

Refinement refine(Problem& problem, const Camera& before, const std::vector<ParameterGroup>& groups,
                  const RefineOptions& options, const std::string& degeneracy) {
    return refine(problem, model_of(before), before, groups, options, degeneracy);
}

Refinement refine(Problem& problem, const Model& first, const Camera& before, const std::vector<ParameterGroup>& groups,
                  const RefineOptions& options, const std::string& degeneracy) {
    if (!degeneracy.empty() && options.selection.guessed)
        throw Error(fmt::format("no camera can be found: {}. {}", degeneracy, options.what_helps));
    Refinement result;
    result.before = before;
    result.unit = problem.unit();
    result.what_helps = options.what_helps;
    result.what_contradicts = options.what_contradicts;
    Views used(problem.views(), true);
    const Fit start = problem.start(first);
    if (!degeneracy.empty()) {
        result.notes.push_back("nothing is determined: " + degeneracy + ".");
        result.selection = select_model(problem, start, {}, used, options.selection);
        result.views = rows_of(problem, result.selection.fit);
    } else {
        result.selection = selected(problem, start, groups, used, options);
        result.views = rows_of(problem, result.selection.fit);
        const auto outlying =
            std::count_if(result.views.begin(), result.views.end(), [](const auto& v) { return v.outlying; });
        if (outlying > 0) {
            const char* done = options.outliers == Outliers::keep   ? "kept; --outliers downweight or drop"
                               : options.outliers == Outliers::drop ? "dropped"
                                                                    : "downweighted to the median error";
            result.notes.push_back(fmt::format("outlying views, more than {:.0f} times the median error: {}; {}.",
                                               outlying_ratio, names_of_outlying(result.views, result.unit), done));
        }
        if (outlying > 0 && options.outliers != Outliers::keep) {
            std::vector<double> weights(result.views.size(), 1.0);
            for (std::size_t i = 0; i < result.views.size(); ++i) {
                used[i] = !(result.views[i].outlying && options.outliers == Outliers::drop);
                weights[i] = options.outliers == Outliers::downweight ? result.views[i].weight : 1;
            }
            problem.set_weights(weights);
            const std::vector<ViewRow> all = result.views;
            result.selection = selected(problem, start, groups, used, options);
            result.views = rows_of(problem, result.selection.fit);
            for (std::size_t i = 0; i < all.size(); ++i) {
                result.views[i].outlying = all[i].outlying;
                result.views[i].weight = weights[i];
                result.views[i].used = used[i];
            }
        }
        if (options.model != ModelChoice::full)
            result.full = full_model(problem, result.selection.fit, groups, used, options.selection);
    }
    if (options.selection.guessed && !result.selection.free[f])
        throw Error(fmt::format("no camera can be found, since the focal length is {}. {} A first camera (--camera) "
                                "stays where the views cannot better it.",
                                why_not_free(f, groups, result.selection), options.what_helps));
    result.after = result.changed() ? camera_of(result.selection.fit.model, "refined") : before;
    std::vector<cv::Point2d> observed;
    for (std::size_t i = 0; i < problem.views(); ++i) {
        if (!used[i])
            continue;
        const std::vector<cv::Point2d> pixels = problem.pixels_of(i);
        const std::vector<Eigen::Vector2d> residuals = problem.residuals(result.selection.fit, i);
        for (std::size_t point = 0; point < pixels.size(); ++point) {
            observed.push_back(pixels[point]);
            if (point < residuals.size())
                result.residuals.emplace_back(pixels[point], residuals[point]);
        }
    }
    result.coverage = coverage_of(observed, before.pinhole.size);
    result.pixel_sigma = pixel_sigmas(result.selection.fit);
    const auto& free = result.selection.free;
    const bool camera_changed =
        std::any_of(free.begin(), free.begin() + camera_unknowns, [](bool open) { return open; });
    if (camera_changed && !options.selection.guessed) // a change from a guess says nothing
        result.effects = effects(before, result.after, problem.depths_m(result.selection.fit));
    return result;
}

} // namespace scanshade::calibration
