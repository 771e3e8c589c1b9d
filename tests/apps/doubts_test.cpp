// A result that is implausible is doubtful, with reasons, wherever the result is told; a plausible one is not.
#include "apps/doubts/checks.h"
#include "apps/frame/frame_steps.h"
#include "apps/frame/point_clouds.h"
#include "apps/walk/batch.h"
#include "io/cameras/camera_file.h"
#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/small_capture.h"

#include <algorithm>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using nlohmann::json;
using tests::read_bytes;
using tests::run_program;
using tests::TemporaryFolder;
using tests::warned;
namespace fs = std::filesystem;

constexpr float hole = std::numeric_limits<float>::quiet_NaN();

/// A computed frame of two walls, half open, with nothing to doubt. Tests spoil one part of it.
struct Computed {
    CaptureEntry entry;
    FrameRow row;
    Work work{.entry = entry, .row = row};
    double radius_m = 0.5;
    DepthNoise noise{};

    Computed() {
        row.valid_share = 0.9;
        row.coverage = 0.99;
        row.camera = tests::small_camera();
        work.depth = {row.camera.pinhole, tests::corner_depth(0), {}};
        work.ao.visibility = cv::Mat1f(work.depth.z_m.size(), 0.5F);
    }
    [[nodiscard]] std::vector<std::string> doubts() const {
        return doubts_in(findings_about(computed_frame(work), radius_m, noise));
    }
    [[nodiscard]] std::vector<std::string> warnings() const {
        return warnings_in(findings_about(computed_frame(work), radius_m, noise));
    }
};

/// The same of a cloud: a square of 40 x 40 points, 10 cm apart.
struct ComputedCloud : Computed {
    ComputedCloud() {
        Cloud cloud;
        for (int i = 0; i < 1600; ++i)
            cloud.points.emplace_back(0.1 * (i % 40), 0.1 * (i / 40), 0); // NOLINT(bugprone-integer-division)
        cloud.grid = {1600, 1};
        work.frame.cloud = cloud;
        work.by_points = true;
        work.of_points.visibility.assign(1600, 0.5F);
        work.of_points.radius = 1;
        work.of_points.spacing = 0.1;
        row.valid_share = row.coverage = 1;
    }
};

TEST(doubts, a_plausible_result_has_none) {
    EXPECT_TRUE(Computed().doubts().empty()) << tests::joined(Computed().doubts());
    EXPECT_TRUE(ComputedCloud().doubts().empty()) << tests::joined(ComputedCloud().doubts());
}

TEST(doubts, few_pixels_with_a_depth_or_a_value) {
    Computed few;
    few.row.valid_share = 0.19;
    const cv::Mat1f whole = few.work.depth.z_m.clone();
    for (int v = 0; v < whole.rows; ++v)
        for (int u = 0; u < whole.cols; ++u)
            if ((7 * u + 13 * v) % 5 != 0)
                few.work.depth.z_m(v, u) = 0;
    EXPECT_TRUE(warned(few.warnings(), "only 19.0 % of the pixels hold a depth"));
    EXPECT_FALSE(warned(few.doubts(), "hold a depth")) << "holes cost precision";
    EXPECT_TRUE(warned(few.doubts(), "only 0 % of the valid pixels have a valid one")) << "these pixels stand alone";
    few.work.depth.z_m = whole;
    few.row.valid_share = 0.21;
    EXPECT_TRUE(few.warnings().empty());
    few.row.coverage = 0.1;
    EXPECT_TRUE(warned(few.doubts(), "only 10.0 % of the valid pixels got a value"));
    few.row.valid_share = 0;
    EXPECT_TRUE(warned(few.doubts(), "no pixel holds a valid depth"));
}

TEST(doubts, an_object_cut_out_of_its_background_is_no_reason) {
    Computed object;
    object.row.valid_share = 0.05;
    cv::Mat1f& z = object.work.depth.z_m;
    z.colRange(0, z.cols / 2).setTo(0);
    z.rowRange(0, z.rows / 2).setTo(0);
    EXPECT_TRUE(object.doubts().empty()) << tests::joined(object.doubts());
    EXPECT_TRUE(object.warnings().empty()) << tests::joined(object.warnings());
}

