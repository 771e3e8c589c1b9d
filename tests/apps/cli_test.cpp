// The program as a user or a script sees it: exit codes, files, reports, and the remains of a killed run.
#include "io/cameras/camera_file.h"
#include "io/clouds/cloud_file.h"
#include "io/images/image_file.h"
#include "tests/support/files.h"
#include "tests/support/small_capture.h"

#include <chrono>
#include <cmath>
#include <csignal>
#include <fcntl.h>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace scanshade {
namespace {

using nlohmann::json;
using tests::Ran;
using tests::read_bytes;
using tests::run_program;
using tests::TemporaryFolder;
namespace fs = std::filesystem;

class CliTest : public testing::Test {
  protected:
    void SetUp() override { tests::write_capture(capture(), 4); }

    [[nodiscard]] fs::path capture() const { return folder / "capture"; }
    [[nodiscard]] fs::path out() const { return folder / "out"; }
    [[nodiscard]] Ran run(const std::string& flags = "") const {
        return run_program(fmt::format("run {} -o {} {}", capture().string(), out().string(), flags));
    }
    [[nodiscard]] json manifest() const { return json::parse(read_bytes(out() / "manifest.json")); }

    TemporaryFolder folder;
};

std::size_t files_in(const fs::path& folder) {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

// ---------------------------------------------------------------------------------------------------- run

TEST_F(CliTest, run_leaves_maps_pictures_and_reports) {
    const Ran ran = run();
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_EQ(files_in(out() / "ao"), 4u);
    EXPECT_EQ(files_in(out() / "shaded"), 4u);
    EXPECT_FALSE(fs::exists(out() / "clouds"));
    const cv::Mat1f visibility = read_ao(out() / "ao/000.png");
    EXPECT_EQ(visibility.size(), cv::Size(64, 48));
    EXPECT_TRUE(std::isnan(visibility(4, 4)));

    const json text = manifest();
    EXPECT_EQ(text["method"], "cacao");
    EXPECT_FALSE(text["version"].get<std::string>().empty());
    EXPECT_FALSE(text["device"]["name"].get<std::string>().empty());
    EXPECT_NE(text["command_line"].get<std::string>().find("run"), std::string::npos);
    EXPECT_EQ(text["capture"]["camera"]["fx"], 52.0);
    EXPECT_NE(text["capture"]["camera"]["origin"].get<std::string>().find("camera.json"), std::string::npos);
    EXPECT_EQ(text["capture"]["registration"]["registered"], "yes");
    EXPECT_FALSE(text["settings"]["method cacao"].empty());
    EXPECT_EQ(text["totals"]["ok"], 4);
    EXPECT_GT(text["totals"]["peak_memory_mib"], 1);
    ASSERT_EQ(text["frames"].size(), 4u);
    for (const json& frame : text["frames"]) {
        EXPECT_EQ(frame["status"], "ok");
        EXPECT_GT(frame["mean_visibility"], 0.2);
        EXPECT_GE(frame["ms"]["compute"], 0);
        EXPECT_FALSE(frame["passes"].empty());
        for (const json& file : frame["files"])
            EXPECT_TRUE(fs::exists(out() / file.get<std::string>())) << file;
    }
    const std::string table = read_bytes(out() / "frames.csv");
    EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 5); // header and four frames
}

TEST_F(CliTest, one_bad_frame_is_reported_and_the_others_are_processed) {
    fs::resize_file(capture() / "depth/002.png", 60);
    const Ran ran = run();
    EXPECT_EQ(ran.exit_code, 2);
    EXPECT_NE(ran.err.find("002.png"), std::string::npos) << ran.err;
    EXPECT_EQ(files_in(out() / "ao"), 3u);
    const json text = manifest();
    EXPECT_EQ(text["frames"][2]["status"], "failed");
    EXPECT_NE(text["frames"][2]["why"].get<std::string>().find("002.png"), std::string::npos);
    EXPECT_EQ(text["frames"][3]["status"], "ok");
    EXPECT_NE(read_bytes(out() / "frames.csv").find("failed"), std::string::npos);
}

TEST_F(CliTest, frames_are_taken_like_a_slice) {
    ASSERT_EQ(run("--frames 1::2").exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "ao/001.png"));
    EXPECT_TRUE(fs::exists(out() / "ao/003.png"));
    EXPECT_EQ(files_in(out() / "ao"), 2u);
    ASSERT_EQ(run("--frames=-1: --overwrite").exit_code, 0);
    EXPECT_EQ(manifest()["frames"][0]["index"], 3);
    ASSERT_EQ(run("--frames 1::2147483647 --overwrite").exit_code, 0);
    EXPECT_EQ(manifest()["frames"].size(), 1u);
    ASSERT_EQ(run("--frames=-2147483648:1 --overwrite").exit_code, 0);
    EXPECT_EQ(run("--frames 2147483647 --overwrite").exit_code, 1);
    EXPECT_EQ(run("--frames 7:9 --overwrite").exit_code, 1);
    EXPECT_EQ(run("--frames a:b --overwrite").exit_code, 1);
    EXPECT_EQ(run("--frames 3:0:-1 --overwrite").exit_code, 1);
}

TEST_F(CliTest, an_earlier_result_is_replaced_only_when_asked) {
    ASSERT_EQ(run("--frames 0").exit_code, 0);
    const auto before = fs::last_write_time(out() / "ao/000.png");
    const Ran refused = run();
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_NE(refused.err.find("--overwrite"), std::string::npos) << refused.err;
    EXPECT_EQ(fs::last_write_time(out() / "ao/000.png"), before);
    EXPECT_FALSE(fs::exists(out() / "ao/001.png")) << "refused means that nothing is begun";
    EXPECT_EQ(run("--overwrite").exit_code, 0);
    EXPECT_EQ(files_in(out() / "ao"), 4u);
}

