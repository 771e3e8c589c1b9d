// Recordings in an arbitrary unit, from end to end: nothing calls it metres, and the unit does not matter.
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "tests/support/colmap_workspace.h"
#include "tests/support/files.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <regex>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::Ran;
using tests::run_program;
using tests::says;
using tests::write_colmap;

/// Whether a text has a length in metres, such as "0.5 m" or "3 mm".
testing::AssertionResult tells_metres(const std::string& text) {
    std::smatch found;
    if (std::regex_search(text, found, std::regex(R"([0-9] m?m\b|metres)")))
        return testing::AssertionSuccess()
               << found.prefix().str().substr(found.prefix().length() > 60 ? found.prefix().length() - 60 : 0) << "["
               << found.str() << "]";
    return testing::AssertionFailure();
}

double mean_difference(const cv::Mat1f& a, const cv::Mat1f& b) {
    cv::Mat differences;
    cv::absdiff(a, b, differences);
    cv::patchNaNs(differences, 0);
    return cv::mean(differences)[0];
}

class ArbitraryUnit : public testing::Test {
  protected:
    void SetUp() override {
        if (!tests::program_is_built())
            GTEST_SKIP() << "no program";
    }
    [[nodiscard]] fs::path workspace(double unit) const {
        fs::path path = folder / fmt::format("in-{}-{}", unit, noise);
        if (!fs::exists(path))
            write_colmap(path, {.frames = 4, .unit = unit, .noise = noise});
        return path;
    }
    double noise = 0; ///< of depth, as a share of it
    Ran run(double unit, const std::string& flags, const std::string& out) const {
        return run_program(
            fmt::format("run '{}' -o '{}' {}", workspace(unit).string(), (folder / out).string(), flags));
    }
    [[nodiscard]] std::vector<cv::Mat1f> maps(const std::string& out) const {
        std::vector<cv::Mat1f> all;
        for (int i = 0; i < 4; ++i)
            all.push_back(read_ao(folder / out / "ao" / fmt::format("{}.jpg.png", i)));
        return all;
    }
    /// The mean of the points' absolute coordinates.
    [[nodiscard]] static double size_of(const fs::path& ply) {
        double sum = 0;
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(ply, warnings); // a capture might take its numbers for millimetres
        for (const Eigen::Vector3d& point : cloud.points)
            sum += point.cwiseAbs().sum();
        return sum / static_cast<double>(cloud.points.size());
    }
    tests::TemporaryFolder folder;
};

/// The law: all lengths times k change nothing but the lengths that are written. Noise is measured where there is some;
/// the clean corner has so few different depths that rounding decides whether they look like a sensor's steps.
TEST_F(ArbitraryUnit, a_unit_of_another_length_gives_the_same_visibility) {
    int runs = 0;
    for (const std::string flags : {"", "--preset balanced", "--sequence on --method surfel", "noisy"}) {
        noise = flags == "noisy" ? 0.004 : 0;
        std::vector<cv::Mat1f> first;
        double first_cloud = 0, first_frame = 0;
        for (const double unit : {1.0, 0.01, 100.0}) {
            const std::string out = fmt::format("out-{}", ++runs);
            const fs::path cloud = folder / (out + ".ply");
            const Ran ran = run(unit,
                                fmt::format("--write ao,cloud --cloud '{}' {}", cloud.string(),
                                            noise > 0 ? "--sequence on" : flags + " --depth-noise none"),
                                out);
            ASSERT_EQ(ran.exit_code, 0) << ran.err;
            EXPECT_EQ(ran.err.find("sigma") != std::string::npos, noise > 0) << ran.err;
            EXPECT_FALSE(tells_metres(ran.err));
            const std::vector<cv::Mat1f> found = maps(out);
            const double whole = size_of(cloud) / unit, frame = size_of(folder / out / "clouds/1.jpg.ply") / unit;
            if (first.empty()) {
                first = found;
                first_cloud = whole, first_frame = frame;
            }
            EXPECT_NEAR(whole, first_cloud, 1e-3 * first_cloud);
            EXPECT_NEAR(frame, first_frame, 1e-5 * first_frame);
            for (std::size_t i = 0; i < found.size(); ++i) {
                EXPECT_LT(mean_difference(found[i], first[i]), 1e-4) << flags << " unit " << unit << " frame " << i;
                EXPECT_EQ(cv::countNonZero(found[i] != found[i]), cv::countNonZero(first[i] != first[i]));
            }
        }
    }
}