TEST(doubts, noise_as_large_as_the_radius) {
    Computed noisy;
    noisy.noise = {0.01, 0.002}; // a Kinect's at such distances
    EXPECT_TRUE(noisy.warnings().empty()) << tests::joined(noisy.warnings());
    noisy.radius_m = 0.05;
    EXPECT_TRUE(warned(noisy.warnings(), "noise is above a quarter of the radius"));
    EXPECT_FALSE(warned(noisy.doubts(), "noise is above")) << "noise costs precision";
}

TEST(doubts, depths_in_steps_that_the_radius_feels) {
    Computed stairs;
    stairs.noise.step_m = 0.01; // whole centimetres
    EXPECT_TRUE(stairs.doubts().empty()) << tests::joined(stairs.doubts());
    stairs.noise.step_m = 0.018; // 4.6 m in 8 bits
    EXPECT_TRUE(warned(stairs.doubts(), "depths come in steps of 0.018 m, 4 % of the radius"));
    stairs.radius_m = 1;
    EXPECT_TRUE(stairs.doubts().empty()) << tests::joined(stairs.doubts());
}

TEST(doubts, a_sparse_grid_of_a_cloud_computed_from_its_points_is_no_reason) {
    ComputedCloud cropped; // an object cut out of an organised cloud: the rest of the grid is NaN
    cropped.work.frame.cloud->grid = {40, 40};
    cropped.row.valid_share = 0.05;
    EXPECT_TRUE(cropped.doubts().empty()) << tests::joined(cropped.doubts());
}

TEST(doubts, values_that_are_all_exactly_open_or_closed) {
    for (const float value : {0.0F, 1.0F}) {
        Computed alike;
        alike.work.ao.visibility = cv::Mat1f(alike.work.depth.z_m.size(), value);
        alike.work.ao.visibility.row(0) = hole;
        EXPECT_TRUE(warned(alike.doubts(), fmt::format("every value is exactly {}", value)));
        alike.work.ao.visibility.row(1) = 0.9F;
        EXPECT_TRUE(alike.doubts().empty()) << "one row of 48 differs";
        ComputedCloud cloud;
        cloud.work.of_points.visibility.assign(1600, value);
        EXPECT_TRUE(warned(cloud.doubts(), fmt::format("every value is exactly {}", value)));
    }
}

TEST(doubts, flat_and_convex_things_may_be_open_everywhere) {
    Computed wall;
    wall.work.ao.visibility = cv::Mat1f(wall.work.depth.z_m.size(), 1.0F);
    for (int v = 0; v < wall.work.depth.z_m.rows; ++v)
        for (int u = 0; u < wall.work.depth.z_m.cols; ++u)
            wall.work.depth.z_m(v, u) = static_cast<float>(1 / (0.5 + 0.002 * u + 0.001 * v));
    EXPECT_TRUE(wall.doubts().empty()) << tests::joined(wall.doubts());
    ComputedCloud square;
    square.work.of_points.visibility.assign(1600, 1.0F);
    square.work.of_points.normals.assign(1600, Eigen::Vector3f::UnitZ());
    EXPECT_TRUE(square.doubts().empty()) << tests::joined(square.doubts());
    for (int i = 0; i < 400; ++i) // what stands on it is a reason again
        square.work.frame.cloud->points[4 * i].z() = 0.3;
    EXPECT_TRUE(warned(square.doubts(), "every value is exactly 1"));
}

TEST(doubts, pixels_that_stand_alone_in_one_direction) {
    Computed lines;
    lines.row.valid_share = 0.3;
    for (int v = 0; v < lines.work.depth.z_m.rows; ++v)
        if (v % 3 != 0)
            lines.work.depth.z_m.row(v).setTo(0);
    EXPECT_TRUE(warned(lines.doubts(), "valid one above or below them"));
}

TEST(doubts, a_camera_of_the_image_before_it_was_turned) {
    Computed frame;
    Pinhole& pinhole = frame.row.camera.pinhole;
    pinhole.cx = (pinhole.size.height - 1) / 2.0;
    pinhole.cy = (pinhole.size.width - 1) / 2.0;
    EXPECT_TRUE(warned(frame.doubts(), "before it was turned"));
}