TEST_F(CliTest, same_input_same_bytes) {
    ASSERT_EQ(run("--write ao,shaded,cloud,panel").exit_code, 0);
    fs::rename(out(), folder / "first");
    ASSERT_EQ(run("--write ao,shaded,cloud,panel").exit_code, 0);
    std::size_t compared = 0;
    for (const char* kind : {"ao", "shaded", "clouds", "panel"})
        for (const auto& file : fs::directory_iterator(out() / kind)) {
            EXPECT_EQ(read_bytes(file.path()), read_bytes(folder / "first" / kind / file.path().filename())) << file;
            ++compared;
        }
    EXPECT_EQ(compared, 16u);
}

TEST_F(CliTest, radius_and_quality_reach_the_method) {
    ASSERT_EQ(run("--radius 0.25 --quality low --frames 0").exit_code, 0);
    const json settings = manifest()["settings"]["method cacao"];
    EXPECT_EQ(settings["cacao.radius"], 0.25);
    EXPECT_EQ(settings["cacao.quality"], "low");
    EXPECT_EQ(run("--radius -1 --overwrite").exit_code, 1);
    EXPECT_EQ(run("--quality splendid --overwrite").exit_code, 1);
}

/// The settings that a run used, in rows of every stage.
json rows_of(const json& manifest) {
    json rows = json::object();
    for (const auto& [stage, own] : manifest["settings"].items())
        rows.update(own);
    return rows;
}

TEST_F(CliTest, a_preset_changes_defaults_and_flags_win) {
    ASSERT_EQ(run("--frames 0").exit_code, 0);
    const json plain = rows_of(manifest());
    EXPECT_EQ(plain["preset"], "fast");
    ASSERT_EQ(run("--frames 0 --overwrite --preset fast").exit_code, 0);
    EXPECT_EQ(rows_of(manifest()), [&] {
        json same = plain;
        same["overwrite"] = true;
        return same;
    }()) << "the default is the first preset";

    ASSERT_EQ(run("--frames 0 --overwrite --preset balanced").exit_code, 0);
    const json balanced = rows_of(manifest());
    EXPECT_EQ(balanced["method"], "surfel");
    EXPECT_EQ(balanced["surfel.quality"], "high");
    EXPECT_EQ(balanced["surfel.downsampled"], true);
    EXPECT_EQ(balanced["sequence"], "off");

    ASSERT_EQ(run("--quality low --frames 0 --overwrite --preset best").exit_code, 0);
    const json best = rows_of(manifest());
    EXPECT_EQ(best["preset"], "best");
    EXPECT_EQ(best["method"], "surfel");
    EXPECT_EQ(best["surfel.quality"], "low") << "flags win, wherever they stand";
    EXPECT_EQ(best["sequence"], "auto");
    EXPECT_EQ(best["cloud.rays"], 64);

    ASSERT_EQ(run("--frames 0 --overwrite --preset best --method gtao --sequence off").exit_code, 0);
    const json other = rows_of(manifest());
    EXPECT_EQ(other["method"], "gtao");
    EXPECT_EQ(other["gtao.quality"], "medium") << "what the preset says of surfel is not gtao's";
    EXPECT_EQ(other["sequence"], "off");

    const fs::path file = folder / "settings.json";
    std::ofstream(file) << R"({"settings": {"method surfel": {"surfel.quality": "medium"}}})";
    ASSERT_EQ(run(fmt::format("--frames 0 --overwrite --preset best --settings {}", file.string())).exit_code, 0);
    EXPECT_EQ(rows_of(manifest())["surfel.quality"], "medium") << "a settings file wins, too";
    EXPECT_EQ(run("--frames 0 --overwrite --preset best --max-error 0.2").exit_code, 1);
}

TEST_F(CliTest, frames_are_looked_at_together_only_where_there_are_poses) {
    ASSERT_EQ(run("--preset best --surfel.quality lowest").exit_code, 0);
    EXPECT_EQ(manifest()["totals"]["ok"], 4) << "no poses: each frame by itself";
    const fs::path recording = folder / "recording";
    ASSERT_EQ(
        run_program(fmt::format("generate office -o {} --frames 3 --size 160x120 --truth=false", recording.string()))
            .exit_code,
        0);
    const Ran together = run_program(
        fmt::format("run {} -o {} --preset best --surfel.quality lowest", recording.string(), (folder / "b").string()));
    ASSERT_EQ(together.exit_code, 0);
    EXPECT_NE(together.err.find("computed together"), std::string::npos) << together.err;
    const auto frames_of = [&](const std::string& out) {
        return json::parse(read_bytes(folder / out / "manifest.json"))["frames"];
    };
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --preset best --surfel.quality lowest --sequence off",
                                      recording.string(), (folder / "c").string()))
                  .exit_code,
              0);
    const json with_others = frames_of("b"), alone = frames_of("c");
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(with_others[i]["other_frames"], 2);
        EXPECT_FALSE(alone[i].contains("other_frames"));
        EXPECT_LT(with_others[i]["expected_error"], 0.97 * alone[i]["expected_error"].get<double>());
    }
    fs::remove(folder / "b/manifest.json");
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --preset best --surfel.quality lowest --resume", recording.string(),
                                      (folder / "b").string()))
                  .exit_code,
              0);
    EXPECT_EQ(frames_of("b")[1]["other_frames"], 2) << "from the journal";
}

