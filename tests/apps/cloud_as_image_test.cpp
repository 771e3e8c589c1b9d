// A frame of a depth sensor that was written as a cloud is computed as an image, whole or in part.
#include "io/captures/capture.h"
#include "projection/base/hash.h"
#include "tests/support/files.h"
#include "tests/support/small_capture.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using nlohmann::json;
using tests::read_bytes;
using tests::run_program;
namespace fs = std::filesystem;

class CloudAsImage : public testing::Test {
  protected:
    tests::TemporaryFolder folder;
};

TEST_F(CloudAsImage, has_the_camera_and_noise_of_the_frame_it_was) {
    const std::string scene = (folder / "scene").string(), image = (folder / "image").string(),
                      cloud = (folder / "cloud").string();
    ASSERT_EQ(run_program(fmt::format("generate office -o {} --frames 1 --size 160x120 --truth=no", scene)).exit_code,
              0);
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --write ao,cloud --radius 0.5", scene, image)).exit_code, 0);
    const std::string points = fs::directory_iterator(folder / "image/clouds")->path().string();
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --radius 0.5", points, cloud)).exit_code, 0);
    const json of_image = json::parse(read_bytes(folder / "image/manifest.json")),
               of_cloud = json::parse(read_bytes(folder / "cloud/manifest.json"));
    EXPECT_EQ(of_cloud["method"], of_image["method"]);
    EXPECT_NE(of_cloud["depth_noise"].get<std::string>().find("steps of 0.0028 z^2 m"), std::string::npos);
    EXPECT_NEAR(of_cloud["frames"][0]["mean_visibility"].get<double>(),
                of_image["frames"][0]["mean_visibility"].get<double>(), 0.002);
    const auto told = run_program("inspect " + points);
    EXPECT_NE(told.out.find("the pixels of one image"), std::string::npos) << told.out;
    const auto by_rays = run_program(fmt::format("run {} -o {} --overwrite --clouds points", points, cloud));
    EXPECT_NE(by_rays.err.find("rays from every point"), std::string::npos) << by_rays.err;
    const auto sky = run_program(fmt::format("run {} -o {} --overwrite --cloud.sky", points, cloud));
    EXPECT_NE(sky.err.find("rays from every point"), std::string::npos) << "an image has no sky: " << sky.err;
}

TEST_F(CloudAsImage, may_be_a_part_of_a_noisy_frame_in_any_order) {
    const std::string scene = (folder / "scene").string(), image = (folder / "image").string(),
                      part = (folder / "part.ply").string();
    ASSERT_EQ(run_program(fmt::format("generate office -o {} --frames 1 --size 320x240 --truth=no", scene)).exit_code,
              0);
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --write ao,cloud --radius 0.5", scene, image)).exit_code, 0);
    const auto points = open_capture(fs::directory_iterator(folder / "image/clouds")->path()).load(0).cloud->points;
    std::vector<std::string> rows;
    for (std::uint32_t i = 0; i < points.size(); ++i)
        if (const auto& p = points[i]; hash(i) % 2 == 0)
            rows.insert(rows.begin() + static_cast<std::ptrdiff_t>(hash(i, 1U) % (rows.size() + 1)),
                        fmt::format("{:.5f} {:.5f} {:.5f}\n", p.x(), p.y(), p.z()));
    ASSERT_GT(rows.size(), 30000u);
    std::ofstream(part) << fmt::format("ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
                                       "property float z\nend_header\n{}",
                                       rows.size(), fmt::join(rows, ""));
    const auto mean_of = [&](const char* flags) {
        const auto ran = run_program(
            fmt::format("run {} -o {} --overwrite --radius 0.5 {}", part, (folder / "out").string(), flags));
        EXPECT_LE(ran.exit_code, 2) << ran.err; // by rays it is doubtful
        return std::pair(
            json::parse(read_bytes(folder / "out/manifest.json"))["frames"][0]["mean_visibility"].get<double>(),
            ran.err);
    };
    const double expected = json::parse(read_bytes(folder / "image/manifest.json"))["frames"][0]["mean_visibility"];
    const auto [found, told] = mean_of("");
    EXPECT_NEAR(found, expected, 0.02);
    EXPECT_NE(told.find("points seen by one camera"), std::string::npos) << told;
    EXPECT_EQ(mean_of("--clouds points").second.find("points seen by one camera"), std::string::npos);
    EXPECT_EQ(mean_of("--clouds view").first, found) << "the noise is measured there, too";
}

} // namespace
} // namespace scanshade
