// The Pareto front of measured configurations, and what a budget of run picks from it by class of sensor.
#include "apps/budget/budget.h"
#include "apps/budget/configurations.h"
#include "apps/budget/front.h"
#include "apps/session/presets.h"
#include "tests/support/measured.h"
#include "tests/support/says.h"

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <set>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

// ---------------------------------------------------------------------------------------------------- the Pareto front

BenchmarkPoint point(const std::string& name, double ns, double rms) { return {{"m", name, {}}, ns, rms}; }

TEST(ParetoFrontTest, holds_the_points_that_no_other_beats) {
    const double unknown = std::nan("");
    const std::vector<BenchmarkPoint> points{point("dear and good", 9, 0.05), point("cheap", 1, 0.2),
                                             point("beaten", 5, 0.12),        point("middle", 4, 0.1),
                                             point("cheap again", 1, 0.2),    point("as dear, worse", 9, 0.06),
                                             point("failed", unknown, 0.01)};
    EXPECT_EQ(on_pareto_front(points), (std::vector<bool>{true, true, false, true, false, false, false}));
}

TEST(ParetoFrontTest, survives_its_file_and_names_what_is_wrong_with_another) {
    ParetoFront front{"some device", {{SensorClass::clean, "bench"}}, {}, {}, {}};
    front.points[SensorClass::clean] = {{{"cacao", "low", {{"quality", "low"}}}, 30, 0.12},
                                        {{"cacao", "high", {{"quality", "high"}}}, 60, 0.1}};
    front.others[SensorClass::clean] = {{{"cacao", "lowest", {{"quality", "lowest"}}}, 40, 0.2}};
    front.sequences[SensorClass::clean] = {"measured", {"surfel", "high", {{"quality", "high"}}}, 0.2, 0.1, 2};
    const ParetoFront again = front_from(to_json(front), "front.json");
    EXPECT_EQ(to_json(again), to_json(front));
    json bad = to_json(front);
    bad["clean"]["points"][1]["ns_per_pixel"] = 0;
    EXPECT_TRUE(says(refusal([&] { (void)front_from(bad, "front.json"); }), "front.json: cacao high"));
    EXPECT_TRUE(says(refusal([&] { (void)front_from({{"device", "x"}}, "front.json"); }), "no points"));
}

TEST(ParetoFrontTest, parts_of_two_devices_cannot_be_joined) {
    ParetoFront one{"a", {{SensorClass::clean, ""}}, {{SensorClass::clean, {point("x", 1, 0.1)}}}, {}, {}};
    const ParetoFront other{"b", {{SensorClass::clean, ""}}, {{SensorClass::clean, {point("y", 1, 0.1)}}}, {}, {}};
    EXPECT_TRUE(says(refusal([&] { one.replace_with(other); }), "two devices"));
}

TEST(ParetoFrontTest, the_shipped_one_holds_existing_configurations) {
    for (const auto& [sensor, points] : shipped_front().points) {
        const std::vector<bool> front = on_pareto_front(points);
        for (std::size_t i = 0; i < points.size(); ++i) {
            EXPECT_TRUE(front[i]) << points[i].configuration.full_name();
            const auto setup = method_named(points[i].configuration.method).setup();
            EXPECT_NO_THROW(apply(points[i].configuration, *setup));
        }
    }
}

TEST(ParetoFrontTest, the_shipped_one_knows_the_error_of_every_preset) {
    const ParetoFront& front = shipped_front();
    for (const auto& [sensor, points] : front.points) {
        double last = 1;
        for (const auto& [name, preset] : preset_words) {
            const std::string wanted = configuration_of(preset).full_name();
            const auto is_it = [&](const BenchmarkPoint& point) { return point.configuration.full_name() == wanted; };
            const std::vector<BenchmarkPoint>& others = front.others.at(sensor);
            const auto on = std::ranges::find_if(points, is_it), off = std::ranges::find_if(others, is_it);
            ASSERT_TRUE(on != points.end() || off != others.end()) << wanted;
            const double rms = on != points.end() ? on->rms : off->rms;
            EXPECT_LT(rms, 1.01 * last) << name << ", " << name_of(sensor) << ": no worse than the preset before it";
            last = rms;
        }
    }
}

TEST(ConfigurationTest, each_is_accepted_and_unique) {
    std::set<std::string> names, of_methods;
    for (const Configuration& configuration : configurations()) {
        const auto setup = method_named(configuration.method).setup();
        EXPECT_NO_THROW(apply(configuration, *setup)) << configuration.full_name();
        EXPECT_TRUE(names.insert(configuration.full_name()).second) << configuration.full_name();
        of_methods.insert(configuration.method);
    }
    EXPECT_EQ(of_methods.size(), methods().size()) << "every method is measured";
}