TEST_F(CliTest, frames_computed_by_themselves_have_the_errors_of_such) {
    const auto errors_with = [&](const std::string& flags) {
        const Ran ran = run("--overwrite --method surfel --surfel.quality lowest " + flags);
        EXPECT_EQ(ran.exit_code, 0) << ran.err;
        std::vector<double> errors;
        const json written = manifest();
        for (const auto& frame : written["frames"])
            errors.push_back(frame["expected_error"]);
        EXPECT_EQ(errors.size(), 4U);
        return std::pair{errors, ran.err};
    };
    const auto [alone, of_alone] = errors_with("");
    const auto [asked, of_asked] = errors_with("--sequence on");
    EXPECT_EQ(asked, alone) << "no frame has a pose";
    EXPECT_NE(of_asked.find("fewer than two frames have a pose"), std::string::npos) << of_asked;
    EXPECT_EQ(of_asked.find("computed together"), std::string::npos) << of_asked;
    EXPECT_EQ(of_asked.find("computing frames together"), std::string::npos) << of_asked;
    EXPECT_EQ(errors_with("--cloud " + (folder / "all.ply").string()).first, alone)
        << "a cloud of the recording takes frames one by one";
}

TEST_F(CliTest, a_quiet_run_prints_only_warnings_and_failures) {
    const Ran silent = run("-q");
    EXPECT_EQ(silent.exit_code, 0);
    EXPECT_EQ(silent.err, "");
    EXPECT_EQ(silent.out, "");
    fs::resize_file(capture() / "depth/002.png", 60);
    const Ran failed = run("--overwrite --quiet");
    EXPECT_EQ(failed.exit_code, 2);
    EXPECT_NE(failed.err.find("002.png"), std::string::npos) << failed.err;
    EXPECT_EQ(failed.err.find("ok,"), std::string::npos) << failed.err;
    EXPECT_LE(std::count(failed.err.begin(), failed.err.end(), '\n'), 2) << failed.err;
}

TEST_F(CliTest, off_a_terminal_good_frames_are_reported_now_and_then) {
    tests::write_capture(capture(), 40);
    fs::resize_file(capture() / "depth/030.png", 60);
    const Ran ran = run("--write ao");
    std::size_t told = 0;
    for (std::size_t at = 0; (at = ran.err.find(": ok,", at)) != std::string::npos; ++at)
        ++told;
    EXPECT_GE(told, 1u) << ran.err;
    EXPECT_LT(told, 20u) << ran.err;
    EXPECT_NE(ran.err.find("030: failed"), std::string::npos) << ran.err;
}

TEST_F(CliTest, a_run_ends_with_measured_errors_and_with_none_where_nothing_was_measured) {
    const Ran ran = run();
    EXPECT_NE(ran.err.find("expected error: RMSE 0."), std::string::npos) << ran.err;
    EXPECT_NE(ran.err.find("--preset balanced: RMSE 0."), std::string::npos) << ran.err;
    EXPECT_NE(ran.err.find("by what errors such pixels had"), std::string::npos)
        << "of the frames themselves: " << ran.err;
    const Ran map_alone = run("--overwrite --write ao");
    EXPECT_NE(map_alone.err.find("such pixels"), std::string::npos) << "whatever is written: " << map_alone.err;
    const Ran other = run("--overwrite --radius 0.3");
    EXPECT_EQ(other.err.find("expected error:"), std::string::npos) << "nothing was measured at this radius";
}

