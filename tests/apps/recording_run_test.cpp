// run.mcap of whole runs: the program reads its own recordings, and resumed runs leave the bytes of uninterrupted ones.
#include "apps/walk/batch.h"
#include "io/cameras/camera_file.h"
#include "io/captures/capture.h"
#include "io/captures/recordings/ros/mcap_output.h"
#include "io/images/image_file.h"
#include "tests/support/small_capture.h"

#include <cmath>
#include <csignal>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <thread>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using tests::Ran;
using tests::read_bytes;
using tests::run_program;
using tests::TemporaryFolder;

class RecordingRunTest : public testing::Test {
  protected:
    [[nodiscard]] Ran run(const std::string& capture, const std::string& out, const std::string& flags = "") const {
        return run_program(fmt::format("run {} -o {} {}", (folder / capture).string(), (folder / out).string(), flags));
    }
    [[nodiscard]] std::string recording(const std::string& out) const { return read_bytes(folder / out / "run.mcap"); }
    [[nodiscard]] std::size_t parts(const std::string& out) const {
        std::size_t count = 0;
        for (const auto& entry : fs::directory_iterator(folder / out))
            count += entry.path().extension() == ".part";
        return count;
    }

    TemporaryFolder folder;
};

TEST_F(RecordingRunTest, a_recording_is_a_capture_with_the_same_depth_camera_poses_and_stamps) {
    const std::string office = (folder / "office").string();
    ASSERT_EQ(run_program(fmt::format("generate office -o {} --frames 3 --size 160x120", office)).exit_code, 0);
    ASSERT_EQ(run("office", "out", "--write mcap").exit_code, 0);
    const Capture before = open_capture(folder / "office"), after = open_capture(folder / "out/run.mcap");
    EXPECT_EQ(after.kind, "ROS recording");
    EXPECT_TRUE(after.warnings.empty()) << after.warnings.front();
    EXPECT_EQ(after.registration, Registration::yes);
    ASSERT_TRUE(after.camera);
    EXPECT_EQ(after.camera->pinhole, before.camera->pinhole);
    ASSERT_EQ(after.entries.size(), 3u);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(*after.entries[i].stamp_s, *before.entries[i].stamp_s, 1e-6);
        ASSERT_TRUE(after.entries[i].world_from_camera);
        EXPECT_LT((after.entries[i].world_from_camera->matrix() - before.entries[i].world_from_camera->matrix()).norm(),
                  1e-6);
        const Frame a = before.load(i), b = after.load(i);
        EXPECT_EQ(cv::norm(a.depth_m, b.depth_m, cv::NORM_INF), 0) << i;
        EXPECT_EQ(cv::norm(a.colour, b.colour, cv::NORM_INF), 0) << i;
    }
    const Ran inspected = run_program("inspect " + (folder / "out/run.mcap").string());
    EXPECT_EQ(inspected.exit_code, 0) << inspected.err;
    EXPECT_NE(inspected.out.find("poses          3"), std::string::npos) << inspected.out;
}

TEST_F(RecordingRunTest, millimetres_and_lenses_come_back_and_unposed_frames_stay_unposed) {
    tests::write_capture(folder / "capture", 2);
    json camera = json::parse(read_bytes(folder / "capture/camera.json"));
    camera["distortion"] = {0.1, -0.05, 0.001, -0.002, 0.01};
    std::ofstream(folder / "capture/camera.json") << camera.dump();
    ASSERT_EQ(run("capture", "out", "--write mcap").exit_code, 0);
    const Capture before = open_capture(folder / "capture"), after = open_capture(folder / "out/run.mcap");
    ASSERT_TRUE(after.camera);
    EXPECT_EQ(after.camera->pinhole, before.camera->pinhole);
    EXPECT_EQ(after.camera->distortion, before.camera->distortion) << "images have the recorded pixels";
    EXPECT_FALSE(after.entries.at(0).world_from_camera);
    for (std::size_t i = 0; i < 2; ++i)
        EXPECT_EQ(cv::norm(before.load(i).depth_m, after.load(i).depth_m, cv::NORM_INF), 0);
}

TEST_F(RecordingRunTest, in_the_colour_view_the_camera_is_that_of_the_colour_images) {
    tests::write_capture(folder / "capture", 1, Registration::no);
    CameraFile file{tests::small_camera(), 1000, Registration::no, {}};
    ColourCamera colour{tests::small_camera(), Eigen::Isometry3d::Identity()};
    colour.camera.pinhole = scaled(colour.camera.pinhole, {96, 72});
    colour.colour_from_depth.translation().x() = -0.1;
    file.colour = colour;
    write_camera_file(folder / "capture/camera.json", file);
    write_picture(folder / "capture/color/000.png", cv::Mat3b(72, 96, cv::Vec3b(40, 120, 200)));
    ASSERT_EQ(run("capture", "out", "--write ao,mcap --view colour").exit_code, 0);
    const Capture after = open_capture(folder / "out/run.mcap");
    ASSERT_TRUE(after.camera);
    EXPECT_EQ(after.camera->pinhole, colour.camera.pinhole);
    const Frame frame = after.load(0);
    EXPECT_EQ(frame.depth_m.size(), cv::Size(96, 72));
    EXPECT_EQ(frame.colour(36, 40), cv::Vec3b(40, 120, 200));
    ASSERT_EQ(run("capture", "depth", "--write ao,mcap").exit_code, 0);
    EXPECT_EQ(open_capture(folder / "depth/run.mcap").camera->pinhole, tests::small_camera().pinhole);
}

