// The ladder: which rung is tried, what speaks against it, what is taken back.
#include "projection/calibration/model_selection.h"

#include "projection/calibration/quality.h"
#include "projection/undistort.h"

#include <algorithm>
#include <Eigen/Dense>
#include <fmt/format.h>
#include <numeric>

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

/// How many sigmas the new numbers are from the old ones: of a pair, the sigmas of a single number as unlikely as that.
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

/// Of the correlation matrix, so that units do not matter: 1 where nothing hangs together.
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
    std::size_t place = 0;
    for (std::size_t i = 0; i < used.size(); ++i)
        if (used[i])
            folds[place++ % folds.size()][i] = true;
    return folds;
}

/// Each view's score under a camera fitted without it.
std::vector<ViewScore> held_out(const Evidence& evidence, const Fit& from, const Free& free, const Views& used,
                                int wanted_folds) {
    std::vector<ViewScore> all(used.size());
    for (const Views& fold : folds_of(used, wanted_folds)) {
        Views rest = used;
        for (std::size_t i = 0; i < rest.size(); ++i)
            rest[i] = rest[i] && !fold[i];
        const std::vector<ViewScore> scores = evidence.score(evidence.fit(from, free, rest, false), fold);
        for (std::size_t i = 0; i < all.size(); ++i)
            if (fold[i])
                all[i] = scores[i];
    }
    return all;
}

/// How much smaller the views' errors have become: mean logarithm of the ratio, and its standard error. Views pair off,
/// and a view with ten times the error of the others has one vote, not ninety-nine.
struct Gain {
    double mean = 0, standard_error = 0;
    [[nodiscard]] bool clear() const { return mean > standard_error; }
    [[nodiscard]] double percent() const { return 100 * (1 - std::exp(-mean)); }
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
    // k1 and k2 trade with each other, and their sigmas must grow together; what counts of them is the pixel's sigma.
    for (const Unknown unknown : {f, aspect, cx, cy})
        if (was_free[unknown] && after.sigma(unknown) > most * before.sigma(unknown))
            return fmt::format("the sigma of {} grows {:.1f} times", name_of(unknown),
                               after.sigma(unknown) / before.sigma(unknown));
    const double image_before = mean_pixel_sigma(before), image_after = mean_pixel_sigma(after);
    if (image_before > 0 && image_after > most * image_before)
        return fmt::format("the pixel's sigma over the image grows {:.1f} times", image_after / image_before);
    return {};
}

/// The ladder while it is being climbed.
class Ladder {
  public:
    Ladder(const Evidence& evidence, const Fit& start, const std::vector<Rung>& rungs, const Views& used,
           const LadderOptions& options)
        : evidence_(evidence), rungs_(rungs), used_(used), options_(options) {
        climb_.start = start;
        climb_.fit = evidence.fit(start, {}, used, true);
        climb_.steps.resize(rungs.size());
        for (std::size_t i = 0; i < rungs.size(); ++i)
            climb_.steps[i].name = rungs[i].name;
        held_out_ = held_out(evidence, climb_.fit, {}, used, options.folds);
        climb_.held_out_before_px = total_rms(held_out_);
        climb_.train_before_px = train_rms(climb_.fit);
    }

    Climb by_evidence() {
        for (bool higher = true; higher;) { // what failed beside a cruder model may stand beside a better one
            higher = false;
            std::vector<std::size_t> together;
            for (std::size_t i = 0; i < rungs_.size(); ++i) {
                if (climb_.steps[i].climbed)
                    continue;
                // A strong barrel folds when k1 has to do alone what k1 and k2 do together: then they are freed as one.
                together.push_back(i);
                const Outcome outcome = try_rungs(together);
                higher = higher || outcome == Outcome::climbed;
                if (outcome != Outcome::folds)
                    together.clear();
            }
        }
        for (std::size_t i = rungs_.size(); i-- > 0;)
            take_back_if_unsupported(i);
        return finished();
    }

    Climb all() {
        for (std::size_t i = 0; i < rungs_.size(); ++i) {
            climb_.steps[i] = {std::string(rungs_[i].name), true, "asked for"};
            for (const Unknown unknown : rungs_[i].unknowns)
                climb_.free[unknown] = true;
        }
        climb_.fit = evidence_.fit(climb_.fit, climb_.free, used_, true);
        held_out_ = held_out(evidence_, climb_.fit, climb_.free, used_, options_.folds);
        return finished();
    }

  private:
    [[nodiscard]] double train_rms(const Fit& fit) const { return total_rms(evidence_.score(fit, used_)); }

    Climb finished() {
        climb_.held_out_px = total_rms(held_out_);
        climb_.train_px = train_rms(climb_.fit);
        return climb_;
    }

    /// A guess is not information: the first focal length needs to be determined, not to differ from the guess.
    [[nodiscard]] bool must(const Rung& rung) const { return options_.guessed && rung.unknowns.front() == f; }

    enum class Outcome { climbed, refused, folds };

    void say(const std::vector<std::size_t>& indices, bool climbed, const std::string& why) {
        for (const std::size_t index : indices)
            climb_.steps[index] = {std::string(rungs_[index].name), climbed, why};
    }

