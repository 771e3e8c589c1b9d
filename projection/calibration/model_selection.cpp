// The order in which groups are tried, the tests they must pass, and what is fixed again.
#include "projection/calibration/model_selection.h"

#include "projection/calibration/quality.h"
#include "projection/undistort.h"

#include <algorithm>
#include <Eigen/Dense>
#include <fmt/format.h>
#include <numeric>
#include <optional>
#include <utility>

namespace scanshade::calibration {
namespace {

/// Root of the mean squared point distance, all views together.
double total_rms(const std::vector<ViewScore>& scores) {
    ViewScore sum;
    for (const ViewScore& score : scores) {
        sum.squared += score.squared;
        sum.points += score.points;
    }
    return sum.rms();
}

/// Schwarz 1978, for Gaussian residuals of unknown variance.
double bic(const Fit& fit) {
    const double n = fit.residuals, tiny = 1e-30;
    return n * std::log(fit.rss / n + tiny) + fit.unknowns * std::log(n);
}

/// How many sigmas the new numbers are from the old ones. A pair counts as a single number that is as unlikely.
double sigmas_from(const Fit& fit, const Model& neutral, const std::vector<Unknown>& unknowns) {
    const auto count = static_cast<Eigen::Index>(unknowns.size());
    Eigen::VectorXd move(count);
    Eigen::MatrixXd covariance(count, count);
    for (Eigen::Index i = 0; i < count; ++i) {
        move(i) = fit.model[unknowns[i]] - neutral[unknowns[i]];
        for (Eigen::Index j = 0; j < count; ++j)
            covariance(i, j) = fit.covariance(unknowns[i], unknowns[j]);
    }
    const double chi2 = move.dot(covariance.ldlt().solve(move));
    // A pair's chi^2 exceeds x with probability exp(-x / 2); the deviate z of a single number with that probability is
    // z^2 = x - ln(pi z^2 / 2) to within 2 % beyond 2 sigma (Mills' ratio).
    if (count < 2 || chi2 < 4)
        return std::sqrt(std::max(0.0, chi2));
    double z2 = chi2;
    for (int i = 0; i < 20; ++i)
        z2 = std::max(1.0, chi2 - std::log(CV_PI * z2 / 2));
    return std::sqrt(z2);
}

/// Of the correlation matrix, so that units do not matter: 1 where nothing correlates.
double condition(const Fit& fit, const Free& free) {
    std::vector<int> open;
    for (int i = 0; i < unknown_count; ++i)
        if (free[i])
            open.push_back(i);
    const auto count = static_cast<Eigen::Index>(open.size());
    if (count < 2)
        return 1;
    Eigen::MatrixXd correlation(count, count);
    for (Eigen::Index i = 0; i < count; ++i)
        for (Eigen::Index j = 0; j < count; ++j)
            correlation(i, j) = fit.covariance(open[i], open[j]) /
                                std::sqrt(fit.covariance(open[i], open[i]) * fit.covariance(open[j], open[j]));
    const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(correlation).eigenvalues();
    return values(0) > 0 ? values(count - 1) / values(0) : std::numeric_limits<double>::infinity();
}

/// A fold of the views used, evenly spread: view i belongs to fold i modulo folds.
std::vector<Views> folds_of(const Views& used, int wanted) {
    const auto count = static_cast<int>(std::count(used.begin(), used.end(), true));
    std::vector<Views> folds(std::clamp(wanted, 2, std::max(2, count)), Views(used.size(), false));
    std::size_t index = 0;
    for (std::size_t i = 0; i < used.size(); ++i)
        if (used[i])
            folds[index++ % folds.size()][i] = true;
    return folds;
}

/// Each view's score under a camera fitted without it.
std::vector<ViewScore> held_out(const Problem& problem, const Fit& from, const Free& free, const Views& used,
                                int wanted_folds) {
    std::vector<ViewScore> all(used.size());
    for (const Views& fold : folds_of(used, wanted_folds)) {
        Views rest = used;
        for (std::size_t i = 0; i < rest.size(); ++i)
            rest[i] = rest[i] && !fold[i];
        const std::vector<ViewScore> scores = problem.score(problem.fit(from, free, rest, false), fold);
        for (std::size_t i = 0; i < all.size(); ++i)
            if (fold[i])
                all[i] = scores[i];
    }
    return all;
}

/// How much smaller the views' errors have become: mean logarithm of the ratio, and its standard error. Logarithms give
/// each view one vote, even one with ten times the error of the others.
struct Gain {
    double mean = 0, standard_error = 0;
    [[nodiscard]] bool clear() const { return mean > standard_error; }
    [[nodiscard]] std::string text() const {
        const double percent = 100 * (1 - std::exp(-mean));
        return fmt::format("held-out error {} by {:.2f} % +- {:.2f} %", percent < 0 ? "rises" : "falls",
                           std::abs(percent), 100 * standard_error);
    }
};

Gain gain_of(const std::vector<ViewScore>& before, const std::vector<ViewScore>& after) {
    std::vector<double> gains;
    for (std::size_t i = 0; i < before.size(); ++i)
        if (before[i].points > 0 && after[i].points > 0)
            gains.push_back(std::log((before[i].rms() + 1e-12) / (after[i].rms() + 1e-12)));
    const auto count = static_cast<double>(gains.size());
    if (gains.size() < 2)
        return {};
    const double mean = std::accumulate(gains.begin(), gains.end(), 0.0) / count;
    double squares = 0;
    for (const double gain : gains)
        squares += (gain - mean) * (gain - mean);
    return {mean, std::sqrt(squares / (count - 1) / count)};
}

std::string inflated(const Fit& before, const Fit& after, const Free& was_free, double most) {
    // k1 and k2 compensate each other, so their sigmas grow together. The pixel's sigma covers both.
    for (const Unknown unknown : {f, aspect, cx, cy})
        if (was_free[unknown] && after.sigma(unknown) > most * before.sigma(unknown))
            return fmt::format("the sigma of {} grows {:.1f} times", name_of(unknown),
                               after.sigma(unknown) / before.sigma(unknown));
    const double image_before = mean_pixel_sigma(before), image_after = mean_pixel_sigma(after);
    if (image_before > 0 && image_after > most * image_before)
        return fmt::format("the pixel's sigma over the image grows {:.1f} times", image_after / image_before);
    return {};
}

/// Whether the free numbers are where they were, measured in their sigmas; or in pixels, where sigmas are tiny.
bool settled(const Fit& before, const Fit& after, const Free& free) {
    constexpr double least_sigmas = 0.1, least_px = 1e-3;
    if (after.covariance.size() == 0)
        return false;
    for (int i = 0; i < unknown_count; ++i) {
        const bool in_pixels = i == f || i == cx || i == cy;
        const double least = std::max(least_sigmas * std::sqrt(after.covariance(i, i)), in_pixels ? least_px : 0);
        if (free[i] && !(std::abs(after.model.values[i] - before.model.values[i]) <= least))
            return false;
    }
    return true;
}

/// A fit, continued while it has not converged. Of exact observations, poses and scene may creep on together for
/// hundreds of steps, along a motion of the whole world that only weak priors on poses hold. The camera does not depend
/// on it: a fit has converged, too, once the camera's numbers stay.
Fit continued_fit(const Problem& problem, const Fit& from, const Free& free, const Views& used) {
    constexpr int most_rounds = 4;
    Fit fit = problem.fit(from, free, used, true);
    for (int round = 1; round < most_rounds && !fit.converged; ++round) {
        Fit next = problem.fit(fit, free, used, true);
        next.converged = next.converged || settled(fit, next, free);
        fit = std::move(next);
    }
    return fit;
}

/// A fit that settles: where it does not from here, and the focal length was not free before, from the best of several
/// focal lengths.
Fit settled_fit(const Problem& problem, const Fit& from, const Free& free, const Views& used, bool frees_focal_length) {
    Fit fit = continued_fit(problem, from, free, used);
    if (fit.converged || !frees_focal_length)
        return fit;
    Free others = free;
    others[f] = false;
    std::optional<Fit> best;
    for (const double scale : {0.8, 0.9, 1.1, 1.25}) {
        Fit start = from;
        start.model[f] *= scale;
        Fit at = problem.fit(start, others, used, false);
        if (!best || at.rss < best->rss)
            best = std::move(at);
    }
    Fit other = continued_fit(problem, *best, free, used);
    return other.converged ? other : fit;
}

/// The state of one selection.
class ModelSelection {
  public:
    ModelSelection(const Problem& problem, const Fit& start, const std::vector<ParameterGroup>& groups,
                   const Views& used, const SelectionOptions& options)
        : problem_(problem), groups_(groups), used_(used), options_(options) {
        selection_.start = start;
        selection_.fit = problem.fit(start, {}, used, true);
        selection_.steps.resize(groups.size());
        for (std::size_t i = 0; i < groups.size(); ++i)
            selection_.steps[i].name = groups[i].name;
        held_out_ = held_out(problem, selection_.fit, {}, used, options.folds);
        selection_.held_out_before_px = total_rms(held_out_);
        selection_.train_before_px = train_rms(selection_.fit);
    }

