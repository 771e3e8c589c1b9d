// Folders of no known layout: what is read, and what is named because it is not used.
#include "io/captures/capture.h"
#include "tests/support/made_recording.h"

#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

TEST_F(Made, a_folder_stands_for_the_only_capture_in_it) {
    depth("scene/frames/depth/0.png");
    text("scene/notes.txt", "x");
    EXPECT_THROW((void)open_capture(folder / "scene"), NoFrames);
    const Capture capture = open_capture_at_or_below(folder / "scene");
    expect_depth(capture.load(0));
    EXPECT_TRUE(warned(capture.warnings, "its folder frames is opened"));
    depth("scene/more/depth/0.png");
    EXPECT_TRUE(tests::says(tests::refusal([&] { (void)open_capture_at_or_below(folder / "scene"); }),
                            "2 captures lie in it, among them frames and more"));
    EXPECT_THROW((void)open_capture_at_or_below(folder / "scene/frames/depth/none"), Error);
}

TEST_F(Made, depth_in_npy_is_read_in_every_order_of_bytes_and_axes) {
    const auto npy = [](const std::string& type, bool column_major, const std::string& data) {
        const std::string header = fmt::format("{{'descr': '{}', 'fortran_order': {}, 'shape': (2, 3), }}\n", type,
                                               column_major ? "True" : "False");
        return "\x93NUMPY" + std::string("\1\0", 2) + static_cast<char>(header.size()) + std::string(1, '\0') + header +
               data;
    };
    const auto raw = [](const auto& values, bool swapped) {
        std::string bytes;
        for (const auto value : values) {
            std::string one(sizeof value, '\0');
            std::memcpy(one.data(), &value, sizeof value);
            if (swapped)
                std::ranges::reverse(one);
            bytes += one;
        }
        return bytes;
    };
    const std::vector<float> rows{1, 2, 3, 4, 5, 0}, columns{1, 4, 2, 5, 3, 0};
    const std::vector<double> wide(rows.begin(), rows.end());
    text("depth/0.npy", npy("<f4", false, raw(rows, false)));
    text("depth/1.npy", npy(">f8", false, raw(wide, true)));
    text("depth/2.npy", npy("<f4", true, raw(columns, false)));
    text("depth/3.npy", npy("<u2", false, raw(std::vector<std::uint16_t>{1, 2, 3, 4, 5, 0}, false)));
    text("depth/4.npy", npy("<f4", false, "short"));
    const Capture capture = open_capture(folder.path());
    for (std::size_t i = 0; i < 3; ++i)
        EXPECT_EQ(cv::countNonZero(capture.load(i).depth_m != (cv::Mat1f(2, 3) << 1, 2, 3, 4, 5, 0)), 0) << i;
    EXPECT_THROW((void)capture.load(4), Error);
}

TEST_F(Made, generic_folders_name_what_they_did_not_use) {
    depth("depth/0.png");
    text("pose/somewhere.xml", "<pose/>");
    text("camera_poses.csv", "1,2,3");
    const Capture capture = open_capture(folder.path());
    EXPECT_TRUE(warned(capture.warnings, "camera_poses.csv, pose"));
}

TEST_F(Made, generic_folders_name_every_kind_of_unused_file) {
    depth("depth/0.png");
    for (const char* name : {"pose", "poses", "intrinsic", "intrinsics", "calib", "calibration", "camera", "cameras",
                             "sparse", "colmap", "extrinsics"}) {
        fs::create_directories(folder / name);
        EXPECT_TRUE(warned(open_capture(folder.path()).warnings, std::string(": ") + name + ".")) << name;
        fs::remove(folder / name);
    }
    for (const char* name :
         {"my_Pose.bin", "traj.csv", "odometry.csv", "transforms_all.txt", "Intrinsic.csv", "extrinsic.xml",
          "calib.csv", "camera.csv", "groundtruth.txt", "42.pincam", "lowres_wide.traj", "mesh.log", "data.npz"}) {
        text(name, "1 2 3");
        EXPECT_TRUE(warned(open_capture(folder.path()).warnings, std::string(": ") + name + ".")) << name;
        fs::remove(folder / name);
    }
    text("notes.txt", "x");
    EXPECT_FALSE(warned(open_capture(folder.path()).warnings, "not used"));
}

TEST_F(Made, a_trajectory_counts_as_used_only_where_its_layout_reads_it) {
    text("trajectory.log", "0 0 1\n" + std::string(pose_rows));
    depth("scan.png");
    const Capture flat = open_capture(folder.path());
    EXPECT_EQ(flat.kind, "depth images");
    EXPECT_TRUE(warned(flat.warnings, "trajectory.log")) << "beside plain images nothing reads it";
    depth("depth/0.png");
    const Capture redwood = open_capture(folder.path());
    EXPECT_EQ(redwood.kind, "Redwood / Open3D");
    EXPECT_FALSE(warned(redwood.warnings, "trajectory.log"));
    EXPECT_TRUE(redwood.entries[0].world_from_camera);
}

TEST_F(Made, known_layouts_name_the_parts_that_they_ignore) {
    depth("iphone/depth/frame_000000.png");
    text("iphone/pose_intrinsic_imu.json",
         R"({"frame_000000": {"intrinsic": [[1440,0,959.5],[0,1440,719.5],[0,0,1]]}})");
    fs::create_directories(folder / "iphone/rgb_masks");
    EXPECT_TRUE(warned(open_capture(folder / "iphone").warnings, "not used: rgb_masks."));
    EXPECT_TRUE(warned(open_capture(folder / "iphone").warnings, "no colour"));
    depth("arkit/lowres_depth/42_1.000.png");
    fs::create_directories(folder / "arkit/highres_depth");
    EXPECT_TRUE(warned(open_capture(folder / "arkit").warnings, "not used: highres_depth."));
    text("kitti/velodyne/000000.bin", floats({1, 0, 0, 0.5F}));
    text("kitti/calib.txt", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\n");
    fs::create_directories(folder / "kitti/image_2");
    EXPECT_TRUE(warned(open_capture(folder / "kitti").warnings, "not used: image_2."));
}

TEST_F(Made, cameras_by_other_names_are_taken_or_named) {
    depth("depth/0.png");
    text("settings.yaml", "Camera.fx: 140\nCamera.fy: 140\nCamera.cx: 31.5\nCamera.cy: 23.5\n");
    const Capture named = open_capture(folder.path());
    EXPECT_FALSE(named.camera);
    EXPECT_TRUE(warned(named.warnings, "settings.yaml holds a camera, and is not used: --camera"));
    text("K.txt", "140 0 31.5\n0 140 23.5\n0 0 1\n");
    const Capture taken = open_capture(folder.path());
    ASSERT_TRUE(taken.camera);
    EXPECT_EQ(taken.camera->pinhole.fx, 140);
    EXPECT_FALSE(warned(taken.warnings, "settings.yaml"));
}

TEST_F(Made, colmaps_models_are_no_clouds) {
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"})
        text(name, std::string(32, '\0'));
    EXPECT_THROW((void)open_capture(folder.path()), NoFrames);
}

} // namespace
} // namespace scanshade
