// Each test that a number must pass before it is freed, by itself: a problem whose answers are told, sound but for one.
#include "projection/calibration/model_selection.h"
#include "tests/support/says.h"

#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace calibration;
using tests::says;

/// Ten views. With f free it is 25 px more than at the start, with k1 free that is -0.1 more; k2 and k3 stay at 0.
struct Told : Problem {
    double rss_with_k1 = 250, k1_moved = -0.1, sigma_k1 = 0.001; ///< rss is 500 without k1
    double sigma_f = 0.1, f_inflated = 1;                        ///< by what sigma_f grows once k1 is free
    double f_with_k1 = 0;                                        ///< correlation
    double held_out_with_k1 = 0.8;                               ///< of the error of views held out; 1 without k1
    double error_px = 1;
    double k1_with_k2 = -0.1, sigma_k1_with_k2 = 0.001; ///< what becomes of k1 once k2 is free
    bool k2_helps = false, singular_with_k1 = false, converges_with_k1 = true;
    double k1_creeps = 0; ///< with every fit, where it does not converge

    [[nodiscard]] std::size_t views() const override { return 10; }
    [[nodiscard]] std::string view_name(std::size_t view) const override { return std::to_string(view); }
    void set_weights(const std::vector<double>&) override {}
    [[nodiscard]] Fit start(const Model& model) const override {
        Fit fit;
        fit.model = model;
        return fit;
    }
    [[nodiscard]] Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const override {
        Fit found = from;
        found.used = used;
        found.residuals = 1000;
        found.unknowns = 60 + static_cast<int>(std::count(free.begin(), free.end(), true));
        found.model[f] = free[f] ? 550 : 525;
        found.model[k1] = !free[k1] ? 0 : free[k2] ? k1_with_k2 : k1_moved;
        if (free[k1] && !converges_with_k1)
            found.model[k1] += from.model[k1] == 0 ? 0 : from.model[k1] - k1_moved + k1_creeps;
        found.model[k2] = free[k2] && k2_helps ? 0.05 : 0;
        found.rss = !free[f] ? 1000 : !free[k1] ? 500 : free[k2] && k2_helps ? rss_with_k1 / 2 : rss_with_k1;
        found.converged = !free[k1] || converges_with_k1;
        found.covariance = {};
        if (!covariance || (free[k1] && singular_with_k1))
            return found;
        const double of_k1 = free[k2] ? sigma_k1_with_k2 : sigma_k1, of_f = free[k1] ? sigma_f * f_inflated : sigma_f;
        found.covariance = Eigen::MatrixXd::Zero(unknown_count, unknown_count);
        if (free[f])
            found.covariance(f, f) = of_f * of_f;
        if (free[k1]) {
            found.covariance(k1, k1) = of_k1 * of_k1;
            found.covariance(f, k1) = found.covariance(k1, f) = f_with_k1 * of_f * of_k1;
        }
        if (free[k2])
            found.covariance(k2, k2) = 1e-6;
        return found;
    }
    [[nodiscard]] std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const override {
        std::vector<ViewScore> scores(wanted.size());
        for (std::size_t i = 0; i < scores.size(); ++i)
            if (wanted[i]) {
                const double usual = error_px * (1 + 0.01 * static_cast<double>(i % 3)); // views differ a little
                const double error = (fit.model[f] == 525 ? 2 : 1) * (fit.model[k1] == 0 ? 1 : held_out_with_k1) *
                                     (fit.model[k2] == 0 ? 1 : 0.8) * usual *
                                     (fit.model[k1] == 0 ? 1 : 1 - 0.01 * static_cast<double>(i % 2));
                scores[i] = {error * error * 50, 50};
            }
        return scores;
    }
    [[nodiscard]] std::vector<cv::Point2d> pixels_of(std::size_t) const override { return {}; }
    [[nodiscard]] std::vector<Eigen::Vector2d> residuals(const Fit&, std::size_t) const override { return {}; }
    [[nodiscard]] std::vector<double> depths_m(const Fit&) const override { return {}; }
};

Selection selected(const Told& told, const std::vector<ParameterGroup>& groups = {{"f", {f}}, {"k1", {k1}}}) {
    const Camera plain{{525, 525, 319.5, 239.5, {640, 480}}, {}, "plain"};
    return select_model(told, told.start(model_of(plain)), groups, Views(told.views(), true));
}