TEST_F(CliTest, a_cloud_keeps_its_points_and_gains_a_field) {
    const cv::Mat1f z_m = tests::corner_depth(0);
    const Pinhole camera = tests::small_camera().pinhole;
    std::string text = "# .PCD v0.7\nVERSION 0.7\nFIELDS label x y z\nSIZE 4 4 4 4\nTYPE U F F F\nCOUNT 1 1 1 1\n"
                       "WIDTH 64\nHEIGHT 48\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3072\nDATA ascii\n";
    for (int v = 0; v < 48; ++v)
        for (int u = 0; u < 64; ++u)
            text += z_m(v, u) <= 0 ? "7 nan nan nan\n"
                                   : fmt::format("7 {} {} {}\n", camera.point(u, v, z_m(v, u)).x(),
                                                 camera.point(u, v, z_m(v, u)).y(), z_m(v, u));
    const fs::path file = folder / "corner.pcd";
    std::ofstream(file) << text;
    const Ran ran = run_program(fmt::format("run {} -o {}", file.string(), out().string()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(out() / "clouds/corner.pcd", warnings);
    EXPECT_EQ(cloud.grid, cv::Size(64, 48));
    EXPECT_NE(describe(*cloud.records).find("ambient_occlusion"), std::string::npos) << describe(*cloud.records);
    EXPECT_NE(describe(*cloud.records).find("label"), std::string::npos);
    EXPECT_NE(manifest()["frames"][0]["camera"]["origin"].get<std::string>().find("recovered"), std::string::npos);
}

/// A wavy floor and the name of its file; its points have no camera.
std::string write_floor(const fs::path& file, bool black = false) {
    std::string text = fmt::format("ply\nformat ascii 1.0\nelement vertex 900\nproperty float x\nproperty float y\n"
                                   "property float z\n{}end_header\n",
                                   black ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "");
    for (int y = 0; y < 30; ++y)
        for (int x = 0; x < 30; ++x)
            text += fmt::format("{} {} {}{}\n", 0.1 * x, 0.1 * y, 0.1 * std::sin(0.3 * x), black ? " 0 0 0" : "");
    std::ofstream(file) << text;
    return file.string();
}

TEST_F(CliTest, maps_of_a_cloud_without_a_camera_are_its_fields) {
    const std::string floor = write_floor(folder / "floor.ply");
    for (const char* what : {"ao", "confidence", "cloud"}) {
        const Ran ran = run_program(fmt::format("run {} -o {} --overwrite --write {}", floor, out().string(), what));
        ASSERT_EQ(ran.exit_code, 0) << ran.err;
        EXPECT_TRUE(fs::exists(out() / "clouds/floor.ply")) << what;
        EXPECT_EQ(manifest()["frames"][0]["files"], json({"clouds/floor.ply", "points/floor.000.js"})) << what;
        fs::remove_all(out());
    }
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --write panel", floor, out().string())).exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "panel/floor.png"));
    const Ran again = run_program(fmt::format("run {} -o {} --write panel", floor, out().string()));
    EXPECT_EQ(again.exit_code, 1) << again.err;
}

TEST_F(CliTest, a_cloud_run_names_the_rays_and_says_nothing_of_depth_images) {
    const Ran ran = run_program(fmt::format("run {} -o {}", write_floor(folder / "floor.ply"), out().string()));
    EXPECT_TRUE(ran.err.starts_with("rays from every point on ")) << ran.err;
    EXPECT_EQ(ran.err.find("depth noise"), std::string::npos) << ran.err;
    EXPECT_EQ(ran.err.find("cacao"), std::string::npos) << ran.err;
    EXPECT_TRUE(run("--overwrite").err.starts_with("cacao on ")) << "depth images are the method's";
}

TEST_F(CliTest, clouds_need_no_vulkan_driver_and_depth_images_name_its_package) {
    const std::string floor = write_floor(folder / "floor.ply");
    fs::create_directories(folder / "no_loader");
    for (const char* name : {"libvulkan.so", "libvulkan.so.1"})
        std::ofstream(folder / "no_loader" / name) << "no library";
    const std::string nowhere = "/nonexistent", no_loader = (folder / "no_loader").string();
    // The second is the name before Vulkan 1.3.207.
    for (const auto& hidden :
         {std::vector<std::pair<std::string, std::string>>{{"VK_DRIVER_FILES", nowhere}, {"VK_ICD_FILENAMES", nowhere}},
          {{"LD_LIBRARY_PATH", no_loader}}}) {
        for (const auto& [name, value] : hidden)
            ::setenv(name.c_str(), value.c_str(), 1);
        const Ran cloud = run_program(fmt::format("run {} -o {} --overwrite", floor, (folder / "cloud").string()));
        const Ran depth = run("--overwrite");
        const Ran devices = run_program("devices");
        for (const auto& [name, value] : hidden)
            ::unsetenv(name.c_str());
        EXPECT_EQ(cloud.exit_code, 0) << cloud.err;
        EXPECT_TRUE(fs::exists(folder / "cloud/clouds/floor.ply"));
        EXPECT_EQ(depth.exit_code, 3);
        EXPECT_NE(depth.err.find("mesa-vulkan-drivers"), std::string::npos) << depth.err;
        EXPECT_NE(devices.err.find("mesa-vulkan-drivers"), std::string::npos) << devices.err;
        fs::remove_all(folder / "cloud");
    }
}

TEST_F(CliTest, clouds_without_colours_of_their_own_take_visibility_as_grey) {
    std::vector<std::string> warnings;
    for (const bool black : {false, true}) {
        const std::string floor = write_floor(folder / "floor.ply", black);
        const std::string command = fmt::format("run {} -o {} --overwrite --colour-cloud ", floor, out().string());
        ASSERT_EQ(run_program(command + "grey").exit_code, 0);
        const Cloud cloud = read_cloud(out() / "clouds/floor.ply", warnings);
        ASSERT_EQ(cloud.colours.size(), 900U);
        const std::vector<float> visibility = recorded_field(cloud, "ambient_occlusion", "floor.ply");
        for (std::size_t i = 0; i < 900; ++i)
            ASSERT_EQ(cloud.colours[i], cv::Vec3b::all(cv::saturate_cast<uchar>(255 * visibility[i]))) << i;
        ASSERT_EQ(run_program(command + "shaded").exit_code, 0);
        EXPECT_EQ(read_cloud(out() / "clouds/floor.ply", warnings).colours.size(), black ? 900U : 0U);
    }
}

TEST_F(CliTest, a_single_depth_image_is_shaded_with_the_colour_given) {
    const std::string depth = (capture() / "depth/000.png").string();
    const std::string flags =
        fmt::format("-o {} --overwrite --camera 52,52,31.5,23.5 --shade-strength 0", out().string());
    const Ran ran =
        run_program(fmt::format("run {} {} --colour {}", depth, flags, (capture() / "color/000.png").string()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_EQ(read_colour(out() / "shaded/000.png")(30, 40), cv::Vec3b(40, 120, 200));
    EXPECT_EQ(run_program(fmt::format("run {} {} --colour nowhere.png", depth, flags)).exit_code, 3);
    EXPECT_EQ(run("--overwrite --colour " + depth).exit_code, 1) << "a folder has its own colour";
}

TEST_F(CliTest, colour_of_a_secondary_camera_is_warped_into_either_view_and_reported) {
    CameraFile file{tests::small_camera(), 1000, Registration::no, {}};
    ColourCamera colour{tests::small_camera(), Eigen::Isometry3d::Identity()};
    colour.camera.pinhole = scaled(colour.camera.pinhole, {96, 72});
    colour.colour_from_depth.translation().x() = -0.1; // the rightmost of the wall is out of its sight
    file.colour = colour;
    file.depth_correction.offset_m = 0.05;
    write_camera_file(capture() / "camera.json", file);
    for (int i = 0; i < 4; ++i)
        write_picture(capture() / fmt::format("color/{:03}.png", i), cv::Mat3b(72, 96, cv::Vec3b(40, 120, 200)));
    ASSERT_EQ(run("--write ao,shaded,cloud --shade-strength 0").exit_code, 0);
    EXPECT_EQ(read_ao(out() / "ao/000.png").size(), cv::Size(64, 48));
    const cv::Mat3b shaded = read_colour(out() / "shaded/000.png");
    EXPECT_EQ(shaded(24, 30), cv::Vec3b(40, 120, 200));
    EXPECT_NE(shaded(24, 0), cv::Vec3b(40, 120, 200)); // clay
    const json text = manifest();
    EXPECT_EQ(text["capture"]["colour_camera"]["width"], 96);
    EXPECT_EQ(text["capture"]["depth"]["correction"]["offset_m"], 0.05);
    EXPECT_NE(text["shading"].get<std::string>().find("warped from the secondary camera"), std::string::npos);
    const std::string cloud = read_bytes(out() / "clouds/000.ply");
    EXPECT_NE(cloud.find("property float colour_known"), std::string::npos);

    ASSERT_EQ(run("--overwrite --view colour --shade-strength 0").exit_code, 0);
    const cv::Mat1f visibility = read_ao(out() / "ao/000.png");
    EXPECT_EQ(visibility.size(), cv::Size(96, 72));
    EXPECT_FALSE(std::isnan(visibility(36, 40)));
    EXPECT_TRUE(std::isnan(visibility(36, 95))); // what depth did not see
    EXPECT_EQ(read_colour(out() / "shaded/000.png").size(), cv::Size(96, 72));
}

TEST_F(CliTest, a_colour_view_without_a_colour_camera_is_refused) {
    const Ran ran = run("--view colour");
    EXPECT_EQ(ran.exit_code, 3);
    EXPECT_NE(ran.err.find("refine finds it"), std::string::npos) << ran.err;
}

TEST_F(CliTest, several_captures_get_a_folder_each) {
    tests::write_capture(folder / "more/capture", 1);
    const Ran ran =
        run_program(fmt::format("run {} {} {} -o {}", capture().string(), (folder / "more/capture").string(),
                                (folder / "nowhere").string(), out().string()));
    EXPECT_EQ(ran.exit_code, 2) << ran.err;
    EXPECT_NE(ran.err.find("nowhere"), std::string::npos);
    EXPECT_EQ(files_in(out() / "capture/ao"), 4u);
    EXPECT_EQ(files_in(out() / "capture-2/ao"), 1u);
}

// ---------------------------------------------------------------------------------------------------- exit codes

TEST_F(CliTest, misuse_is_exit_code_1) {
    for (const char* words : {"", "fly", "run", "run x", "run x -o y --radius big", "run x -o y --unheard-of",
                              "run x -o y --format jpg", "run x -o y --write ao,sound", "help fly"})
        EXPECT_EQ(run_program(words).exit_code, 1) << words;
    EXPECT_EQ(run("--camera 1,2,3").exit_code, 1);
    EXPECT_EQ(run("--depth-scale furlongs").exit_code, 1);
}

TEST_F(CliTest, nothing_usable_is_exit_code_3) {
    const std::string nowhere = (folder / "nowhere").string();
    for (const char* command : {"inspect", "refine", "view"})
        EXPECT_EQ(run_program(fmt::format("{} {}", command, nowhere)).exit_code, 3) << command;
    fs::create_directories(folder / "empty");
    const Ran empty = run_program(fmt::format("run {} -o {}", (folder / "empty").string(), out().string()));
    EXPECT_EQ(empty.exit_code, 3);
    EXPECT_NE(empty.err.find("no frames found"), std::string::npos) << empty.err;
    for (const auto& file : fs::directory_iterator(capture() / "depth"))
        fs::resize_file(file.path(), 10);
    EXPECT_EQ(run().exit_code, 3);
    EXPECT_EQ(manifest()["totals"]["failed"], 4) << "the report says why even when nothing could be done";
    EXPECT_EQ(run_program("inspect " + (folder / "empty").string()).exit_code, 3);
    EXPECT_EQ(run_program("inspect " + capture().string()).exit_code, 3);
}

// ---------------------------------------------------------------------------------------------------- killed and
// interrupted

TEST_F(CliTest, a_killed_run_leaves_no_half_file) {
    tests::write_capture(capture(), 200);
    for (int kill_after_ms : {0, 15, 40}) {
        const pid_t child = tests::start_program({"run", capture().string(), "-o", out().string(), "--overwrite"});
        ASSERT_TRUE(tests::wait_for_file(out() / "shaded"));
        std::this_thread::sleep_for(std::chrono::milliseconds(kill_after_ms));
        kill(child, SIGKILL);
        int status = 0;
        waitpid(child, &status, 0);
        ASSERT_TRUE(WIFSIGNALED(status)) << "200 frames were done before the kill: the test needs more";
        EXPECT_FALSE(fs::exists(out() / "manifest.json")) << "a manifest says that the run came to its end";
        for (const char* kind : {"ao", "shaded"})
            for (const auto& file : fs::directory_iterator(out() / kind)) {
                const bool final_name = file.path().filename().string()[0] != '.'; // others say that they are not done
                EXPECT_TRUE(!final_name || !read_colour(file.path()).empty()) << file;
            }
        fs::remove_all(out());
    }
}

TEST_F(CliTest, what_a_killed_run_left_is_cleared_by_the_next) {
    tests::write_capture(capture(), 200);
    const pid_t child = tests::start_program({"run", capture().string(), "-o", out().string()});
    ASSERT_TRUE(tests::wait_for_file(out() / "shaded"));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    ASSERT_EQ(run("--overwrite --frames :3").exit_code, 0);
    for (const char* kind : {"ao", "shaded"})
        for (const auto& file : fs::directory_iterator(out() / kind))
            EXPECT_NE(file.path().filename().string()[0], '.') << file;
}

TEST_F(CliTest, leftovers_of_frames_that_are_not_chosen_are_cleared_too) {
    // The killed run may have taken other frames than this one does. What is no frame's stays: it is the user's.
    ASSERT_EQ(run("--frames 3").exit_code, 0);
    const std::vector<fs::path> ours{out() / "ao/.003.tmp-999999999-0.png", out() / "shaded/.000.tmp-999999999-1.png",
                                     out() / ".frames.tmp-999999999-2.csv", out() / ".manifest.tmp-999999999-3.json"};
    const fs::path not_ours = out() / "ao/.other.tmp-999999999-0.png";
    for (const fs::path& file : ours)
        std::ofstream(file) << "half";
    std::ofstream(not_ours) << "the user's";
    ASSERT_EQ(run("--overwrite --frames 1").exit_code, 0);
    for (const fs::path& file : ours)
        EXPECT_FALSE(fs::exists(file)) << file;
    EXPECT_TRUE(fs::exists(not_ours));
}

TEST_F(CliTest, an_interrupted_run_records_what_is_done) {
    tests::write_capture(capture(), 400);
    const pid_t child = tests::start_program({"run", capture().string(), "-o", out().string()});
    ASSERT_TRUE(tests::wait_for_file(out() / "ao/000.png"));
    kill(child, SIGTERM);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 4); // the same again, with --resume, goes on
    const json totals = manifest()["totals"];
    EXPECT_GE(totals["ok"], 1);
    EXPECT_GE(totals["skipped"], 1);
    EXPECT_EQ(totals["ok"].get<std::size_t>(), files_in(out() / "ao"));
}

// ---------------------------------------------------------------------------------------------------- the other
// commands

TEST_F(CliTest, inspect_says_what_is_there) {
    const Ran ran = run_program("inspect " + capture().string());
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    for (const char* expected : {"64x48", "camera.json", "holes", "registered"})
        EXPECT_NE(ran.out.find(expected), std::string::npos) << expected << " in\n" << ran.out;
    const json facts = json::parse(run_program("inspect --json --all " + capture().string()).out).at(0);
    EXPECT_EQ(facts["frames"], 4);
    ASSERT_EQ(facts["every_frame"].size(), 4U);
    EXPECT_EQ(facts["every_frame"][2]["holes"], 30);
    EXPECT_EQ(facts["every_frame"][2]["camera"]["fx"], 52.0);
    EXPECT_EQ(facts["every_frame"][2]["width"], 64);
    EXPECT_NEAR(facts["depth"]["holes"].get<double>(), 30.0 / (64 * 48), 1e-6);
    double smallest_step_m = 1;
    for (const json& band : facts["depth"]["steps"])
        smallest_step_m = std::min(smallest_step_m, band["step_m"].get<double>());
    EXPECT_GE(smallest_step_m, 0.00099); // stored in millimetres: no step is smaller, all are whole ones
    EXPECT_NEAR(std::remainder(smallest_step_m, 0.001), 0, 1e-5);
    EXPECT_EQ(facts["camera"]["fx"], 52.0);
}

TEST_F(CliTest, inspect_lists_every_fact_of_every_frame) {
    const fs::path stray = folder / "stray";
    for (const char* part : {"depth", "confidence", "rgb"})
        fs::create_directories(stray / part);
    cv::imwrite((stray / "depth/000000.png").string(), cv::Mat1w(6, 8, ushort(2000)));
    cv::Mat1b levels(6, 8, uchar(2));
    levels(0, 0) = 0;
    cv::imwrite((stray / "confidence/000000.png").string(), levels);
    cv::imwrite((stray / "rgb/000000.png").string(), cv::Mat3b(45, 60, {9, 99, 199}));
    tests::write_file(stray / "camera_matrix.csv", "75, 0, 29.5\n0, 75, 22\n0, 0, 1\n");
    tests::write_file(stray / "odometry.csv",
                      "timestamp, frame, x, y, z, qx, qy, qz, qw\n5.5, 000000, 1, 2, 3, 0, 0, 0, 1\n");
    const json all = json::parse(run_program("inspect --json --all " + stray.string() + " " + capture().string()).out);
    ASSERT_EQ(all.size(), 2U) << "an object for each";
    EXPECT_EQ(all[0]["kind"], "Stray Scanner");
    const json frame = all[0]["every_frame"][0];
    EXPECT_EQ(frame["name"], "000000");
    EXPECT_EQ(frame["stamp_s"], 5.5);
    EXPECT_NEAR(frame["camera"]["fx"].get<double>(), 10, 1e-9);
    EXPECT_EQ(frame["width"], 8);
    EXPECT_EQ(frame["height"], 6);
    EXPECT_EQ(frame["depth_encoding"], "mm");
    EXPECT_EQ(frame["world_from_camera"], (json{{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}, {0, 0, 0, 1}}));
    EXPECT_EQ(frame["colour_size"], (json{60, 45})) << "as recorded";
    EXPECT_EQ(frame["holes"], 1);
    EXPECT_EQ(frame["confidence"]["levels"], "0 low, 1 medium, 2 high");
    EXPECT_EQ(frame["confidence"]["holes"], 0) << "the level whose depth is left out";
    EXPECT_TRUE(frame["why"].is_null());
    const json other = all[1]["every_frame"][0];
    for (const auto& [key, value] : frame.items())
        EXPECT_TRUE(other.contains(key)) << key << " is null where nothing is known";
    EXPECT_TRUE(other["confidence"].is_null());
}

TEST_F(CliTest, inspect_of_a_folder_of_captures_lists_each_and_says_what_cannot_be_read) {
    const fs::path set = folder / "set";
    fs::create_directories(set);
    fs::copy(capture(), set / "a", fs::copy_options::recursive);
    fs::copy(capture(), set / "b", fs::copy_options::recursive);
    const Ran ran = run_program("inspect --json " + set.string() + " " + (folder / "none").string());
    EXPECT_EQ(ran.exit_code, 2);
    const json all = json::parse(ran.out);
    ASSERT_EQ(all.size(), 3U);
    EXPECT_EQ(all[0]["frames"], 4);
    EXPECT_EQ(all[1]["path"], (set / "b").string());
    EXPECT_NE(all[2]["why"].get<std::string>().find("no such file"), std::string::npos);
}

TEST_F(CliTest, help_lists_the_formats_for_people_readmes_and_programs) {
    const Ran people = run_program("help formats");
    EXPECT_EQ(people.exit_code, 0) << people.err;
    const json formats = json::parse(run_program("help --json").out)["formats"];
    for (const json& format : formats)
        EXPECT_NE(people.out.find(format["name"].get<std::string>()), std::string::npos) << format;
    EXPECT_NE(run_program("help formats --markdown").out.find("| TUM RGB-D | `depth.txt`"), std::string::npos);
}

TEST_F(CliTest, inspect_reports_a_frame_that_cannot_be_read) {
    fs::resize_file(capture() / "depth/001.png", 60);
    const Ran ran = run_program("inspect " + capture().string());
    EXPECT_EQ(ran.exit_code, 2);
    EXPECT_NE(ran.out.find("001.png"), std::string::npos) << ran.out;
}

std::size_t lines_in(const std::string& text) {
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

TEST_F(CliTest, a_file_that_holds_no_settings_is_refused) {
    const auto settings = [&](const char* file) { return run("--settings " + (folder / file).string()); };
    std::ofstream(folder / "odd.json") << "{\"settings\": {\"method cacao\": {\"cacao.colour\": 3}}}";
    std::ofstream(folder / "no.json") << "settings";
    for (const char* file : {"odd.json", "no.json", "nowhere.json"})
        EXPECT_EQ(settings(file).exit_code, 1) << file;
    std::ofstream(folder / "mistyped.json") << R"({"settings": {"method cacao": {"cacao.raduis": 0.3}}})";
    const Ran mistyped = settings("mistyped.json");
    EXPECT_NE(mistyped.err.find("--cacao.raduis: no such flag; did you mean --cacao.radius?"), std::string::npos)
        << mistyped.err;
}

TEST(CliHelpTest, help_for_programs_has_every_command_with_its_flags) {
    const json all = json::parse(run_program("help --json").out);
    const auto named = [](const json& list, const std::string& name) {
        const auto found = std::ranges::find_if(list, [&](const json& one) { return one["name"] == name; });
        return found == list.end() ? json() : *found;
    };
    const json run = named(all["commands"], "run");
    EXPECT_EQ(run["words"]["name"], "PATH");
    const json method = named(run["flags"], "method"), radius = named(run["flags"], "radius");
    EXPECT_EQ(method["kind"], "choice");
    EXPECT_NE(std::ranges::find(method["choices"], "surfel"), method["choices"].end());
    EXPECT_EQ(radius["kind"], "number");
    EXPECT_EQ(radius["unit"], "m");
    EXPECT_EQ(named(run["flags"], "out")["short"], "o");
    EXPECT_EQ(named(run["flags"], "quiet")["kind"], "switch");
    EXPECT_EQ(all["exit_codes"].size(), 6U);
}

TEST(CliHelpTest, help_all_shows_every_flag_with_default_and_range) {
    const Ran ran = run_program("help run all");
    EXPECT_EQ(ran.exit_code, 0);
    for (const char* expected : {"--frames", "--cacao.radius", "default cacao", "png16 | png8 | tiff | exr", "-o,--out",
                                 "--cloud.rays", "--sequence.layers", "--dump"})
        EXPECT_NE(ran.out.find(expected), std::string::npos) << expected << " in\n" << ran.out;
}

TEST(CliHelpTest, the_first_page_of_every_command_fits_a_screen) {
    for (const char* command :
         {"inspect", "run", "plan", "status", "merge", "compare", "bench", "generate", "methods", "devices"}) {
        const Ran ran = run_program(fmt::format("help {}", command));
        EXPECT_EQ(ran.exit_code, 0) << command;
        EXPECT_LE(lines_in(ran.out), 60u) << ran.out;
        std::istringstream lines(ran.out);
        for (std::string line; std::getline(lines, line);)
            EXPECT_LE(line.size(), 110u) << line;
    }
    const std::string page = run_program("help run").out;
    for (const char* expected :
         {"--preset", "--method", "--quality", "--radius", "-q,--quiet", "help run all", "surfel"})
        EXPECT_NE(page.find(expected), std::string::npos) << expected << " in\n" << page;
    EXPECT_EQ(page.find("--cacao."), std::string::npos);
    EXPECT_EQ(run_program("run --help").out, page);
    EXPECT_EQ(run_program("help").exit_code, 0);
    EXPECT_EQ(run_program("--version").out.substr(0, 10), "scanshade ");
}

TEST(CliHelpTest, help_of_a_topic_shows_its_flags_alone) {
    for (const auto& [topic, flag] : {std::pair("cacao", "--cacao.radius"), std::pair("surfel", "--surfel.slices"),
                                      std::pair("clouds", "--cloud.rays"), std::pair("sequence", "--sequence.fuse")}) {
        const Ran ran = run_program(fmt::format("help run {}", topic));
        EXPECT_EQ(ran.exit_code, 0);
        EXPECT_NE(ran.out.find(flag), std::string::npos) << ran.out;
        EXPECT_EQ(ran.out.find("--frames"), std::string::npos) << ran.out;
    }
    const Ran mistyped = run_program("help run surfle");
    EXPECT_EQ(mistyped.exit_code, 1);
    EXPECT_NE(mistyped.err.find("did you mean surfel?"), std::string::npos) << mistyped.err;
}

TEST(CliHelpTest, mistyped_words_get_the_nearest_one_as_a_hint) {
    for (const auto& [words, meant] :
         {std::pair("run x -o y --quailty high", "--quailty: no such flag; did you mean --quality?"),
          std::pair("run x -o y --cacao.raduis=1", "--cacao.raduis: no such flag; did you mean --cacao.radius?"),
          std::pair("generate office --frame 3", "did you mean --frames?"),
          std::pair("insepct x", "insepct: no such command; did you mean inspect?"),
          std::pair("run x -o y --method surfle", "did you mean surfel?"),
          std::pair("run x -o y --preset bets", "did you mean best?"),
          std::pair("run x -o y --write ao,shadde", "did you mean shaded?"), std::pair("run -o y", "PATH is missing"),
          std::pair("compare x y z", "2 PATH expected at most"), std::pair("run x -o", "--out needs a value"),
          std::pair("run x -o y --radius", "--radius needs a value: m, 0 or more"),
          std::pair("run x -o y --radius 1 --radius=2 --overwrite", "--radius is given more than once"),
          std::pair("run x -o y --overwrite=maybe", "'maybe' given, expected yes | no"),
          std::pair("run x -o y --settings /nowhere.json", "settings: the file is missing"),
          std::pair("run x -o y --settings /dev/null", "settings line 1: not JSON"),
          std::pair("run x -o y --hbao.directions 3",
                    "hbao.directions: is a setting of the method hbao, and the method is cacao"),
          std::pair("inspect x --json=--g", "json: '--g' given, expected yes | no")}) {
        const Ran ran = run_program(words);
        EXPECT_EQ(ran.exit_code, 1) << words;
        EXPECT_NE(ran.err.find(meant), std::string::npos) << ran.err;
    }
    EXPECT_EQ(run_program("run x -o y --unheard-of").err.find("did you mean"), std::string::npos);
}

TEST_F(CliTest, a_switch_takes_the_words_yes_and_no_and_no_path) {
    const auto has_page = [&](const std::string& flags) {
        const Ran ran = run("--frames 0 " + flags);
        EXPECT_EQ(ran.exit_code, 0) << flags << ran.err;
        return fs::exists(folder / "out" / "index.html");
    };
    for (const char* off : {"--page no", "--page=false", "--page false"})
        EXPECT_FALSE(has_page(fmt::format("--overwrite yes {}", off))) << off;
    for (const char* on : {"--page", "--page yes", "--page=true"})
        EXPECT_TRUE(has_page(fmt::format("--overwrite=true {}", on))) << on;
    EXPECT_EQ(run("--overwrite no").exit_code, 1) << "the results of an earlier run stay";
    const Ran path = run_program(
        fmt::format("run --overwrite {} -o {} --frames 0", (folder / "capture").string(), (folder / "out").string()));
    EXPECT_EQ(path.exit_code, 0) << "a path after a switch is a path: " << path.err;
}

TEST(CliHelpTest, methods_and_devices_are_listed) {
    EXPECT_NE(run_program("methods").out.find("cacao"), std::string::npos);
    const Ran devices = run_program("devices");
    EXPECT_EQ(devices.exit_code, 0) << devices.err;
    EXPECT_NE(devices.out.find("yes"), std::string::npos);
}

TEST_F(CliTest, generate_makes_a_capture_that_run_takes) {
    const fs::path made = folder / "made";
    const std::string generate =
        fmt::format("generate office -o {} --frames 2 --size 64x48 --truth=false", made.string());
    const Ran generated = run_program(generate);
    ASSERT_EQ(generated.exit_code, 0) << generated.err;
    const Ran ran = run_program(fmt::format("run {} -o {}", made.string(), out().string()));
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_EQ(run_program(generate).exit_code, 1) << "an earlier capture is replaced only when asked";
    EXPECT_EQ(run_program("generate nowhere -o " + (folder / "x").string()).exit_code, 1);
}

} // namespace
} // namespace scanshade
