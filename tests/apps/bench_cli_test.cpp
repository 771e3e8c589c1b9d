// The command bench: its page and tables, and references with and without truth.
#include "ao/base/method.h"
#include "ao/compare.h"
#include "ao/gpu/device.h"
#include "apps/budget/front.h"
#include "apps/budget/fused_reference.h"
#include "tests/support/measured.h"
#include "tests/support/says.h"

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

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

} // namespace
} // namespace scanshade
