// Recordings as phones and their programs leave them: Nerfstudio, Instant-NGP, Stray Scanner, Polycam, ARKitScenes,
// ScanNet++.
#include "io/captures/capture.h"
#include "tests/support/made_recording.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

TEST_F(Made, nerfstudio_counts_pixels_from_corners_and_looks_along_minus_z) {
    depth("depths/b.png");
    colour("images/b.jpg", {16, 12});
    depth("depths/a.png");
    // The same pose with OpenGL's axes: the second and third column change sign.
    const std::string pose = R"("transform_matrix": [[0,1,0,1],[1,0,0,2],[0,0,-1,3],[0,0,0,1]])";
    text("transforms.json",
         R"({"camera_model": "OPENCV", "fl_x": 20, "fl_y": 22, "cx": 7.5, "cy": 6, "w": 16, "h": 12, "k1": 0.1,
        "frames": [{"file_path": "images\\b.jpg", "depth_file_path": "depths/b.png", )" +
             pose + R"(},
                   {"file_path": "images/a.jpg", "depth_file_path": "depths/a.png", "depth_unit_scale_factor": 0.002, )" +
             pose + R"(},
                   {"file_path": "images/c.jpg", )" +
             pose + R"(}]})");
    const Capture capture = open_capture(folder.path());
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_TRUE(warned(capture.warnings, "without depth"));
    const Frame frame = capture.load(1);
    EXPECT_EQ(frame.name, "b");
    expect_camera(frame, 10, 11, (7.5 - 0.5 + 0.5) / 2 - 0.5, (6 - 0.5 + 0.5) / 2 - 0.5);
    EXPECT_EQ(frame.camera.distortion.k1, 0.1);
    expect_pose(frame);
    expect_depth(frame);
    EXPECT_EQ(frame.colour.size(), cv::Size(8, 6)) << "finer colour is reduced to depth's pixels";
    EXPECT_NEAR(capture.load(0).depth_m(5, 7), 4, 1e-4) << "its own depth unit";
}

TEST_F(Made, nerfstudio_takes_lists_of_distortion_and_orders_frames_by_their_paths) {
    depth("b/1.png");
    depth("a/2.png");
    text("transforms.json", R"({"fl_x": 10, "cx": 4, "cy": 3, "w": 8, "h": 6, "applied_scale": 0.5,
        "distortion_params": [0.1, 0.02, 0, 0, 0.003, 0.004], "frames": [
        {"file_path": "b/1.png", "depth_file_path": "b/1.png", "transform_matrix": [[1,0,0,2],[0,1,0,0],[0,0,1,0]]},
        {"file_path": "a/2.png", "depth_file_path": "a/2.png", "transform_matrix": [[1,0,0,1],[0,1,0,0],[0,0,1,0]]}]})");
    const Capture capture = open_capture(folder.path());
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_EQ(capture.entries[0].name, "2") << "a/2 is before b/1";
    const Frame frame = capture.load(0);
    EXPECT_EQ(frame.camera.distortion.k1, 0.1);
    EXPECT_EQ(frame.camera.distortion.p2, 0.004);
    EXPECT_NEAR(frame.world_from_camera->translation().x(), 2, 1e-9) << "divided by applied_scale";
    EXPECT_TRUE(warned(capture.warnings, "applied_scale of 0.5"));
    text("transforms.json", R"({"fl_x": 10, "distortion_params": [1], "frames": [
        {"file_path": "b/1.png", "depth_file_path": "b/1.png"}]})");
    EXPECT_TRUE(tests::says(open_capture(folder.path()).entries[0].problem, "distortion_params"));
}

TEST_F(Made, instant_ngp_has_depth_only_with_its_scale) {
    depth("depth/1.png");
    const auto opened = [&](const std::string& keys) {
        text("transforms.json",
             "{\"fl_x\": 10, " + keys + R"("frames": [{"file_path": "images/1", "depth_path": "depth/1.png"}]})");
        return open_capture(folder.path());
    };
    const Capture with = opened("\"integer_depth_scale\": 0.002, ");
    EXPECT_EQ(with.kind, "nerfstudio / instant-ngp");
    EXPECT_EQ(with.depth.units_per_metre, 500);
    EXPECT_NEAR(with.load(0).depth_m(5, 7), 4, 1e-4);
    for (const char* keys : {"", "\"integer_depth_scale\": 0.002, \"enable_depth_loading\": false, "}) {
        const Capture without = opened(keys);
        EXPECT_EQ(without.kind, "colour and depth folders");
        EXPECT_TRUE(warned(without.warnings, "transforms.json")) << "told, since it was not used";
    }
}

