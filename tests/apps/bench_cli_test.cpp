// The commands compare, bench and calibrate-look, budgets of run, and the parts that they are made of.
#include "ao/compare.h"
#include "ao/gpu/device.h"
#include "apps/measure/bench_results.h"
#include "apps/measure/budget.h"
#include "apps/measure/configurations.h"
#include "apps/measure/fused_reference.h"
#include "apps/page/document.h"
#include "apps/run/presets.h"
#include "io/images/image_file.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <sstream>

namespace scanshade {
namespace {

using tests::Ran;
using tests::read_bytes;
using tests::refusal;
using tests::run_program;
using tests::says;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

/// A generated capture of two frames, 64x48, and a run of it. Both are made once.
class MeasureTest : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        ASSERT_EQ(
            run_program(
                fmt::format("generate office -o {} --sensor ideal --frames 2 --size 64x48 --truth-rays 16", capture()))
                .exit_code,
            0);
        ASSERT_EQ(run_program(fmt::format("run {} -o {} --write ao,confidence --depth-noise none", capture(), made()))
                      .exit_code,
                  0);
    }
    static void TearDownTestSuite() { shared_folder().reset(); }

    static std::unique_ptr<TemporaryFolder>& shared_folder() {
        static auto folder = std::make_unique<TemporaryFolder>();
        return folder;
    }
    static std::string capture() { return (*shared_folder() / "capture").string(); }
    static std::string made() { return (*shared_folder() / "made").string(); }
    [[nodiscard]] std::string out() const { return (folder / "out").string(); }
    [[nodiscard]] json read(const fs::path& file) const { return json::parse(read_bytes(file)); }

    TemporaryFolder folder;
};