TEST(doubts, a_radius_below_two_pixels_or_above_the_scene) {
    Computed frame; // walls about 1.7 m away: 52 px of focal length make 2 px 6.5 cm
    frame.radius_m = 0.05;
    EXPECT_TRUE(warned(frame.doubts(), "spans 1."));
    frame.radius_m = 0.1;
    EXPECT_TRUE(frame.doubts().empty());
    frame.radius_m = 5;
    EXPECT_TRUE(warned(frame.doubts(), "larger than the scene"));
    frame.radius_m = 1.6; // the scene measures 3 m: balls around its middle end outside the view
    EXPECT_TRUE(warned(frame.doubts(), "larger than half the scene"));
    ComputedCloud cloud;
    cloud.work.of_points.radius = 0.15;
    EXPECT_TRUE(warned(cloud.doubts(), "only 1.5 times the points' spacing"));
    cloud.work.of_points.radius = 8;
    EXPECT_TRUE(warned(cloud.doubts(), "larger than the cloud"));
}

TEST(doubts, a_camera_that_no_sensor_has) {
    Computed frame;
    frame.row.camera.pinhole.fx = 1e30;
    EXPECT_TRUE(warned(frame.doubts(), "pixels are 1.92e+28 times as long as wide"));
    frame.row.camera.pinhole.fy = 1e30;
    EXPECT_TRUE(warned(frame.doubts(), "sees an angle of"));
    frame.row.camera = tests::small_camera();
    frame.row.camera.distortion.k1 = -5;
    EXPECT_TRUE(warned(frame.doubts(), "folds back within the image"));
    frame.row.camera.distortion = {.k1 = 0.2624, .k2 = -0.9531, .p1 = -0.0054, .p2 = 0.0026, .k3 = 1.1633};
    EXPECT_TRUE(frame.doubts().empty()) << "the published lens of TUM's first Kinect";
}

TEST(doubts, a_camera_of_another_image_size_or_of_the_image_before_it_was_cropped) {
    Computed frame;
    Pinhole& camera = frame.row.camera.pinhole;
    const cv::Size whole = camera.size;
    camera.size = {whole.width / 2, whole.height / 2};
    EXPECT_TRUE(warned(frame.doubts(), "principal point"));
    camera.size = {2 * whole.width, 2 * whole.height};
    EXPECT_TRUE(warned(frame.doubts(), "principal point"));
    camera.size = whole;
    camera.cy += 0.15 * whole.height;
    EXPECT_TRUE(frame.doubts().empty()) << "as of a lens that sits askew";
}

TEST(doubts, a_few_points_and_numbers_of_lines) {
    ComputedCloud cloud;
    auto& points = cloud.work.frame.cloud->points;
    const auto all = points;
    points.resize(1);
    EXPECT_TRUE(warned(cloud.doubts(), "1 point cannot show a surface"));
    points = all;
    for (std::size_t i = 0; i < points.size(); ++i)
        points[i] = {static_cast<double>(i + 1), all[i].x(), all[i].y()};
    EXPECT_TRUE(warned(cloud.doubts(), "x is the number of the point"));
    points.back().x() += 0.5;
    EXPECT_FALSE(warned(cloud.doubts(), "x is the number of the point"));
}

TEST(doubts, disparities_and_distances_in_place_of_depth) {
    const auto floor_and_wall = [](const auto& stored) {
        Computed frame;
        frame.row.camera.pinhole = {260, 260, 159.5, 119.5, {320, 240}};
        frame.work.depth = {frame.row.camera.pinhole, cv::Mat1f(240, 320), {}};
        for (int v = 0; v < 240; ++v)
            for (int u = 0; u < 320; ++u) {
                const Eigen::Vector3d ray = frame.row.camera.pinhole.ray(u, v);
                const double z = std::min(1.2 / std::max(1e-3, 0.3 + ray.y()), 3 / (0.8 + 0.6 * ray.x()));
                frame.work.depth.z_m(v, u) = static_cast<float>(stored(z, ray));
            }
        return frame.doubts();
    };
    EXPECT_TRUE(floor_and_wall([](double z, const Eigen::Vector3d&) { return z; }).empty());
    EXPECT_TRUE(warned(floor_and_wall([](double z, const Eigen::Vector3d&) { return 6 / z; }), "disparities"));
    EXPECT_TRUE(warned(floor_and_wall([](double z, const Eigen::Vector3d& ray) { return z * ray.norm(); }),
                       "distances from the camera's centre"));
}

// ---------------------------------------------------------------------------------------------------- the program