TEST_F(Made, nerfstudios_floats_are_millimetres_where_metres_would_be_absurd) {
    for (const float unit : {1.0F, 1000.0F}) {
        const cv::Mat1f image(6, 8, 2 * unit);
        picture("1.tiff", image);
        text("transforms.json", R"({"fl_x": 10, "frames": [{"file_path": "1.jpg", "depth_file_path": "1.tiff"}]})");
        const Capture capture = open_capture(folder.path());
        EXPECT_NEAR(capture.load(0).depth_m(0, 0), 2, 1e-5);
        EXPECT_TRUE(tests::says(capture.depth.origin, unit > 1 ? "median of 2000" : "floats are metres"));
    }
}

TEST_F(Made, stray_scanner_takes_the_size_from_the_video_and_drops_unsure_depth) {
    depth("depth/000000.png");
    confidence("confidence/000000.png");
    text("camera_matrix.csv", "20, 0, 7.5\n0, 22, 5.5\n0, 0, 1\n");
    text("odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw\n5.5, 000000, 1, 2, 3, 0, 0, 0.7071067811865476, "
                         "0.7071067811865476\n");
    const auto box = [](const std::string& type, const std::string& content) {
        const std::size_t size = content.size() + 8;
        return std::string{static_cast<char>(size >> 24), static_cast<char>(size >> 16), static_cast<char>(size >> 8),
                           static_cast<char>(size)} +
               type + content;
    };
    const std::string size = std::string("\0\x10\0\0\0\x0c\0\0", 8); // 16x12 as 16.16
    text("rgb.mp4", box("ftyp", "qt  ") +
                        box("moov", box("mvhd", "....") + box("trak", box("tkhd", std::string(76, '.') + size))));
    const Frame frame = open_capture(folder.path()).load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_pose(frame);
    expect_depth(frame);
    EXPECT_EQ(frame.depth_m(2, 2), 0) << "of the lowest confidence";
    EXPECT_EQ(open_capture(folder.path()).entries[0].stamp_s, 5.5);
    const auto z_with = [&](int lowest) {
        CaptureOptions options;
        options.confidence_min = lowest;
        return open_capture(folder.path(), options).load(0).depth_m.clone();
    };
    EXPECT_GT(z_with(0)(2, 2), 0) << "whatever its confidence";
    EXPECT_LT(cv::countNonZero(z_with(2)), cv::countNonZero(z_with(1))) << "of high confidence alone";
}

TEST_F(Made, stray_scanner_without_video_says_which_size_it_assumes) {
    depth("depth/000000.png");
    text("camera_matrix.csv", "75, 0, 29.5\n0, 75, 22\n0, 0, 1\n");
    const Capture capture = open_capture(folder.path());
    EXPECT_TRUE(warned(capture.warnings, "60x45 is assumed"));
    expect_depth(capture.load(0));
    EXPECT_TRUE(warned(capture.warnings, "no odometry.csv"));
    expect_camera(capture.load(0), 10, 10, 3.5, 2.5);
    fs::remove(folder / "depth/000000.png");
    const std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (6, 8), }\n";
    text("depth/000000.npy", "\x93NUMPY" + std::string("\1\0", 2) + static_cast<char>(header.size()) +
                                 std::string(1, '\0') + header + floats(std::vector<float>(48, 2000)));
    EXPECT_NEAR(open_capture(folder.path()).load(0).depth_m(5, 7), 2, 1e-5) << "older ones: floats of millimetres";
}

TEST_F(Made, polycam_prefers_corrected_cameras) {
    const auto camera = [](double fx) {
        return fmt::format(
            R"({{"fx": {}, "fy": 22, "cx": 7.5, "cy": 5.5, "width": 16, "height": 12, "t_00": 0, "t_01": 1, "t_02": 0,
            "t_03": 1, "t_10": 1, "t_11": 0, "t_12": 0, "t_13": 2, "t_20": 0, "t_21": 0, "t_22": -1, "t_23": 3}})",
            fx);
    };
    for (const char* name : {"1000000", "2000000"}) {
        depth(fmt::format("keyframes/depth/{}.png", name));
        confidence(fmt::format("keyframes/confidence/{}.png", name));
        text(fmt::format("keyframes/cameras/{}.json", name), camera(30));
    }
    text("keyframes/corrected_cameras/1000000.json", camera(20));
    colour("keyframes/corrected_images/1000000.jpg", {16, 12});
    const Capture capture = open_capture(folder.path());
    EXPECT_TRUE(warned(capture.warnings, "1 of 2 frames have no corrected camera"));
    const Frame frame = capture.load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_pose(frame);
    expect_depth(frame);
    EXPECT_EQ(frame.depth_m(2, 2), 0);
    EXPECT_EQ(capture.entries[0].stamp_s, 1.0);
    expect_camera(capture.load(1), 15, 11, 3.5, 2.5);
}