TEST(ModelSelectionRules, a_sound_number_is_freed) {
    const Selection selection = selected({});
    EXPECT_TRUE(selection.free[f]) << selection.steps[0].why;
    EXPECT_TRUE(selection.free[k1]) << selection.steps[1].why;
    EXPECT_TRUE(says(selection.steps[1].why, "100.0 sigma, held-out error falls by"));
}

TEST(ModelSelectionRules, each_by_itself_keeps_a_number_from_being_freed) {
    struct Case {
        const char* what;
        void (*spoil)(Told&);
        const char* said;
    };
    for (const Case& each : std::initializer_list<Case>{
             {"held-out views become worse", [](Told& t) { t.held_out_with_k1 = 1.05; },
              "not supported: held-out error rises"},
             // 1.0 +- 0.3 %: hardly more than its standard error by chance, and not more than it here.
             {"held-out views stay as they are", [](Told& t) { t.held_out_with_k1 = 1.005; },
              "not supported: held-out error"},
             {"it is its start by chance", [](Told& t) { t.sigma_k1 = 0.04; }, "not supported: 2.5 sigma"},
             // n ln(rss) must fall by ln n = 6.9 for a number, hence rss by 0.7 %.
             {"rss falls by chance", [](Told& t) { t.rss_with_k1 = 497; }, "not supported: BIC does not fall"},
             {"f becomes uncertain", [](Told& t) { t.f_inflated = 2.1; },
              "not supported: the sigma of f grows 2.1 times"},
             {"the image becomes uncertain", [](Told& t) { t.sigma_k1 = 0.02; },
              "the pixel's sigma over the image grows"},
             {"the lens folds back", [](Told& t) { t.k1_moved = -1; }, "would fold back"},
             // Eigenvalues of a pair's correlation are 1 +- r: their ratio exceeds 1e7 from r = 1 - 2e-7 on.
             {"f and k1 are one number", [](Told& t) { t.f_with_k1 = 1 - 1e-8; }, "not determined: condition number"},
             {"nothing determines it", [](Told& t) { t.singular_with_k1 = true; },
              "not determined: the normal matrix is singular"},
             {"the fit has no end",
              [](Told& t) {
                  t.converges_with_k1 = false;
                  t.k1_creeps = 0.002;
              },
              "the fit does not converge"},
             {"the error is next to nothing", [](Told& t) { t.error_px = 0.9e-3; }, "not needed: the error is"}}) {
        Told told;
        each.spoil(told);
        const Selection selection = selected(told);
        EXPECT_FALSE(selection.free[k1]) << each.what << ": " << selection.steps[1].why;
        EXPECT_EQ(selection.fit.model[k1], 0) << each.what;
        EXPECT_TRUE(says(selection.steps[1].why, each.said)) << each.what;
    }
}

TEST(ModelSelectionRules, a_fit_of_which_only_poses_creep_on_has_converged) {
    Told told;
    told.converges_with_k1 = false; // and yet k1 stays where it is
    EXPECT_TRUE(selected(told).free[k1]);
}

TEST(ModelSelectionRules, how_sure_a_kept_focal_length_is_stays_known) {
    Told told;
    told.sigma_f = 20; // of 25 px
    const Selection selection = selected(told);
    EXPECT_FALSE(selection.free[f]);
    ASSERT_TRUE(selection.focal_length_free);
    EXPECT_EQ(selection.focal_length_free->model[f], 550);
    EXPECT_FALSE(selected({}).focal_length_free);
}

TEST(ModelSelectionRules, a_number_that_its_rival_explains_as_well_is_not_freed) {
    Told told;
    told.sigma_k1_with_k2 = 1;
    const Selection selection = selected(told, {{"f", {f}}, {"k1", {k1}, k2}});
    EXPECT_FALSE(selection.free[k1]);
    EXPECT_TRUE(
        says(selection.steps[1].why, "k1 and k2 cannot be told apart here: 100.0 sigma alone, 0.1 with both free"));
}

TEST(ModelSelectionRules, a_number_freed_early_is_fixed_again_where_a_later_one_explains_it) {
    Told told;
    told.k2_helps = true;
    told.k1_with_k2 = -0.001; // of its sigma of 0.001
    const Selection selection = selected(told, {{"f", {f}}, {"k1", {k1}}, {"k2", {k2}}});
    EXPECT_TRUE(selection.free[k2]) << selection.steps[2].why;
    EXPECT_FALSE(selection.free[k1]);
    EXPECT_TRUE(says(selection.steps[1].why, "not supported together with the others: 1.0 sigma"));
}

} // namespace
} // namespace scanshade