    Selection supported() {
        for (bool any_freed = true; any_freed;) { // a better model may support what a cruder one rejected
            any_freed = false;
            std::vector<std::size_t> together;
            for (std::size_t i = 0; i < groups_.size(); ++i) {
                if (selection_.steps[i].freed)
                    continue;
                // A strong barrel folds when k1 has to do alone what k1 and k2 do together: both are then freed at
                // once.
                together.push_back(i);
                const Outcome outcome = try_groups(together);
                any_freed = any_freed || outcome == Outcome::freed;
                if (outcome != Outcome::folds)
                    together.clear();
            }
        }
        for (std::size_t i = groups_.size(); i-- > 0;)
            fix_if_unsupported(i);
        return finished();
    }

    Selection all() {
        for (std::size_t i = 0; i < groups_.size(); ++i) {
            selection_.steps[i] = {std::string(groups_[i].name), true, "asked for"};
            for (const Unknown unknown : groups_[i].unknowns)
                selection_.free[unknown] = true;
        }
        selection_.fit = settled_fit(problem_, selection_.fit, selection_.free, used_, selection_.free[f]);
        held_out_ = held_out(problem_, selection_.fit, selection_.free, used_, options_.folds);
        return finished();
    }

  private:
    [[nodiscard]] double train_rms(const Fit& fit) const { return total_rms(problem_.score(fit, used_)); }