TEST_F(Made, polycam_says_where_depths_are_guesses_and_poses_raw) {
    cv::Mat1w image(6, 8, ushort(2000));
    image.rowRange(3, 6) = 6000;
    picture("keyframes/depth/1.png", image);
    text("keyframes/cameras/1.json", R"({"fx": 10, "fy": 11, "cx": 3.5, "cy": 2.5, "width": 8, "height": 6, "t_00": 1,
        "t_01": 0, "t_02": 0, "t_03": 0, "t_10": 0, "t_11": 1, "t_12": 0, "t_13": 0, "t_20": 0, "t_21": 0, "t_22": 1,
        "t_23": 0})");
    const Capture capture = open_capture(folder.path());
    EXPECT_TRUE(warned(capture.warnings, "no corrected_cameras/"));
    EXPECT_TRUE(warned(capture.load(0).warnings, "50 % of the depths lie beyond 5 m"));
    EXPECT_TRUE(warned(capture.examine(0).frame.warnings, "50 % of the depths lie beyond 5 m"));
    image.rowRange(3, 6) = 4000;
    picture("keyframes/depth/1.png", image);
    EXPECT_FALSE(warned(open_capture(folder.path()).load(0).warnings, "beyond"));
}

TEST_F(Made, arkit_scenes_turn_from_world_to_camera) {
    depth("lowres_depth/42_1.000.png");
    depth("lowres_depth/42_9.000.png");
    text("lowres_wide_intrinsics/42_1.001.pincam", "8 6 10 11 3.5 2.5");
    // The inverse of the pose: a quarter turn back about z, and -R^T t.
    text("lowres_wide.traj", "1.002 0 0 -1.5707963267948966 -2 1 -3\n");
    const Capture capture = open_capture(folder.path());
    const Frame frame = capture.load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_pose(frame);
    expect_depth(frame);
    const Frame later = capture.load(1);
    EXPECT_FALSE(later.world_from_camera);
    EXPECT_TRUE(warned(later.warnings, "no camera file")) << "the nearest one's is taken";
}

TEST_F(Made, arkit_scenes_interpolates_between_rows_that_are_near_each_other) {
    for (const char* name : {"42_1.004", "42_1.050", "42_1.200", "42_2.100", "42_0.900"})
        depth(fmt::format("lowres_depth/{}.png", name));
    text("wide_intrinsics/42_1.000.pincam", "80 60 100 110 39.5 29.5"); // of an image ten times as large
    text("lowres_wide.traj", "1.0 0 0 0 0 0 0\n1.1 0 0 0 -1 0 0\n1.3 0 0 0 -3 0 0\n2.0 0 0 0 0 0 0\n2.5 0 0 0 0 0 0\n");
    const Capture capture = open_capture(folder.path());
    const auto x = [&](std::size_t i) {
        const auto& pose = capture.entries[i].world_from_camera;
        return pose ? std::optional(pose->translation().x()) : std::nullopt;
    };
    EXPECT_EQ(x(0), std::nullopt) << "before the first row";
    EXPECT_NEAR(x(1).value_or(-1), 0, 1e-12) << "within 5 ms a row is taken as it is";
    EXPECT_NEAR(x(2).value_or(-1), 0.5, 1e-9);
    EXPECT_NEAR(x(3).value_or(-1), 2, 1e-9) << "rows 0.2 s apart";
    EXPECT_EQ(x(4), std::nullopt) << "rows half a second apart";
    expect_camera(capture.load(1), 10, 11, 3.5, 2.5);
}

TEST_F(Made, scannetpp_takes_the_aligned_pose) {
    depth("depth/frame_000007.png");
    colour("rgb/frame_000007.jpg", {16, 12});
    text("pose_intrinsic_imu.json", R"({"frame_000007": {"timestamp": 7.5, "intrinsic": [[20,0,7.5],[0,22,5.5],[0,0,1]],
        "pose": [[1,0,0,9],[0,1,0,9],[0,0,1,9],[0,0,0,1]], "aligned_pose": [[0,-1,0,1],[1,0,0,2],[0,0,1,3],[0,0,0,1]]}})");
    const Capture capture = open_capture(folder.path());
    const Frame frame = capture.load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_pose(frame);
    expect_depth(frame);
    EXPECT_EQ(capture.entries[0].stamp_s, 7.5);
}

TEST_F(Made, scannetpp_keeps_frames_that_the_list_of_cameras_lacks) {
    depth("depth/frame_000000.png");
    depth("depth/frame_000001.png");
    text("pose_intrinsic_imu.json", R"({"frame_000000": {"intrinsic": [[2400,0,959.5],[0,2640,719.5],[0,0,1]],
        "aligned_pose": [[0,-1,0,1],[1,0,0,2],[0,0,1,3],[0,0,0,1]]}})");
    const Capture capture = open_capture(folder.path());
    expect_camera(capture.load(0), 10, 11, 3.5, 2.5);
    const Frame second = capture.load(1);
    expect_camera(second, 10, 11, 3.5, 2.5);
    EXPECT_FALSE(second.world_from_camera);
    EXPECT_TRUE(warned(second.warnings, "\"frame_000001\" is missing"));
}

} // namespace
} // namespace scanshade