TEST(ConfigurationTest, an_unknown_setting_is_reported_with_its_configuration) {
    const auto setup = method_named("cacao").setup();
    EXPECT_TRUE(says(refusal([&] { apply({"cacao", "odd", {{"colour", "red"}}}, *setup); }), "cacao odd"));
    EXPECT_TRUE(says(refusal([&] { apply({"cacao", "odd", {{"quality", "red"}}}, *setup); }), "cacao odd: quality"));
}

// ---------------------------------------------------------------------------------------------------- budgets

const std::vector<BenchmarkPoint> benchmark_points{point("cheap", 10, 0.2), point("middle", 20, 0.1),
                                                   point("dear", 90, 0.05)};

TEST(BudgetTest, an_error_limit_takes_the_cheapest_and_a_time_limit_the_most_accurate) {
    const std::vector<double> ms{1, 2, 9};
    EXPECT_EQ(pick(benchmark_points, ms, {.max_error = 0.15}), 1u);
    EXPECT_EQ(pick(benchmark_points, ms, {.max_error = 0.3}), 0u);
    EXPECT_EQ(pick(benchmark_points, ms, {.max_error = 0.05}), 2u);
    EXPECT_EQ(pick(benchmark_points, ms, {.max_ms = 8.9}), 1u);
    EXPECT_EQ(pick(benchmark_points, ms, {.max_ms = 100}), 2u);
    EXPECT_EQ(pick(benchmark_points, ms, {.max_error = 0.15, .max_ms = 100}), 2u);
}

TEST(BudgetTest, an_impossible_budget_is_refused_with_the_nearest_points) {
    const std::vector<double> ms{1, 2, 9};
    EXPECT_TRUE(
        says(refusal([&] { (void)pick(benchmark_points, ms, {.max_error = 0.01}); }), "the most accurate, m dear"));
    EXPECT_TRUE(says(refusal([&] { (void)pick(benchmark_points, ms, {.max_ms = 0.5}); }), "the fastest, m cheap"));
    EXPECT_TRUE(
        says(refusal([&] { (void)pick(benchmark_points, ms, {.max_error = 0.07, .max_ms = 5}); }), "RMSE 0.07, 5 ms"));
}

TEST_F(MeasureTest, a_budget_picks_reports_and_verifies) {
    const Ran ran = run_program(
        fmt::format("run {} -o {} --write ao,confidence --depth-noise none --max-ms 100000", capture(), out()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.err, "picked"));
    EXPECT_TRUE(says(ran.err, "to truth"));
    const std::vector<BenchmarkPoint>& points = shipped_front().points.at(SensorClass::clean);
    const auto best = std::ranges::min_element(points, {}, &BenchmarkPoint::rms);
    const json manifest = read(folder / "out/manifest.json");
    EXPECT_EQ(manifest["method"], best->configuration.method);
    EXPECT_FALSE(manifest["budget"].empty());
    const json settings = manifest["settings"]["method " + best->configuration.method];
    for (const auto& [name, value] : best->configuration.settings) {
        const json& used = settings[best->configuration.method + "." + name];
        EXPECT_EQ(used.is_string() ? used.get<std::string>() : used.dump(), value);
    }
}

TEST_F(MeasureTest, a_budget_that_nothing_keeps_is_misuse) {
    const Ran ran = run_program(fmt::format("run {} -o {} --max-error 0.0001", capture(), out()));
    EXPECT_EQ(ran.exit_code, 1);
    EXPECT_TRUE(says(ran.err, "the most accurate"));
    EXPECT_FALSE(fs::exists(folder / "out/manifest.json"));
    EXPECT_EQ(run_program(fmt::format("run {} -o {} --max-ms 50 --quality low", capture(), out())).exit_code, 1);
}

TEST(SensorClassTest, follows_the_noise) {
    EXPECT_EQ(class_of({}), SensorClass::clean);
    EXPECT_EQ(class_of({0.0015, 0.0018, 3}), SensorClass::structured_light);
    EXPECT_EQ(class_of({0.0012, 0.0005}), SensorClass::time_of_flight);
    EXPECT_EQ(class_of({0.0015, 0}), SensorClass::time_of_flight);
    EXPECT_EQ(class_of({0.00093, 0.00088, 3}), SensorClass::structured_light) << "7-Scenes, as measured";
    EXPECT_EQ(class_of({0, 0.0001}), SensorClass::clean);
    EXPECT_EQ(class_of({.floor_m = 0.0014, .per_z2 = 0.0003, .step_per_z2 = 0.0028}), SensorClass::structured_light)
        << "disparity's steps, whatever the noise";
    EXPECT_EQ(class_of({0.00113, 0.00125}), SensorClass::time_of_flight) << "no two pixels share a window";
    EXPECT_EQ(class_of({0.0012, 0.0003, 7}), SensorClass::interpolated);
    EXPECT_EQ(class_of({.jumps = Jumps::smeared}), SensorClass::interpolated);
}

} // namespace
} // namespace scanshade
