// The command compare: two runs, or one and the truth, as numbers and difference images.
#include "ao/compare.h"
#include "io/images/image_file.h"
#include "tests/support/measured.h"
#include "tests/support/says.h"

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

std::size_t files_in(const fs::path& folder) {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

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

TEST_F(MeasureTest, a_cloud_is_compared_with_its_truth_point_by_point) {
    const std::string cloud = (folder / "cloud").string();
    ASSERT_EQ(run_program(fmt::format("generate office --cloud 5000 -o {}", cloud)).exit_code, 0);
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --write cloud --page no --radius 0.5", cloud, out())).exit_code, 0);
    const Ran found = run_program(fmt::format("compare {} --truth --json", out()));
    ASSERT_EQ(found.exit_code, 0) << found.err;
    const json total = json::parse(found.out)["total"];
    EXPECT_GT(total["pixels"].get<double>(), 4900);
    EXPECT_LT(total["rms"].get<double>(), 0.2);
    EXPECT_GT(total["correlation"].get<double>(), 0.5);
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

} // namespace
} // namespace scanshade
