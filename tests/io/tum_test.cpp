// Captures in TUM's layout: depth, colour and poses are paired by their times.
#include "io/captures/capture.h"
#include "tests/support/wall_captures.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

TEST(captures, tum_without_its_depth_list_is_refused_by_that_name) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 2);
    fs::remove(folder / "depth.txt");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path()); }), "depth.txt: missing, though rgb.txt"));
    fs::remove(folder / "groundtruth.txt");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path()); }), "depth.txt: missing"));
    fs::remove(folder / "rgb.txt");
    EXPECT_EQ(open_capture(folder.path()).kind, "colour and depth folders") << "nothing says TUM any more";
}

TEST(captures, tum_pairs_by_time_and_reads_poses) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 3);
    write_camera(folder / "camera.json");
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "TUM RGB-D");
    EXPECT_EQ(capture.depth.units_per_metre, 5000);
    EXPECT_EQ(capture.registration, Registration::yes);
    EXPECT_TRUE(capture.warnings.empty()) << joined(capture.warnings);
    ASSERT_EQ(capture.entries.size(), 3);
    EXPECT_EQ(capture.entries[1].name, "10.110000"); // the depth image's own stamp
    const Frame frame = capture.load(2);
    EXPECT_LE(worst_difference(frame.depth_m, wall()), 0.00011);
    EXPECT_EQ(worst_difference(frame.colour, picture()), 0);
    EXPECT_EQ(frame.camera.pinhole.size, cv::Size(64, 48));
    ASSERT_TRUE(frame.world_from_camera);
    EXPECT_EQ(frame.world_from_camera->translation(), Eigen::Vector3d(2, 2, 3));
    // A quarter turn about z takes x to y.
    EXPECT_NEAR((*frame.world_from_camera * Eigen::Vector3d::UnitX()).y(), 3, 1e-9);
    EXPECT_TRUE(frame.warnings.empty()) << joined(frame.warnings);
}

TEST(captures, tum_poses_are_taken_between_their_neighbours_and_by_the_cameras_clock) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 3);
    write_camera(folder / "camera.json");
    std::string rows; // 100 poses a second, moving a metre a second along x
    for (int i = 0; i < 60; ++i)
        rows += fmt::format("{:.3f} {} 0 0 0 0 0 1\n", 9.903 + 0.01 * i, 9.903 + 0.01 * i);
    write_file(folder / "groundtruth.txt", rows);
    const CaptureEntry plain = open_capture(folder.path()).entries[1];
    ASSERT_TRUE(plain.world_from_camera);
    EXPECT_NEAR(plain.world_from_camera->translation().x(), *plain.stamp_s, 1e-9);
    EXPECT_NEAR(plain.motion->translation_per_s.x(), 1, 1e-6);
    CameraFile file = read_camera_file(folder / "camera.json");
    file.pose_time_offset_s = 0.0123;
    write_camera_file(folder / "camera.json", file);
    const CaptureEntry late = open_capture(folder.path()).entries[1];
    EXPECT_NEAR(late.world_from_camera->translation().x(), *late.stamp_s + 0.0123, 1e-9);
}

TEST(captures, tum_limit_is_obeyed) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 2);
    CaptureOptions strict;
    strict.association_limit_s = 0.005; // colour is 10 ms away, poses 5 ms
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path(), strict); }), "0.010 s after rgb.txt"));
}

TEST(captures, tum_poses_end_with_the_trajectory) {
    // Depth at 10.01, 10.11, ..., 10.61; one pose each at 10.2 and 10.3. A frame takes a pose within 20 ms on either
    // side, also before the first and behind the last one, and none beyond that.
    const TemporaryFolder folder;
    write_tum(folder.path(), 7);
    write_camera(folder / "camera.json");
    write_file(folder / "groundtruth.txt", "10.2 1 0 0 0 0 0 1\n10.3 2 0 0 0 0 0 1\n");
    const Capture capture = open_capture(folder.path());
    ASSERT_EQ(capture.entries.size(), 7);
    for (std::size_t i = 0; i < 7; ++i) {
        const bool near = i == 2 || i == 3;
        EXPECT_EQ(capture.entries[i].world_from_camera.has_value(), near) << capture.entries[i].name;
        EXPECT_EQ(capture.entries[i].warnings.empty(), near) << joined(capture.entries[i].warnings);
    }
    EXPECT_EQ(capture.entries[2].world_from_camera->translation().x(), 1);
    EXPECT_EQ(capture.entries[3].world_from_camera->translation().x(), 2);
}

TEST(captures, tum_uses_each_colour_once) {
    const TemporaryFolder folder;
    write_pair(folder / "rgb/1.png", folder / "depth/1.png", 5000);
    write_file(folder / "rgb.txt", "1.000 rgb/1.png\n");
    write_file(folder / "depth.txt", "0.995 depth/1.png\n1.002 depth/1.png\n1.010 depth/1.png\n");
    const Capture capture = open_capture(folder.path());
    ASSERT_EQ(capture.entries.size(), 3);
    EXPECT_TRUE(capture.entries[0].colour.empty());
    EXPECT_FALSE(capture.entries[1].colour.empty()); // the nearest one
    EXPECT_TRUE(capture.entries[2].colour.empty());
}

TEST(captures, tum_takes_the_published_camera_only_for_the_benchmarks_own_recordings) {
    const TemporaryFolder folder;
    const auto open = [&](const std::string& name) {
        const fs::path capture = folder / name;
        write_depth_png(capture / "depth/1.png", wall({640, 480}), 5000);
        write_file(capture / "depth.txt", "1.0 depth/1.png\n");
        return open_capture(capture);
    };
    const Capture named = open("rgbd_dataset_freiburg2_xyz");
    EXPECT_EQ(named.camera->pinhole.fx, 520.9);
    EXPECT_EQ(named.registration, Registration::yes);
    EXPECT_TRUE(warned(named.warnings, "not applied to depth"));
    const Capture other = open("mine");
    EXPECT_EQ(other.camera->pinhole.fx, 525);
    EXPECT_TRUE(says(other.camera->origin, "assumed"));
    EXPECT_EQ(other.registration, Registration::unknown);
}

} // namespace
} // namespace scanshade