class DoubtfulRun : public testing::Test {
  protected:
    /// Four frames; the third one is nearly empty, without two pixels next to each other.
    void SetUp() override {
        tests::write_capture(folder / "capture", 4);
        cv::Mat1f scattered(48, 64, 0.0F);
        for (int v = 0; v < scattered.rows; v += 4)
            for (int u = 2; u < scattered.cols; u += 3)
                scattered(v, u) = 1.5F; // 8 % of the pixels
        write_depth_png(folder / "capture/depth/002.png", scattered, 1000);
    }
    [[nodiscard]] tests::Ran run(const std::string& flags) const {
        return run_program(
            fmt::format("run {} -o {} {}", (folder / "capture").string(), (folder / "out").string(), flags));
    }
    TemporaryFolder folder;
};

TEST_F(DoubtfulRun, is_told_by_messages_table_and_manifest_and_by_the_exit_code_where_strict) {
    EXPECT_EQ(run("--write ao --strict").exit_code, 2);
    const auto ran = run("--write ao --overwrite");
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_NE(ran.err.find("002: doubtful"), std::string::npos) << ran.err;
    EXPECT_NE(ran.err.find("doubtful: 002"), std::string::npos) << "the last lines name it: " << ran.err;
    EXPECT_NE(ran.err.find("4 of 4 frames, 1 doubtful"), std::string::npos) << ran.err;
    EXPECT_TRUE(fs::exists(folder / "out/ao/002.png")) << "doubtful results are written";
    const std::string table = read_bytes(folder / "out/frames.csv");
    EXPECT_NE(table.find("2,002,doubtful,only 0 % of the valid pixels have a valid one"), std::string::npos) << table;
    const json manifest = json::parse(read_bytes(folder / "out/manifest.json"));
    EXPECT_EQ(manifest["totals"]["ok"], 3);
    EXPECT_EQ(manifest["totals"]["doubtful"], 1);
    EXPECT_EQ(manifest["frames"][2]["status"], "doubtful");
    EXPECT_GE(manifest["frames"][2]["doubts"].size(), 1);
    EXPECT_TRUE(warned(manifest["frames"][2]["warnings"].get<std::vector<std::string>>(),
                       "only 8.2 % of the pixels hold a depth"))
        << "holes cost precision";
    EXPECT_FALSE(manifest["frames"][1].contains("doubts"));
}

/// Numbers that are within their limits are as good a measurement as those that are not.
TEST_F(DoubtfulRun, writes_what_every_check_found) {
    ASSERT_EQ(run("--write ao").exit_code, 0);
    const json checks = json::parse(read_bytes(folder / "out/checks.json"));
    EXPECT_EQ(checks["checks"].size(), all_checks().size());
    ASSERT_EQ(checks["frames"].size(), 4U);
    for (const json& frame : checks["frames"]) {
        const auto found = [&](const char* check) {
            return *std::ranges::find_if(frame["found"], [&](const json& each) { return each["check"] == check; });
        };
        const bool scattered = frame["name"] == "002";
        EXPECT_EQ(found("scattered_pixels")["doubtful"], scattered);
        EXPECT_EQ(found("scattered_pixels")["limit"], 0.3);
        EXPECT_EQ(found("scattered_pixels")["value"], scattered ? 0 : 1);
        EXPECT_EQ(found("holes")["limit"], 0.2);
        EXPECT_FALSE(found("holes")["doubtful"]) << "holes only warn";
        EXPECT_NEAR(found("holes")["value"].get<double>(), scattered ? 252.0 / (48 * 64) : 1, scattered ? 1e-5 : 0.1);
        EXPECT_GT(frame["found"].size(), 10U) << frame;
    }
}

/// Haze among splats gets a value from the nearest surface, and is no point that the mean counts.
TEST(attached_points, mean_over_valid_points_alone) {
    Cloud cloud;
    cloud.points = {{0, 0, 1}, {1, 0, 1}, Eigen::Vector3d::Constant(std::nan(""))};
    EXPECT_NEAR(attached_points(cloud, {0.5F, 0.75F, 1.0F}).mean_visibility, 0.625, 1e-6);
}

