// Expected errors: tables are found again, read as written, and chosen by method, settings and sensor.
#include "tests/bench/error_fit.h"

#include "ao/base/method.h"
#include "ao/expected_errors.h"
#include "projection/base/error.h"
#include "tests/support/says.h"

#include <cmath>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <sstream>

namespace scanshade {
namespace {

using namespace tests;

/// Pixels of all kinds, whose squared errors are those of `table` times an exponential random number of mean 1.
std::vector<ErrorSample> samples_of(const shared::ErrorTable& table, int count) {
    cv::RNG random(11);
    std::vector<ErrorSample> samples;
    for (int i = 0; i < count; ++i) {
        const ErrorSigns signs{static_cast<float>(random.uniform(2, 17)) / 16, random.uniform(0, 5),
                               random.uniform(0, 5), random.uniform(4.0F, 200.0F), random.uniform(0.0F, 0.1F)};
        const ErrorWeights weights = weights_of(signs, random.uniform(0.0F, 1.0F));
        const float error = expected_error(weights, table);
        samples.push_back({weights, -error * error * std::log(random.uniform(1e-6F, 1.0F)), i % 3});
    }
    return samples;
}

shared::ErrorTable some_table() {
    shared::ErrorTable table{};
    for (int i = 0; i < shared::error_edges_at; ++i) {
        const int share = i / shared::error_values;
        table.factors[i] = -5 - 0.3F * static_cast<float>(share);
    }
    for (int ring = 0; ring <= shared::error_rings; ++ring) {
        table.factors[shared::error_edges_at + ring] = 1.5F - 0.3F * static_cast<float>(ring);
        table.factors[shared::error_holes_at + ring] = 0.8F - 0.2F * static_cast<float>(ring);
    }
    for (int i = 0; i < shared::error_noises; ++i)
        table.factors[shared::error_noises_at + i] = 0.4F * static_cast<float>(i);
    return table;
}

TEST(ErrorFit, finds_the_errors_it_was_shown_and_no_bin_is_off) {
    const std::vector<ErrorSample> samples = samples_of(some_table(), 200000);
    const shared::ErrorTable fitted = fitted_errors(samples);
    Calibration calibration;
    for (const ErrorSample& sample : samples)
        calibration.add(expected_error(sample.signs, fitted), sample.square);
    for (const auto& [expected, found] : calibration.in_bins())
        EXPECT_NEAR(found / expected, 1, 0.05);
    EXPECT_NEAR(calibration.whole().found / calibration.whole().expected, 1, 0.01);
    double worst = 0;
    for (const ErrorSample& sample : std::span(samples).first(2000))
        worst = std::max(worst, std::abs(std::log2(static_cast<double>(expected_error(sample.signs, fitted) /
                                                                       expected_error(sample.signs, some_table())))));
    EXPECT_LT(worst, 0.35) << "a quarter, at knots that few samples are near";
}

TEST(ErrorFit, errors_never_rise_with_distance_nor_fall_with_noise_whatever_the_samples_say) {
    shared::ErrorTable wrong = some_table();
    wrong.factors[shared::error_edges_at + 3] = 3;
    wrong.factors[shared::error_noises_at + 1] = 3;
    const shared::ErrorTable fitted = fitted_errors(samples_of(wrong, 30000));
    for (int ring = 0; ring < shared::error_rings; ++ring)
        EXPECT_GE(fitted.factors[shared::error_edges_at + ring],
                  fitted.factors[shared::error_edges_at + ring + 1] - 0.02F);
    for (int i = 0; i + 1 < shared::error_noises; ++i)
        EXPECT_LE(fitted.factors[shared::error_noises_at + i], fitted.factors[shared::error_noises_at + i + 1] + 0.02F);
}

TEST(ErrorFit, leaves_a_scene_out) {
    std::vector<ErrorSample> samples = samples_of(some_table(), 3000);
    const float before = expected_error(samples[0].signs, fitted_errors(samples, 1));
    for (ErrorSample& sample : samples)
        if (sample.scene == 1)
            sample.square = 100;
    EXPECT_EQ(expected_error(samples[0].signs, fitted_errors(samples, 1)), before);
    EXPECT_EQ(expected_error(samples[0].signs, fitted_errors({})), 1) << "nothing is known";
}

TEST(ErrorFit, one_factor_scales_a_table_to_samples_of_other_scenes) {
    std::vector<ErrorSample> samples = samples_of(some_table(), 3000);
    const float as_made = factor_of(samples, some_table(), 1);
    EXPECT_NEAR(factor_of(samples, scaled(some_table(), 1), 1), as_made - 1, 1e-3F)
        << "expected squares twice as large";
    for (ErrorSample& sample : samples)
        sample.square *= sample.scene == 1 ? 100 : 4;
    EXPECT_NEAR(factor_of(samples, some_table(), 1), as_made + 2, 1e-3F) << "scene 1 is left out";
    EXPECT_EQ(factor_of({}, some_table()), 0);
}

TEST(ErrorTablesTest, are_read_as_written) {
    ErrorTables tables{.made_by = "a command", .methods = {}};
    MethodErrors& errors = tables.methods[{"surfel", SensorClass::structured_light}];
    errors.table = some_table();
    errors.together = -0.5F;
    errors.variants = {{{{"quality", "low"}, {"downsampled", "true"}}, 0.25F}};
    std::istringstream text(text_of(tables));
    const ErrorTables again = error_tables_from(text, "here");
    EXPECT_EQ(again.made_by, "a command");
    const MethodErrors& read = again.methods.at({"surfel", SensorClass::structured_light});
    for (int i = 0; i < shared::error_factors; ++i)
        EXPECT_NEAR(read.table.factors[i], some_table().factors[i], 0.006) << i;
    EXPECT_EQ(read.together, -0.5F);
    EXPECT_EQ(read.variants.at(0).settings, errors.variants[0].settings);
    EXPECT_EQ(read.variants[0].factor, 0.25F);
}

TEST(ErrorTablesTest, bad_lines_are_refused_with_their_number) {
    for (const char* line : {"tables surfel clean 1", "table surfel sonar 1", "table surfel clean 1 2 x",
                             "variant surfel clean 0.1 quality", "together surfel clean 1 2",
                             "together surfel clean nan", "spread surfel clean 0", "spread surfel clean"}) {
        std::istringstream text(std::string("# a comment\n") + line + "\n");
        EXPECT_TRUE(says(refusal([&] { (void)error_tables_from(text, "here"); }), "here, line 2")) << line;
    }
}

TEST(ErrorTablesTest, the_variant_with_most_matching_settings_counts) {
    ErrorTables tables;
    MethodErrors& errors = tables.methods[{"surfel", SensorClass::clean}];
    errors.table = some_table();
    errors.together = -1;
    errors.variants = {{{{"quality", "low"}}, 2}, {{{"quality", "low"}, {"downsampled", "true"}}, 4}};
    const auto factor = [&](const ChosenSettings& settings, double together) {
        return errors_of(tables, "surfel", settings, SensorClass::clean, together).factors[0] - some_table().factors[0];
    };
    EXPECT_FLOAT_EQ(factor({{"quality", "high"}}, 0), 0);
    EXPECT_FLOAT_EQ(factor({{"quality", "low"}, {"downsampled", "false"}}, 0), 2);
    EXPECT_FLOAT_EQ(factor({{"downsampled", "true"}, {"quality", "low"}}, 0), 4);
    EXPECT_FLOAT_EQ(factor({{"quality", "low"}}, 1), 1);
    EXPECT_FLOAT_EQ(factor({{"quality", "low"}}, 0.5), 1.5);
}

TEST(ErrorTablesTest, a_method_without_a_spread_of_its_own_takes_the_worst_of_the_class) {
    std::istringstream text("spread surfel clean 1.1\nspread cacao clean 1.4\nspread cacao time_of_flight 1.7\n");
    const ErrorTables tables = error_tables_from(text, "here");
    EXPECT_NEAR(spread_of(tables, "surfel", SensorClass::clean), 1.1, 1e-6);
    EXPECT_NEAR(spread_of(tables, "hbao", SensorClass::clean), 1.4, 1e-6);
    EXPECT_NEAR(spread_of(tables, "surfel", SensorClass::time_of_flight), 1.7, 1e-6);
    EXPECT_NEAR(spread_of(tables, "surfel", SensorClass::interpolated), 1.7, 1e-6) << "nothing of the class: of all";
    std::istringstream again(text_of(tables));
    EXPECT_EQ(text_of(error_tables_from(again, "here")), text_of(tables));
}

TEST(ErrorTablesTest, every_method_has_shipped_ones_for_every_sensor) {
    for (const MethodRow& method : methods())
        for (const SensorClass sensor : {SensorClass::clean, SensorClass::structured_light, SensorClass::time_of_flight,
                                         SensorClass::interpolated}) {
            const shared::ErrorTable table = errors_of(shipped_error_tables(), std::string(method.name), {}, sensor, 0);
            const ErrorSigns open{1, shared::error_rings, shared::error_rings, 64, 0}, corner{0.4F, 0, 0, 64, 0.05F};
            EXPECT_LT(expected_error(weights_of(open, 1), table), 0.15) << method.name;
            EXPECT_LT(expected_error(weights_of(open, 1), table), expected_error(weights_of(corner, 0.5F), table));
        }
}

} // namespace
} // namespace scanshade