TEST_F(RecordingRunTest, bytes_do_not_depend_on_timing_or_on_what_else_is_written) {
    tests::write_capture(folder / "capture", 6);
    ASSERT_EQ(run("capture", "a", "--write mcap").exit_code, 0);
    ASSERT_EQ(run("capture", "b", "--write ao,confidence,shaded,cloud,mcap --in-flight 3").exit_code, 0);
    EXPECT_EQ(recording("a"), recording("b"));
    EXPECT_EQ(ros::groups_in(folder / "a/run.mcap").size(), 6u);
    EXPECT_EQ(parts("a"), 0u);
}

TEST_F(RecordingRunTest, a_bad_frame_is_missing_in_the_recording_and_the_others_are_there) {
    tests::write_capture(folder / "capture", 4);
    fs::resize_file(folder / "capture/depth/002.png", 60);
    EXPECT_EQ(run("capture", "out", "--write mcap").exit_code, 2);
    const auto groups = ros::groups_in(folder / "out/run.mcap");
    ASSERT_EQ(groups.size(), 3u);
    EXPECT_EQ(groups[2].name, "003");
}

TEST_F(RecordingRunTest, a_resumed_run_leaves_the_bytes_of_a_whole_one) {
    tests::write_capture(folder / "capture", 6);
    const std::string flags = "--write mcap --depth-noise none"; // measured noise depends on the frames
    ASSERT_EQ(run("capture", "whole", flags).exit_code, 0);
    // In the order of the recording, whatever was there first.
    ASSERT_EQ(run("capture", "out", flags + " --frames 1::2").exit_code, 0);
    const Ran resumed = run("capture", "out", flags + " --resume");
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_NE(resumed.err.find("3 of them in an earlier run"), std::string::npos) << resumed.err;
    EXPECT_EQ(recording("out"), recording("whole"));
    // Nothing is left to do; the file is gone: its frames are computed again.
    EXPECT_NE(run("capture", "out", flags + " --resume").err.find("done already"), std::string::npos);
    fs::remove(folder / "out/run.mcap");
    ASSERT_EQ(run("capture", "out", flags + " --resume").exit_code, 0);
    EXPECT_EQ(recording("out"), recording("whole"));
}

TEST_F(RecordingRunTest, a_killed_run_goes_on_where_it_was) {
    constexpr int frames = 40, kills = 3;
    tests::write_capture(folder / "capture", frames);
    ASSERT_EQ(run("capture", "whole", "--write mcap --method surfel --quality highest").exit_code, 0);
    const auto lines = [&] {
        std::error_code none_yet;
        const fs::path journal = folder / "out/journal.jsonl";
        const std::string text = fs::exists(journal, none_yet) ? read_bytes(journal) : "";
        return std::ranges::count(text, '\n');
    };
    for (int i = 0; i < kills; ++i) {
        const auto before = lines();
        const pid_t pid =
            tests::start_program({"run", (folder / "capture").string(), "-o", (folder / "out").string(), "--write",
                                  "mcap", "--method", "surfel", "--quality", "highest", "--resume"});
        for (int wait = 0; wait < 3000 && lines() < before + 5; ++wait)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        kill(pid, SIGKILL);
        waitpid(pid, nullptr, 0);
        EXPECT_FALSE(fs::exists(folder / "out/run.mcap")) << "the kill came too late";
    }
    EXPECT_EQ(parts("out"), std::size_t(kills));
    const Ran resumed = run("capture", "out", "--write mcap --method surfel --quality highest --resume");
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_NE(resumed.err.find("of them in an earlier run"), std::string::npos) << resumed.err;
    EXPECT_EQ(recording("out"), recording("whole"));
    EXPECT_EQ(parts("out"), 0u);
}

TEST_F(RecordingRunTest, an_earlier_recording_is_replaced_only_when_asked) {
    tests::write_capture(folder / "capture", 2);
    ASSERT_EQ(run("capture", "out", "--write mcap").exit_code, 0);
    const std::string before = recording("out");
    EXPECT_EQ(run("capture", "out", "--write mcap").exit_code, 1);
    EXPECT_EQ(run("capture", "out", "--write mcap --radius 0.1 --overwrite").exit_code, 0);
    EXPECT_NE(recording("out"), before);
}

} // namespace
} // namespace scanshade