TEST_F(ArbitraryUnit, nothing_is_told_in_metres_and_the_radius_is_explained) {
    const Ran ran = run(0.7, "", "out");
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_FALSE(tells_metres(ran.err + ran.out));
    EXPECT_TRUE(says(ran.err, "0.1 of the median depth of"));
    EXPECT_TRUE(says(ran.err, "the recording's unit is arbitrary"));
    const auto manifest = nlohmann::json::parse(tests::file_bytes(folder / "out/manifest.json"));
    EXPECT_TRUE(says(manifest["radius"].get<std::string>(), "0.1 of the median depth"));
    EXPECT_TRUE(manifest["capture"]["length_unit"]["arbitrary"].get<bool>());
    EXPECT_FALSE(manifest["settings"]["method cacao"].contains("cacao.radius"));
    EXPECT_FALSE(manifest["capture"]["depth"].contains("units_per_metre"));
    EXPECT_NEAR(manifest["frames"][2]["world_from_camera"][3].get<double>(), -0.02 * 0.7, 1e-6);
    EXPECT_TRUE(says(tests::file_bytes(folder / "out/index.html") + tests::file_bytes(folder / "out/index.js"),
                     "of the median depth of"));
    EXPECT_TRUE(says(tests::file_bytes(folder / "out/previews/0.jpg.js"), "\"unit\":\"units\""));
    const Ran inspected = run_program(fmt::format("inspect '{}'", workspace(0.7).string()));
    EXPECT_EQ(inspected.exit_code, 0);
    EXPECT_FALSE(tells_metres(inspected.out + inspected.err));
    EXPECT_TRUE(says(inspected.out, "an arbitrary unit"));
}

TEST_F(ArbitraryUnit, settings_in_metres_are_refused_unless_the_unit_is_given) {
    for (const std::string flag : {"--radius 0.4", "--cacao.radius 0.4", "--depth-range 0.1,5", "--depth-noise kinect",
                                   "--max-error 0.1", "--cloud all.ply --cloud-resolution 0.01"}) {
        const Ran refused = run(1, flag, "refused");
        EXPECT_EQ(refused.exit_code, 3) << flag << refused.err;
        EXPECT_TRUE(says(refused.err, "in metres, and its unit is arbitrary"));
        EXPECT_TRUE(says(refused.err, "--depth-scale UNITS_PER_METRE"));
    }
    const Ran unused = run(4, "--depth-scale 4 --relative-radius 0.3", "unused");
    EXPECT_TRUE(says(unused.err, "--relative-radius is not used"));
    const Ran metric = run(4, "--radius 0.4 --depth-scale 4", "metric");
    EXPECT_EQ(metric.exit_code, 0) << metric.err;
    EXPECT_EQ(metric.err.find("arbitrary"), std::string::npos) << metric.err;
}

TEST_F(ArbitraryUnit, a_relative_radius_is_the_same_as_one_in_metres_of_that_share) {
    // corner_depth's median depth in metres times 0.2, once the unit is known.
    const Capture capture = open_capture(workspace(3));
    const double median_units = capture.unit.told(capture.median_depth);
    ASSERT_EQ(run(3, "--relative-radius 0.2 --depth-noise none", "relative").exit_code, 0);
    ASSERT_EQ(run(3, fmt::format("--depth-scale 3 --depth-noise none --radius {}", 0.2 * median_units / 3), "metric")
                  .exit_code,
              0);
    const auto relative = maps("relative"), metric = maps("metric");
    for (std::size_t i = 0; i < relative.size(); ++i) {
        EXPECT_LT(mean_difference(relative[i], metric[i]), 1e-3);
    }
}

TEST_F(ArbitraryUnit, what_needs_metres_says_so) {
    const std::string in = "'" + workspace(1).string() + "'";
    for (const std::string& command : {"refine " + in + " -o '" + (folder / "camera.json").string() + "'",
                                       "bench " + in + " -o '" + (folder / "bench").string() + "'"}) {
        const Ran ran = run_program(command);
        EXPECT_NE(ran.exit_code, 0);
        EXPECT_TRUE(says(ran.err, "needs lengths in metres")) << command;
    }
}

TEST_F(ArbitraryUnit, frames_taken_do_not_change_the_radius) {
    ASSERT_EQ(run(1, "", "all").exit_code, 0);
    ASSERT_EQ(run(1, "--frames 2:3", "one").exit_code, 0);
    const auto radius = [&](const char* out) {
        return nlohmann::json::parse(tests::file_bytes(folder / out / "manifest.json"))["radius"].get<std::string>();
    };
    EXPECT_EQ(radius("all"), radius("one"));
}

} // namespace
} // namespace scanshade