    /// Frees the rungs' numbers as one, if they stand the tests.
    Outcome try_rungs(const std::vector<std::size_t>& indices) {
        Rung rung = rungs_[indices.front()];
        for (std::size_t i = 1; i < indices.size(); ++i)
            rung.unknowns.insert(rung.unknowns.end(), rungs_[indices[i]].unknowns.begin(),
                                 rungs_[indices[i]].unknowns.end());
        if (const double rms = train_rms(climb_.fit); rms < options_.enough_px && !must(rung)) {
            say(indices, false, fmt::format("not needed: the error is {:.1g} {} without it", rms, evidence_.unit()));
            return Outcome::refused;
        }
        Free free = climb_.free;
        for (const Unknown unknown : rung.unknowns)
            free[unknown] = true;
        const Fit fit = evidence_.fit(climb_.fit, free, used_, true);
        if (const std::string why = objection(rung, fit, free); !why.empty()) {
            say(indices, false, why);
            return Outcome::refused;
        }
        if (!monotone(fit.model)) {
            say(indices, false, "not usable: the lens would fold back on itself within the image");
            return Outcome::folds;
        }
        const auto scores = held_out(evidence_, fit, free, used_, options_.folds);
        const Gain gain = gain_of(held_out_, scores);
        if (!gain.clear() && !must(rung)) {
            say(indices, false,
                fmt::format("not supported: held-out error falls by {:.2f} % +- {:.2f} %", gain.percent(),
                            100 * gain.standard_error));
            return Outcome::refused;
        }
        say(indices, true,
            fmt::format("{:.1f} sigma, held-out error falls by {:.2f} % +- {:.2f} %{}",
                        sigmas_from(fit, climb_.start.model, rung.unknowns), gain.percent(), 100 * gain.standard_error,
                        indices.size() > 1 ? " (together)" : ""));
        climb_.fit = fit;
        climb_.free = free;
        held_out_ = scores;
        return Outcome::climbed;
    }

    /// Why the rung cannot be climbed, held-out views aside; empty where nothing speaks against it.
    [[nodiscard]] std::string objection(const Rung& rung, const Fit& fit, const Free& free) const {
        if (fit.covariance.size() == 0)
            return "not determined: the normal matrix is singular";
        if (!fit.converged)
            return "not determined: the fit does not converge";
        if (must(rung))
            return fit.sigma(f) > 0.05 * fit.model[f]
                       ? fmt::format("not determined: f is {:.1f} +- {:.1f} px", fit.model[f], fit.sigma(f))
                       : "";
        if (const double sigmas = sigmas_from(fit, climb_.start.model, rung.unknowns); sigmas < options_.least_sigmas)
            return fmt::format("not supported: {:.1f} sigma", sigmas);
        if (const std::string why = stood_in_for(rung, fit, free); !why.empty())
            return why;
        if (bic(fit) >= bic(climb_.fit))
            return "not supported: BIC does not fall";
        if (const double found = condition(fit, free); found > options_.worst_condition)
            return fmt::format("not determined: condition number {:.1e}", found);
        if (const std::string trouble = inflated(climb_.fit, fit, climb_.free, options_.most_inflation);
            !trouble.empty())
            return "not supported: " + trouble;
        return {};
    }

    /// Gauge check: with the rival free as well, what the rung alone seemed to show may be gone.
    [[nodiscard]] std::string stood_in_for(const Rung& rung, const Fit& fit, Free free) const {
        if (!rung.rival || free[*rung.rival])
            return {};
        free[*rung.rival] = true;
        const Fit beside = evidence_.fit(fit, free, used_, true);
        const double sigmas =
            beside.covariance.size() == 0 ? 0 : sigmas_from(beside, climb_.start.model, rung.unknowns);
        if (sigmas >= options_.least_sigmas)
            return {};
        const auto called = [](Unknown unknown) { return unknown == f ? "focal length" : name_of(unknown); };
        return fmt::format("{} and {} cannot be told apart here: {:.1f} sigma alone, {:.1f} with both free",
                           called(rung.unknowns.front()), called(*rung.rival),
                           sigmas_from(fit, climb_.start.model, rung.unknowns), sigmas);
    }

    /// A number freed early may have stood in for one that came later.
    void take_back_if_unsupported(std::size_t index) {
        const Rung& rung = rungs_[index];
        Step& step = climb_.steps[index];
        if (!step.climbed || must(rung))
            return;
        const double sigmas = sigmas_from(climb_.fit, climb_.start.model, rung.unknowns);
        if (sigmas >= options_.least_sigmas)
            return;
        for (const Unknown unknown : rung.unknowns) {
            climb_.free[unknown] = false;
            climb_.fit.model[unknown] = climb_.start.model[unknown];
        }
        step = {std::string(rung.name), false, fmt::format("not supported beside the others: {:.1f} sigma", sigmas)};
        climb_.fit = evidence_.fit(climb_.fit, climb_.free, used_, true);
        held_out_ = held_out(evidence_, climb_.fit, climb_.free, used_, options_.folds);
    }

    const Evidence& evidence_;
    const std::vector<Rung>& rungs_;
    const Views& used_;
    const LadderOptions& options_;
    Climb climb_;
    std::vector<ViewScore> held_out_;
};

} // namespace

bool Climb::unchanged() const {
    return std::none_of(free.begin(), free.end(), [](bool open) { return open; });
}

Climb climb(const Evidence& evidence, const Fit& start, const std::vector<Rung>& rungs, const Views& used,
            const LadderOptions& options) {
    return Ladder(evidence, start, rungs, used, options).by_evidence();
}

Climb climb_all(const Evidence& evidence, const Fit& start, const std::vector<Rung>& rungs, const Views& used,
                const LadderOptions& options) {
    return Ladder(evidence, start, rungs, used, options).all();
}

} // namespace scanshade::calibration