    Selection finished() {
        if (selection_.free[f])
            selection_.focal_length_free.reset();
        selection_.held_out_px = total_rms(held_out_);
        selection_.train_px = train_rms(selection_.fit);
        return selection_;
    }

    /// A guess is not information: the first focal length needs to be determined, not to differ from the guess.
    [[nodiscard]] bool must_free(const ParameterGroup& group) const {
        return options_.guessed && group.unknowns.front() == f;
    }

    enum class Outcome { freed, rejected, folds };

    void record(const std::vector<std::size_t>& indices, bool freed, const std::string& why) {
        for (const std::size_t index : indices) {
            selection_.steps[index] = {std::string(groups_[index].name), freed, why};
            if (options_.say)
                options_.say(fmt::format("{}: {}{}", groups_[index].name, freed ? "freed, " : "", why));
        }
    }

    /// Frees the groups' numbers at once, if they pass the tests.
    Outcome try_groups(const std::vector<std::size_t>& indices) {
        ParameterGroup group = groups_[indices.front()];
        for (std::size_t i = 1; i < indices.size(); ++i)
            group.unknowns.insert(group.unknowns.end(), groups_[indices[i]].unknowns.begin(),
                                  groups_[indices[i]].unknowns.end());
        if (const double rms = train_rms(selection_.fit); rms < options_.enough_px && !must_free(group)) {
            record(indices, false, fmt::format("not needed: the error is {:.1g} {} without it", rms, problem_.unit()));
            return Outcome::rejected;
        }
        Free free = selection_.free;
        for (const Unknown unknown : group.unknowns)
            free[unknown] = true;
        const Fit fit = settled_fit(problem_, selection_.fit, free, used_, free[f] && !selection_.free[f]);
        if (free[f] && !selection_.free[f])
            selection_.focal_length_free = fit;
        if (const std::string why = objection(group, fit, free); !why.empty()) {
            record(indices, false, why);
            return Outcome::rejected;
        }
        if (!monotone(fit.model)) {
            record(indices, false, "not usable: the lens would fold back on itself within the image");
            return Outcome::folds;
        }
        const auto scores = held_out(problem_, fit, free, used_, options_.folds);
        const Gain gain = gain_of(held_out_, scores);
        if (!gain.clear() && !must_free(group)) {
            record(indices, false, "not supported: " + gain.text());
            return Outcome::rejected;
        }
        record(indices, true,
               fmt::format("{:.1f} sigma, {}{}{}", sigmas_from(fit, selection_.start.model, group.unknowns),
                           gain.text(), indices.size() > 1 ? " (together)" : "",
                           gain.clear() ? "" : "; freed all the same, since its start is a guess"));
        selection_.fit = fit;
        selection_.free = free;
        held_out_ = scores;
        return Outcome::freed;
    }