TEST(checks, are_listed_by_help_and_in_the_readme) {
    const std::string printed = run_program("help checks --markdown").out;
    EXPECT_EQ(printed, checks_markdown());
    const std::string readme = read_bytes(fs::path(SCANSHADE_SOURCE) / "apps/doubts/README.md");
    EXPECT_NE(readme.find(printed), std::string::npos) << "README.md has another table than `scanshade help checks "
                                                          "--markdown`";
    const std::string listed = run_program("help checks").out;
    for (const CheckRow& row : all_checks()) {
        EXPECT_EQ(check_named(row.name), row.check);
        EXPECT_NE(listed.find(row.name), std::string::npos) << row.name;
    }
    EXPECT_THROW((void)check_named("nothing"), Error);
}

TEST_F(DoubtfulRun, is_done_and_stays_doubtful_when_resumed) {
    ASSERT_EQ(run("--write ao --strict").exit_code, 2);
    const auto written = fs::last_write_time(folder / "out/ao/002.png");
    const auto again = run("--write ao --resume --strict");
    EXPECT_EQ(again.exit_code, 2) << again.err;
    EXPECT_NE(again.err.find("done already"), std::string::npos) << again.err;
    fs::remove(folder / "out/manifest.json");
    const auto reported = run("--write ao --resume --retry");
    EXPECT_EQ(reported.exit_code, 0) << reported.err;
    EXPECT_NE(reported.err.find("doubtful: 002"), std::string::npos) << reported.err;
    EXPECT_EQ(fs::last_write_time(folder / "out/ao/002.png"), written) << "not computed again";
}

TEST_F(DoubtfulRun, is_a_json_line_with_its_doubts) {
    const auto ran = run("--write ao --log json");
    EXPECT_NE(ran.err.find("\"status\":\"doubtful\""), std::string::npos) << ran.err;
    EXPECT_NE(ran.err.find("\"doubts\":[\"only 0 %"), std::string::npos) << ran.err;
}

TEST_F(DoubtfulRun, is_counted_and_explained_by_a_job) {
    const std::string job = (folder / "job").string();
    ASSERT_EQ(run_program(fmt::format("plan {} -o {} --write ao", (folder / "capture").string(), job)).exit_code, 0);
    EXPECT_EQ(run_program("run " + job + " --strict").exit_code, 2);
    const auto status = run_program("status " + job);
    EXPECT_EQ(status.exit_code, 0);
    EXPECT_EQ(run_program("status --strict " + job).exit_code, 2);
    EXPECT_NE(status.out.find("3 ok, 1 doubtful, 0 failed, 0 left, of 4"), std::string::npos) << status.out;
    EXPECT_NE(status.out.find("1 doubtful: only"), std::string::npos) << status.out;
    const json text = json::parse(run_program("status " + job + " --json").out);
    EXPECT_EQ(text["frames"]["doubtful"], 1);
    EXPECT_EQ(text["doubts"].size(), 1);
    EXPECT_EQ(run_program("merge --strict " + job).exit_code, 2);
    EXPECT_EQ(json::parse(read_bytes(folder / "job/manifest.json"))["totals"]["doubtful"], 1);
}

TEST(DoubtfulRecording, depths_in_a_unit_that_the_poses_refute) {
    const TemporaryFolder folder;
    const std::string capture = (folder / "capture").string(), out = (folder / "out").string();
    ASSERT_EQ(run_program(fmt::format("generate office -o {} --frames 6 --step 4 --size 160x120 --truth=no", capture))
                  .exit_code,
              0);
    EXPECT_EQ(run_program(fmt::format("run {} -o {} --write ao", capture, out)).exit_code, 0);
    const auto ran =
        run_program(fmt::format("run {} -o {} --overwrite --write ao --depth-scale 1000 --strict", capture, out));
    EXPECT_EQ(ran.exit_code, 2) << ran.err;
    EXPECT_NE(ran.err.find("6 of 6 frames, 6 doubtful"), std::string::npos) << ran.err;
    EXPECT_NE(read_bytes(folder / "out/frames.csv").find("depths fit the poses only if they are multiplied by 0.2"),
              std::string::npos);
}

TEST_F(DoubtfulRun, cameras_that_see_nothing_usual) {
    for (const char* camera : {"1e30,1e30,31.5,23.5", "52,52000,31.5,23.5"}) {
        const auto ran = run(fmt::format("--write ao --overwrite --strict --camera {}", camera));
        EXPECT_EQ(ran.exit_code, 2) << camera << ran.err;
        EXPECT_NE(ran.err.find("4 doubtful"), std::string::npos) << camera << ran.err;
    }
}

} // namespace
} // namespace scanshade