std::size_t files_in(const fs::path& folder) {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

// ---------------------------------------------------------------------------------------------------- compare

TEST_F(MeasureTest, a_run_does_not_differ_from_itself) {
    const Ran ran = run_program(fmt::format("compare {0} {0} -o {1}", made(), out()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    const json report = read(folder / "out/compare.json");
    EXPECT_EQ(report["total"]["rms"], 0);
    EXPECT_EQ(report["total"]["ssim"], 1);
    EXPECT_EQ(report["images"].size(), 2u);
    EXPECT_EQ(files_in(folder / "out/difference"), 2u);
    const std::string csv = read_bytes(folder / "out/compare.csv");
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
}

TEST_F(MeasureTest, truth_is_found_from_the_run_or_in_the_capture) {
    const Ran by_itself = run_program(fmt::format("compare {} --truth -o {}", made(), out()));
    ASSERT_EQ(by_itself.exit_code, 0) << by_itself.err;
    const Ran named = run_program(fmt::format("compare {} {}", made(), capture()));
    EXPECT_EQ(named.exit_code, 0) << named.err;
    EXPECT_EQ(by_itself.out, named.out);
    // the same numbers from the maps themselves
    std::vector<Difference> images;
    for (const auto& file : fs::directory_iterator(fs::path(made()) / "ao")) {
        const fs::path truth = fs::path(capture()) / "truth/ao" / (file.path().stem().string() + ".tiff");
        images.push_back(compare(read_ao(file.path()), read_ao(truth)));
    }
    EXPECT_NEAR(read(folder / "out/compare.json")["total"]["rms"].get<double>(), total(images, {}).rms, 1e-6);
}

TEST_F(MeasureTest, errors_by_confidence_share_out_all_pixels) {
    ASSERT_EQ(run_program(fmt::format("compare {} --truth -o {}", made(), out())).exit_code, 0);
    const json report = read(folder / "out/compare.json");
    double pixels = 0, squares = 0, all = 0, all_squares = 0;
    for (const json& part : report["by_confidence"]) {
        pixels += part["pixels"].get<double>();
        squares += part["pixels"].get<double>() * std::pow(part["rms"].get<double>(), 2);
    }
    for (const json& image : report["images"]) {
        const double n = image["difference"]["pixels"].get<double>();
        all += n, all_squares += n * std::pow(image["difference"]["rms"].get<double>(), 2);
    }
    EXPECT_GT(report["by_confidence"].size(), 1u);
    EXPECT_EQ(pixels, all);
    EXPECT_NEAR(squares, all_squares, 1e-4 * all_squares);
}

TEST_F(MeasureTest, maps_of_another_radius_get_a_warning) {
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --write ao --radius 0.2", capture(), out())).exit_code, 0);
    EXPECT_TRUE(says(run_program(fmt::format("compare {} --truth", out())).err, "radius of 0.2 m, B with 0.5 m"));
}

TEST_F(MeasureTest, a_comparison_is_printed_as_json_when_asked) {
    const Ran ran = run_program(fmt::format("compare {} --truth --json -o {}", made(), out()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_EQ(json::parse(ran.out), read(folder / "out/compare.json")) << "and stdout holds nothing else";
}

TEST_F(MeasureTest, a_damaged_map_is_reported_and_the_others_are_compared) {
    fs::copy(made(), out(), fs::copy_options::recursive);
    const fs::path first = fs::directory_iterator(folder / "out/ao")->path();
    fs::resize_file(first, 40);
    const Ran ran = run_program(fmt::format("compare {} --truth", out()));
    EXPECT_EQ(ran.exit_code, 2);
    EXPECT_TRUE(says(ran.err, first.filename().string()));
    EXPECT_TRUE(says(ran.out, "all (rms over images)"));
}

TEST_F(MeasureTest, what_cannot_be_compared_is_refused_with_names) {
    EXPECT_EQ(run_program("compare " + made()).exit_code, 1);
    EXPECT_EQ(run_program(fmt::format("compare {} {}/nowhere", made(), made())).exit_code, 3);
    fs::create_directories(folder / "others");
    write_ao(folder / "others/somebody.png", cv::Mat1f(4, 4, 0.5F), AoFormat::png16);
    const Ran unpaired = run_program(fmt::format("compare {} {}", made(), (folder / "others").string()));
    EXPECT_EQ(unpaired.exit_code, 3);
    EXPECT_TRUE(says(unpaired.err, "somebody"));
    const Ran no_truth = run_program(fmt::format("compare {} --truth", (folder / "others").string()));
    EXPECT_EQ(no_truth.exit_code, 3);
    EXPECT_TRUE(says(no_truth.err, "manifest.json"));
}

TEST_F(MeasureTest, an_earlier_comparison_is_replaced_only_when_asked) {
    const std::string words = fmt::format("compare {0} {0} -o {1}", made(), out());
    ASSERT_EQ(run_program(words).exit_code, 0);
    EXPECT_EQ(run_program(words).exit_code, 1);
    EXPECT_EQ(run_program(words + " --overwrite").exit_code, 0);
}

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

// ---------------------------------------------------------------------------------------------------- places

/// A wall at 3 m, and before it at 2 m a board from column 20 to column 59 and a pole 3 pixels wide: at 525 pixels of
/// focal length 1.1 cm.
struct WallWithPole {
    Pinhole camera{525, 525, 59.5, 39.5, {120, 80}};
    cv::Mat1f z_m = cv::Mat1f(80, 120, 3.0F), truth = cv::Mat1f(80, 120, 1.0F);
    WallWithPole() {
        z_m.colRange(20, 60).setTo(2);
        z_m.colRange(90, 93).setTo(2);
    }
    [[nodiscard]] cv::Mat1b places(const cv::Mat1f& recorded) const {
        return by_place(z_m, recorded, truth, camera).of;
    }
};

TEST(PlaceTest, a_pole_is_thin_and_a_board_is_not) {
    const WallWithPole scene;
    const cv::Mat1b of = scene.places(scene.z_m);
    EXPECT_EQ(cv::countNonZero(of == thin_thing), 3 * 80) << "the pole, and nothing else";
    EXPECT_EQ(of(40, 91), thin_thing);
    EXPECT_EQ(of(40, 22), near_edge);
    EXPECT_EQ(of(40, 40), open_flat) << "20 pixels from the board's edges";
}

TEST(PlaceTest, the_first_class_that_fits_counts) {
    WallWithPole scene;
    cv::Mat1f recorded = scene.z_m.clone();
    recorded(cv::Rect(38, 38, 2, 2)).setTo(0);
    scene.truth(42, 41) = 0.1F; // in a corner beside the hole
    scene.truth(42, 36) = std::nanf("");
    const cv::Mat1b of = scene.places(recorded);
    EXPECT_EQ(of(40, 36), near_hole);
    EXPECT_EQ(of(42, 41), deep_corner);
    EXPECT_EQ(of(42, 36), PixelClasses::none) << "nothing to compare with";
    EXPECT_EQ(of(40, 45), open_flat) << "6 pixels from the hole";
    scene.truth.setTo(0.5);
    EXPECT_EQ(scene.places(scene.z_m)(40, 40), between_them);
    EXPECT_EQ(cv::countNonZero(scene.places(scene.z_m) == near_hole), 0)
        << "where there is no hole, nothing is near one";
}

TEST(PairSumsTest, knows_the_bias_that_a_curve_leaves) {
    PairSums pairs;
    for (int i = 0; i < 100; ++i)
        pairs.add(0.5F, 0.2F);
    EXPECT_NEAR(pairs.bias({}), 0.3, 1e-6);
    EXPECT_NEAR(pairs.bias({1, 2}), 0.25 - 0.2, 1e-6);
    EXPECT_TRUE(std::isnan(PairSums().bias({})));
}

// ---------------------------------------------------------------------------------------------------- bench

TEST_F(MeasureTest, a_curve_of_the_other_captures_is_judged_on_each) {
    const std::string other = (folder / "other").string();
    ASSERT_EQ(
        run_program(fmt::format("generate thin -o {} --sensor ideal --frames 2 --size 64x48 --truth-rays 16", other))
            .exit_code,
        0);
    ASSERT_EQ(run_program(fmt::format("bench {} {} -o {} --frames 2 --rounds 1 --depth-noise none --methods luna "
                                      "--pictures 32",
                                      capture(), other, out()))
                  .exit_code,
              0);
    const json report = read(folder / "out/bench.json");
    double squares = 0, pixels = 0;
    for (int k : {0, 1}) {
        const json &own = report["captures"][k]["configurations"][0],
                   &rest = report["captures"][1 - k]["configurations"][0];
        EXPECT_NEAR(own["held_out"]["strength"].get<double>(), rest["difference"]["strength"].get<double>(), 1e-4)
            << "of two captures each has the best curve of the other";
        EXPECT_GE(own["held_out"]["rms"].get<double>(), own["difference"]["calibrated_rms"].get<double>() - 1e-6);
        const double n = own["difference"]["pixels"].get<double>();
        squares += n * std::pow(own["held_out"]["rms"].get<double>(), 2), pixels += n;
        EXPECT_TRUE(fs::exists(folder / "out" / own["picture"].get<std::string>()));
    }
    const json& all = report["groups"][0]["configurations"][0];
    EXPECT_NEAR(all["held_out"]["rms"].get<double>(), std::sqrt(squares / pixels), 1e-5);
    double placed = 0, placed_squares = 0;
    for (const json& part : all["errors"]["place"])
        if (part["pixels"] > 0) {
            placed += part["pixels"].get<double>();
            placed_squares += part["pixels"].get<double>() * std::pow(part["held_out_rms"].get<double>(), 2);
        }
    EXPECT_EQ(placed, pixels) << "every pixel has one place";
    EXPECT_NEAR(placed_squares, squares, 1e-3 * squares) << "to within the steps of the sums";
    EXPECT_TRUE(fs::exists(folder / "out/pictures/1-truth.jpg"));
    EXPECT_TRUE(fs::exists(folder / "out/pictures/1-0-difference.jpg"));
}

TEST_F(MeasureTest, bench_leaves_one_page_with_everything_in_it) {
    const Ran ran =
        run_program(fmt::format("bench {} -o {} --frames 2 --rounds 2 --depth-noise none --methods cacao --front {}",
                                capture(), out(), (folder / "front.json").string()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.out, "cacao high"));
    std::string html = read_bytes(folder / "out/index.html");
    const std::string plot = read_bytes(folder / "out/clean.svg"); // complete by itself: its own name space and style
    EXPECT_TRUE(plot.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\"")) << plot.substr(0, 80);
    EXPECT_TRUE(says(plot, ".ring {") && says(plot, "Speed against error, clean depth") && says(plot, "</svg>"));
    for (const char* part : {"<svg", "Speed against error", "Error by capture", "distance from depth edges", "range",
                             "angle to the surface", "class=\"ring\"", "data:image/png;base64,", "quality=high"})
        EXPECT_TRUE(html.find(part) != std::string::npos) << part;
    const std::string own = "<link rel=\"icon\" href=\"data:,\">"; // no icon, so that no browser asks for one
    ASSERT_TRUE(says(html, own));
    html.erase(html.find(own), own.size());
    for (const char* foreign : {"src=\"http", "href=", "<script", "<link"})
        EXPECT_EQ(html.find(foreign), std::string::npos) << "the page stands alone";
    const json report = read(folder / "out/bench.json");
    std::size_t on_the_front = 0, of_cacao = 0;
    for (const json& row : report["groups"][0]["configurations"]) {
        EXPECT_GT(row["device_ms"]["median"], 0);
        EXPECT_GE(row["wall_ms"]["least"], 0);
        EXPECT_GT(row["difference"]["rms"], 0);
        on_the_front += row["front"].get<bool>() ? 1 : 0;
        ++of_cacao;
    }
    EXPECT_GE(on_the_front, 1u);
    const ParetoFront front = front_from(read(folder / "front.json"), "front.json");
    EXPECT_EQ(front.points.at(SensorClass::clean).size(), on_the_front);
    const std::string csv = read_bytes(folder / "out/bench.csv");
    EXPECT_EQ(static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')), 1 + 2 * of_cacao);
    // errors by class are the same pixels sorted: their sums of squares make up the whole
    const json& row = report["captures"][0]["configurations"][0];
    double pixels = 0, squares = 0;
    for (const json& part : row["errors"]["range"])
        if (!part["rms"].is_null()) {
            pixels += part["pixels"].get<double>();
            squares += part["pixels"].get<double>() * part["rms"].get<double>() * part["rms"].get<double>();
        }
    EXPECT_NEAR(std::sqrt(squares / pixels), row["difference"]["rms"].get<double>(), 2e-4);
}

/// Whether the method shows its visibility by a curve that was fitted at each quality.
bool has_fitted_curve(const MethodRow& method) {
    const auto setup = method.setup();
    return row_named(setup->parameters(), "curve") != nullptr;
}

// Views that no curve was fitted to. With one curve for all qualities abao at high and highest was too dark, and worse
// than at medium.
TEST_F(MeasureTest, a_higher_quality_is_no_worse_with_the_curve_of_each) {
    std::string names;
    for (const MethodRow& method : methods())
        if (has_fitted_curve(method))
            names += fmt::format("{}{}", names.empty() ? "" : ",", method.name);
    const std::string words =
        "bench --generated --scenes office,clutter,thin --sensor ideal,kinect,tof --frames 1 --first 33 --size 240x180 "
        "--truth-rays 64 --rounds 1 --methods {} -o {}";
    ASSERT_EQ(run_program(fmt::format(fmt::runtime(words), names, out())).exit_code, 0);
    const json report = read(folder / "out/bench.json");
    EXPECT_EQ(report["groups"].size(), 3u);
    for (const json& group : report["groups"]) {
        std::map<std::string, std::vector<double>> errors; // by method and profile, the cheapest quality first
        for (const json& row : group["configurations"]) {
            const std::string name = row["name"], profile = name.substr(std::min(name.find(','), name.size()));
            if (name.find("interleaved") == std::string::npos)
                errors[row["method"].get<std::string>() + profile].push_back(row["difference"]["rms"]);
        }
        EXPECT_GE(errors.size(), 6u);
        for (const auto& [name, rms] : errors) {
            ASSERT_EQ(rms.size(), 5u) << name;
            for (std::size_t i = 1; i < rms.size(); ++i)
                EXPECT_LT(rms[i], rms[i - 1] + 0.003) << name << ", quality " << i << " of 0 .. 4, " << group["sensor"];
        }
    }
}

TEST(FusedReferenceTest, comes_closer_to_truth_than_rays_against_one_depth_image) {
    const TemporaryFolder folder;
    const std::string capture = (folder / "capture").string();
    ASSERT_EQ(
        run_program(fmt::format("generate office -o {} --sensor ideal --frames 6 --step 4 --size 160x120", capture))
            .exit_code,
        0);
    gpu::Device device;
    TrialRequest request;
    request.frames = 2;
    request.depth_noise = "none";
    const TrialCapture trial = load_trial(capture, request);
    const FusedReference fused(device, capture, trial, {});
    Trial one_view(device, {"raycast", "", {}}, trial.noise, trial.radius_m);
    std::vector<Difference> of_fused, of_one_view;
    for (const TrialFrame& frame : trial.frames) {
        of_fused.push_back(compare(fused.visibility(frame), frame.truth));
        of_one_view.push_back(compare(one_view.compute(frame), frame.truth));
    }
    EXPECT_LT(total(of_fused, {}).rms, total(of_one_view, {}).rms);
    EXPECT_GT(total(of_fused, {}).pixels, 0.9 * 2 * 160 * 120);
    RecordProperty("rms_fused", fmt::format("{:.4f}", total(of_fused, {}).rms));
}

TEST_F(MeasureTest, without_truth_all_posed_frames_together_are_the_reference) {
    const fs::path recorded = folder / "recorded";
    fs::copy(capture(), recorded, fs::copy_options::recursive);
    fs::remove_all(recorded / "truth");
    const std::string words = "bench {} -o {} --frames 2 --rounds 1 --depth-noise none --methods raycast";
    const Ran ran = run_program(fmt::format(fmt::runtime(words), recorded.string(), out()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    const json report = read(folder / "out/bench.json");
    EXPECT_TRUE(says(report["captures"][0]["reference"].get<std::string>(), "fused of 2 posed frames"));
    EXPECT_TRUE(says(read_bytes(folder / "out/index.html"), "no truth")) << "the page says what it compares with";
    fs::remove(recorded / "groundtruth.txt");
    const Ran lost = run_program(fmt::format(fmt::runtime(words), recorded.string(), out() + "2"));
    EXPECT_EQ(lost.exit_code, 3);
    EXPECT_TRUE(says(lost.err, "0 frames with poses"));
}

TEST_F(MeasureTest, bench_parts_print_what_they_measure) {
    const auto printed = [&](const std::string& flags) {
        const Ran ran = run_program("bench " + flags);
        EXPECT_EQ(ran.exit_code, 0) << flags << "\n" << ran.err;
        return ran.out;
    };
    EXPECT_TRUE(says(printed("--hard-cases --hard-cases.only units --hard-cases.methods gtao"), "every gate kept"));
    EXPECT_TRUE(says(printed("--cacao --cacao.sizes 64x48,48x64 --cacao.repeat 1 --cacao.passes"), "48x64"));
    EXPECT_TRUE(says(printed("--clouds --clouds.points 3000 --clouds.rays 2,4"), "4 rays a point"));
    const fs::path tables = folder / "errors.txt";
    EXPECT_TRUE(says(printed(fmt::format("--expected-errors {} --expected-errors.together --expected-errors.methods "
                                         "surfel --expected-errors.frames 1 --expected-errors.fit {}",
                                         capture(), tables.string())),
                     "| surfel | "));
    const std::string fitted = read_bytes(tables);
    EXPECT_TRUE(says(fitted, "\ntogether surfel ")) << fitted;
    EXPECT_TRUE(says(fitted, "\nspread gtao ")) << "the others' lines stay";
    const fs::path maps = folder / "maps";
    (void)printed(fmt::format("--write-maps {}", maps.string()));
    EXPECT_TRUE(says(printed(fmt::format("--compare-maps {}", maps.string())), "highest_downsampled"));
}

TEST_F(MeasureTest, maps_of_two_devices_that_differ_too_much_give_exit_code_2) {
    const fs::path maps = folder / "maps";
    ASSERT_EQ(run_program(fmt::format("bench --write-maps {}", maps.string())).exit_code, 0);
    fs::copy_file(maps / "lowest_native.f32", maps / "high_downsampled.f32", fs::copy_options::overwrite_existing);
    const Ran ran = run_program(fmt::format("bench --compare-maps {}", maps.string()));
    EXPECT_EQ(ran.exit_code, 2);
    EXPECT_TRUE(says(ran.out, "MISSED"));
}

TEST_F(MeasureTest, bench_measures_one_part_at_a_time) {
    EXPECT_EQ(run_program("bench --normals --hard-cases").exit_code, 1);
    EXPECT_EQ(run_program(fmt::format("bench {} --normals", capture())).exit_code, 1);
    EXPECT_EQ(run_program("bench --clouds --clouds.rays 8,some").exit_code, 1);
    EXPECT_EQ(run_program("bench --cacao --cacao.sizes 640").exit_code, 1);
}

/// RMSE of a method's configuration on a capture, from bench.csv.
double rmse_in(const std::string& csv, const std::string& capture, const std::string& configuration) {
    const std::string wanted = fmt::format("clean,{},surfel,{},", capture, configuration);
    const auto row = csv.find("\n" + wanted);
    if (row == std::string::npos)
        return std::nan("");
    std::istringstream cells(csv.substr(row + 1, csv.find('\n', row + 1) - row - 1));
    std::string cell;
    for (int column = 0; column < 14; ++column)
        std::getline(cells, cell, ',');
    return std::stod(cell);
}

TEST_F(MeasureTest, more_slices_of_surfel_have_less_error_in_every_scene) {
    const Ran ran =
        run_program(fmt::format("bench --generated --scenes office,clutter,thin --sensor ideal --frames 1 "
                                "--first 20 --size 200x150 --truth-rays 64 --rounds 1 --methods surfel -o {}",
                                out()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    const std::string csv = read_bytes(folder / "out/bench.csv");
    for (const char* capture : {"office-ideal", "clutter-ideal", "thin-ideal"}) {
        const double high = rmse_in(csv, capture, "high"), highest = rmse_in(csv, capture, "highest");
        EXPECT_LT(highest, high) << capture;
    }
}

TEST_F(MeasureTest, bench_needs_truth_and_something_to_do) {
    EXPECT_EQ(run_program(fmt::format("bench -o {}", out())).exit_code, 1);
    EXPECT_EQ(run_program(fmt::format("bench {}", capture())).exit_code, 1);
    const Ran odd = run_program(fmt::format("bench {} -o {} --methods guess", capture(), out()));
    EXPECT_EQ(odd.exit_code, 1);
    EXPECT_TRUE(says(odd.err, "cacao"));
}

TEST(ErrorClassTest, the_pixels_at_a_step_are_the_nearest_to_an_edge) {
    cv::Mat1f z_m(20, 40, 1.0F);
    z_m.colRange(20, 40) = 2.0F;
    const PixelClasses classes = by_edge_distance(z_m);
    EXPECT_EQ(classes.of(10, 19), 0);
    EXPECT_EQ(classes.of(10, 20), 0);
    EXPECT_EQ(classes.names[classes.of(10, 18)], "1 .. 2 px");
    EXPECT_EQ(classes.names[classes.of(10, 5)], "8 .. 16 px");
    z_m(3, 3) = 0;
    EXPECT_EQ(by_edge_distance(z_m).of(3, 3), PixelClasses::none);
    EXPECT_EQ(by_edge_distance(z_m).of(3, 4), 0) << "depth ends at a hole";
}

/// A plane through (0, 0, 2) whose normal is tilted by `degrees` from the optical axis.
cv::Mat1f tilted_plane(const Pinhole& camera, double degrees) {
    const double slope = std::tan(degrees * std::numbers::pi / 180);
    cv::Mat1f z_m(camera.size);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 0; u < z_m.cols; ++u)
            z_m(v, u) = static_cast<float>(2 / (1 - slope * camera.ray(u, v).x()));
    return z_m;
}

TEST(ErrorClassTest, a_tilted_plane_has_its_angle_and_no_edges) {
    const Pinhole camera{500, 500, 31.5, 23.5, {64, 48}};
    const cv::Mat1f z_m = tilted_plane(camera, 52); // rays are up to 4 degrees off the axis: 48 .. 56
    const PixelClasses angles = by_grazing_angle(z_m, camera), edges = by_edge_distance(z_m);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 8; u < z_m.cols - 8; ++u) {
            EXPECT_EQ(angles.names[angles.of(v, u)], "45 .. 60 deg");
            EXPECT_EQ(edges.of(v, u), edges.names.size() - 1);
        }
}

// ---------------------------------------------------------------------------------------------------- pages

TEST(PageTest, ticks_are_round_and_within_the_range) {
    EXPECT_EQ(page::round_ticks(0, 10, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
    for (const auto& [low, high] : {std::pair(0.013, 0.31), std::pair(-3.0, 8.5), std::pair(1e4, 7e6)}) {
        const std::vector<double> ticks = page::round_ticks(low, high, 6);
        EXPECT_GE(ticks.size(), 3u);
        EXPECT_LE(ticks.size(), 12u);
        EXPECT_GE(ticks.front(), low - 1e-9 * high);
        EXPECT_LE(ticks.back(), high * (1 + 1e-9));
    }
}

TEST(PageTest, words_cannot_break_out_of_a_page) {
    const std::string html = page::document("a < b", {{"\"quoted\" & more", page::table({"<h>"}, {{"<td>"}})}});
    for (const char* part : {"a &lt; b", "&quot;quoted&quot; &amp; more", "&lt;h&gt;", "&lt;td&gt;"})
        EXPECT_TRUE(says(html, part));
}

TEST(PageTest, a_plot_shows_each_finite_point_and_no_other) {
    page::Plot plot{
        "t",
        "x",
        "y",
        {{"s", {{1, 2, "one"}, {10, std::nan(""), "lost"}, {0, 1, "not on a log axis"}, {100, 3, "two", true}}}},
        true};
    const std::string drawn = page::svg(plot);
    EXPECT_TRUE(says(drawn, "<title>one</title>"));
    EXPECT_TRUE(says(drawn, "<title>two</title>"));
    EXPECT_EQ(drawn.find("lost"), std::string::npos);
    EXPECT_EQ(drawn.find("not on"), std::string::npos);
    EXPECT_TRUE(says(drawn, "class=\"ring\""));
    EXPECT_EQ(drawn.find("nan"), std::string::npos);
    EXPECT_EQ(page::svg({"empty", "x", "y", {}, true}).find("nan"), std::string::npos);
}

// ---------------------------------------------------------------------------------------------------- calibrate-look

TEST_F(MeasureTest, a_fit_is_no_worse_on_its_captures_and_run_takes_it) {
    const std::string file = (folder / "look.json").string();
    const Ran ran = run_program(fmt::format("calibrate-look {} --free shadow-multiplier,shadow-power --evaluations 8 "
                                            "--depth-noise none --frames 2 -o {}",
                                            capture(), file));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.err, "no --held-out")) << "what was not tested is said";
    const json fitted = read(file);
    const json all = fitted["training"].back();
    EXPECT_EQ(all["capture"], "all");
    EXPECT_LE(all["rms_after"].get<double>(), all["rms_before"].get<double>());
    const double multiplier = fitted["settings"]["method cacao"]["cacao.shadow-multiplier"];
    const double power = fitted["settings"]["method cacao"]["cacao.shadow-power"];

    const Ran used = run_program(
        fmt::format("run {} -o {} --write ao --settings {} --cacao.shadow-power 2", capture(), out(), file));
    ASSERT_EQ(used.exit_code, 0) << used.err;
    const json settings = read(folder / "out/manifest.json")["settings"]["method cacao"];
    EXPECT_NEAR(settings["cacao.shadow-multiplier"].get<double>(), multiplier, 1e-5);
    EXPECT_EQ(settings["cacao.shadow-power"], 2) << "flags win over the file's " << power;

    const Ran again =
        run_program(fmt::format("run {} -o {}/again --write ao --settings {}/manifest.json", capture(), out(), out()));
    ASSERT_EQ(again.exit_code, 0) << again.err;
    EXPECT_EQ(read(folder / "out/again/manifest.json")["settings"]["method cacao"], settings)
        << "a manifest serves, too";
}

TEST_F(MeasureTest, a_single_setting_can_be_fitted) {
    const std::string file = (folder / "curve.json").string();
    const Ran ran = run_program(fmt::format("calibrate-look {} --method ssdo --free curve --ssdo.curve 0.5 "
                                            "--depth-noise none --evaluations 12 --frames 1 -o {}",
                                            capture(), file));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    const json fitted = read(file), all = fitted["training"].back();
    EXPECT_LT(all["rms_after"].get<double>(), all["rms_before"].get<double>());
    EXPECT_GT(fitted["settings"]["method ssdo"]["ssdo.curve"].get<double>(), 0.6);
}

TEST_F(MeasureTest, a_fit_refuses_what_it_cannot_do) {
    const std::string file = (folder / "look.json").string();
    for (const char* flags : {"--free quality", "--free beauty", "", "--free shadow-power --held-out"})
        EXPECT_EQ(run_program(fmt::format("calibrate-look {} -o {} {}", capture(), file, flags)).exit_code, 1) << flags;
    const Ran same =
        run_program(fmt::format("calibrate-look {0} -o {1} --free shadow-power --held-out {0}", capture(), file));
    EXPECT_EQ(same.exit_code, 1);
    EXPECT_TRUE(says(same.err, "training capture"));
    tests::write_capture(folder / "recorded", 1);
    const Ran none =
        run_program(fmt::format("calibrate-look {} -o {} --free shadow-power", (folder / "recorded").string(), file));
    EXPECT_EQ(none.exit_code, 3);
    EXPECT_TRUE(says(none.err, "truth/ao"));
}

TEST_F(MeasureTest, a_file_that_holds_no_settings_is_refused) {
    std::ofstream(folder / "odd.json") << "{\"settings\": {\"method cacao\": {\"cacao.colour\": 3}}}";
    std::ofstream(folder / "no.json") << "settings";
    for (const char* file : {"odd.json", "no.json", "nowhere.json"})
        EXPECT_EQ(run_program(fmt::format("run {} -o {} --settings {}", capture(), out(), (folder / file).string()))
                      .exit_code,
                  1)
            << file;
    std::ofstream(folder / "mistyped.json") << R"({"settings": {"method cacao": {"cacao.raduis": 0.3}}})";
    const Ran mistyped =
        run_program(fmt::format("run {} -o {} --settings {}", capture(), out(), (folder / "mistyped.json").string()));
    EXPECT_TRUE(says(mistyped.err, "--cacao.raduis: no such flag; did you mean --cacao.radius?")) << mistyped.err;
}

} // namespace
} // namespace scanshade