    /// Why the group cannot be freed, apart from held-out views; empty where all tests pass.
    [[nodiscard]] std::string objection(const ParameterGroup& group, const Fit& fit, const Free& free) const {
        if (fit.covariance.size() == 0)
            return "not determined: the normal matrix is singular";
        if (!fit.converged)
            return "not determined: the fit does not converge";
        if (must_free(group))
            return fit.sigma(f) > 0.05 * fit.model[f]
                       ? fmt::format("not determined: f is {:.1f} +- {:.1f} px", fit.model[f], fit.sigma(f))
                       : "";
        if (const double sigmas = sigmas_from(fit, selection_.start.model, group.unknowns);
            sigmas < options_.least_sigmas)
            return fmt::format("not supported: {:.1f} sigma", sigmas);
        if (const std::string why = confused_with_rival(group, fit, free); !why.empty())
            return why;
        if (bic(fit) >= bic(selection_.fit))
            return "not supported: BIC does not fall";
        if (const double found = condition(fit, free); found > options_.worst_condition)
            return fmt::format("not determined: condition number {:.1e}", found);
        if (const std::string trouble = inflated(selection_.fit, fit, selection_.free, options_.most_inflation);
            !trouble.empty())
            return "not supported: " + trouble;
        return {};
    }

    /// Gauge check: the group may be significant only because its rival is fixed.
    [[nodiscard]] std::string confused_with_rival(const ParameterGroup& group, const Fit& fit, Free free) const {
        if (!group.rival || free[*group.rival])
            return {};
        free[*group.rival] = true;
        const Fit both = problem_.fit(fit, free, used_, true);
        const double sigmas =
            both.covariance.size() == 0 ? 0 : sigmas_from(both, selection_.start.model, group.unknowns);
        if (sigmas >= options_.least_sigmas)
            return {};
        const auto called = [](Unknown unknown) { return unknown == f ? "focal length" : name_of(unknown); };
        return fmt::format("{} and {} cannot be told apart here: {:.1f} sigma alone, {:.1f} with both free",
                           called(group.unknowns.front()), called(*group.rival),
                           sigmas_from(fit, selection_.start.model, group.unknowns), sigmas);
    }

    /// A number freed early may have explained what belongs to a later one.
    void fix_if_unsupported(std::size_t index) {
        const ParameterGroup& group = groups_[index];
        Step& step = selection_.steps[index];
        if (!step.freed || must_free(group))
            return;
        const double sigmas = sigmas_from(selection_.fit, selection_.start.model, group.unknowns);
        if (sigmas >= options_.least_sigmas)
            return;
        if (group.unknowns.front() == f)
            selection_.focal_length_free = selection_.fit;
        for (const Unknown unknown : group.unknowns) {
            selection_.free[unknown] = false;
            selection_.fit.model[unknown] = selection_.start.model[unknown];
        }
        step = {std::string(group.name), false,
                fmt::format("not supported together with the others: {:.1f} sigma", sigmas)};
        selection_.fit = problem_.fit(selection_.fit, selection_.free, used_, true);
        held_out_ = held_out(problem_, selection_.fit, selection_.free, used_, options_.folds);
    }

    const Problem& problem_;
    const std::vector<ParameterGroup>& groups_;
    const Views& used_;
    const SelectionOptions& options_;
    Selection selection_;
    std::vector<ViewScore> held_out_;
};

} // namespace

bool Selection::unchanged() const {
    return std::none_of(free.begin(), free.end(), [](bool open) { return open; });
}

Selection select_model(const Problem& problem, const Fit& start, const std::vector<ParameterGroup>& groups,
                       const Views& used, const SelectionOptions& options) {
    return ModelSelection(problem, start, groups, used, options).supported();
}

Selection full_model(const Problem& problem, const Fit& start, const std::vector<ParameterGroup>& groups,
                     const Views& used, const SelectionOptions& options) {
    return ModelSelection(problem, start, groups, used, options).all();
}

} // namespace scanshade::calibration
