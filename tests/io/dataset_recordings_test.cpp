// Recordings as datasets leave them: ScanNet, BOP, Replica, ICL-NUIM, SUN RGB-D, and the sweeps of KITTI and nuScenes.
#include "io/captures/capture.h"
#include "tests/support/made_recording.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

TEST_F(Made, scannet_has_matrices_and_a_colour_camera) {
    depth("depth/0.png");
    depth("depth/10.png");
    colour("color/0.jpg", {16, 12});
    text("pose/0.txt", pose_rows);
    text("pose/10.txt", "-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n");
    text("intrinsic/intrinsic_depth.txt", "10 0 3.4 0\n0 11 2.6 0\n0 0 1 0\n0 0 0 1\n");
    text("intrinsic/intrinsic_color.txt", "20 0 7.5 0\n0 21 5.5 0\n0 0 1 0\n0 0 0 1\n");
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "ScanNet");
    const Frame frame = capture.load(0);
    expect_camera(frame, 10, 11, 3.4, 2.6);
    expect_pose(frame);
    expect_depth(frame);
    ASSERT_TRUE(frame.colour_camera);
    EXPECT_EQ(frame.colour_camera->camera.pinhole.fy, 21);
    EXPECT_EQ(frame.colour.size(), cv::Size(16, 12));
    EXPECT_EQ(frame.registration, Registration::no);
    const Frame lost = capture.load(1);
    EXPECT_FALSE(lost.world_from_camera);
    EXPECT_TRUE(warned(lost.warnings, "tracking was lost"));
}

TEST_F(Made, scannet_takes_scan_txt_where_intrinsic_is_missing) {
    depth("scene0000_00/depth/0.png");
    colour("scene0000_00/color/0.jpg", {16, 12});
    text("scene0000_00/pose/0.txt", pose_rows);
    text("scene0000_00/scene0000_00.txt", "axisAlignment = 1 0 0 0\nfx_depth = 10\nfy_depth = 11\nmx_depth = 3.4\n"
                                          "my_depth = 2.6\ndepthWidth = 8\ndepthHeight = 6\nfx_color = 40\nfy_color = "
                                          "44\nmx_color = 15.5\nmy_color = 11.5\ncolorWidth = 32\ncolorHeight = 24\n");
    const Frame frame = open_capture(folder / "scene0000_00").load(0);
    expect_camera(frame, 10, 11, 3.4, 2.6);
    expect_pose(frame);
    ASSERT_TRUE(frame.colour_camera);
    EXPECT_NEAR(frame.colour_camera->camera.pinhole.fx, 20, 1e-9) << "colour images are half as large";
    EXPECT_EQ(frame.registration, Registration::no);
    fs::rename(folder / "scene0000_00/scene0000_00.txt", folder / "scene0000_00.txt");
    expect_camera(open_capture(folder / "scene0000_00").load(0), 10, 11, 3.4, 2.6);
}

TEST_F(Made, scannet_frames_25k_has_its_intrinsics_without_a_folder) {
    depth("depth/000100.png");
    colour("color/000100.jpg", {8, 6});
    text("pose/000100.txt", pose_rows);
    text("intrinsics_depth.txt", "10 0 3.5 0\n0 11 2.5 0\n0 0 1 0\n0 0 0 1\n");
    text("intrinsics_color.txt", "20 0 7.5 0\n0 22 5.5 0\n0 0 1 0\n0 0 0 1\n"); // of twice the size
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "ScanNet");
    const Frame frame = capture.load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_pose(frame);
    ASSERT_TRUE(frame.colour_camera);
    EXPECT_NEAR(frame.colour_camera->camera.pinhole.fx, 10, 1e-9);
    EXPECT_TRUE(warned(capture.warnings, "scaled to 8x6"));
}

TEST_F(Made, nice_slams_copy_of_scannet_has_frames_between) {
    depth("scene0000_00/frames/depth/0.png");
    text("scene0000_00/frames/pose/0.txt", pose_rows);
    text("scene0000_00/frames/intrinsic/intrinsic_depth.txt", "10 0 3.5 0\n0 11 2.5 0\n0 0 1 0\n0 0 0 1\n");
    const Capture capture = open_capture_at_or_below(folder / "scene0000_00");
    EXPECT_EQ(capture.kind, "ScanNet");
    expect_pose(capture.load(0));
    EXPECT_EQ(captures_below(folder.path()), std::vector<fs::path>()) << "one level, no more";
}

TEST_F(Made, sens_readers_cpp_exporter_writes_big_endian_pgm_and_info_with_an_underscore) {
    std::string pixels;
    for (int i = 0; i < 48; ++i)
        pixels += i == 0   ? std::string(2, '\0')
                  : i == 9 ? std::string("\x0b\xb8")
                           : std::string("\x07\xd0"); // 3000, 2000
    text("frame-000000.depth.pgm", "P5\n8 6\n65535\n" + pixels);
    text("frame-000000.pose.txt", pose_rows);
    text("_info.txt",
         "m_depthWidth = 8\nm_depthHeight = 6\nm_depthShift = 1000\nm_calibrationDepthIntrinsic = 10 0 3.5 "
         "0 0 11 2.5 0 0 0 1 0 0 0 0 1\n");
    const Frame frame = open_capture(folder.path()).load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_pose(frame);
    expect_depth(frame);
}

TEST_F(Made, bop_has_a_camera_and_a_unit_for_each_image) {
    depth("depth/000001.png", 10000);
    depth("depth/000002.png", 1000);
    text("scene_camera.json", R"({"1": {"cam_K": [10,0,3.5,0,11,2.5,0,0,1], "depth_scale": 0.1,
        "cam_R_w2c": [0,1,0,-1,0,0,0,0,1], "cam_t_w2c": [-2000,1000,-3000]},
        "2": {"cam_K": [12,0,3.5,0,11,2.5,0,0,1], "depth_scale": 1}})");
    const Capture capture = open_capture(folder.path());
    const Frame frame = capture.load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_pose(frame);
    expect_depth(frame);
    const Frame second = capture.load(1);
    expect_camera(second, 12, 11, 3.5, 2.5);
    expect_depth(second);
    EXPECT_FALSE(second.world_from_camera);
}

TEST_F(Made, bop_scenes_of_several_sensors_are_a_capture_each) {
    const auto scene = [&](const std::string& camera, double fx) {
        depth("000001/depth" + camera + "/000003.png");
        text("000001/scene_camera" + camera + ".json",
             fmt::format(R"({{"3": {{"cam_K": [{},0,3.5,0,11,2.5,0,0,1], "depth_scale": 1}}}})", fx));
    };
    scene("_left", 10);
    const Capture only = open_capture_at_or_below(folder / "000001");
    EXPECT_EQ(only.kind, "BOP");
    expect_camera(only.load(0), 10, 11, 3.5, 2.5);
    EXPECT_TRUE(warned(only.warnings, "1 of 1 image have no pose"));
    scene("_right", 12);
    EXPECT_EQ(captures_below(folder / "000001"),
              (std::vector<fs::path>{folder / "000001/depth_left", folder / "000001/depth_right"}));
    expect_camera(open_capture(folder / "000001/depth_right/").load(0), 12, 11, 3.5, 2.5);
    EXPECT_THROW((void)open_capture_at_or_below(folder / "000001"), Error);
}

TEST_F(Made, replica_counts_rows_and_states_its_unit) {
    depth("room0/results/depth000000.png", 5000);
    colour("room0/results/frame000000.jpg", {8, 6});
    text("room0/traj.txt", "0 -1 0 1 1 0 0 2 0 0 1 3 0 0 0 1\n");
    text("cam_params.json", R"({"camera": {"w": 8, "h": 6, "fx": 10, "fy": 11, "cx": 3.5, "cy": 2.5, "scale": 5000}})");
    const Frame frame = open_capture(folder / "room0").load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_pose(frame);
    expect_depth(frame);
    EXPECT_FALSE(frame.colour.empty());
}

TEST_F(Made, icl_nuim_is_mirrored_and_its_first_frame_has_no_pose) {
    depth("depth/0.png", 5000);
    depth("depth/1.png", 5000);
    text("associations.txt", "0 depth/0.png 0 rgb/0.png\n1 depth/1.png 1 rgb/1.png\n");
    // y mirrored in world and camera: t = (1, -2, 3), and a quarter turn back.
    text("traj0.gt.freiburg", "1 1 -2 3 0 0 -0.7071067811865476 0.7071067811865476\n");
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "ICL-NUIM");
    EXPECT_FALSE(capture.load(0).world_from_camera);
    const Frame frame = capture.load(1);
    expect_pose(frame);
    expect_depth(frame);
    EXPECT_NEAR(frame.camera.pinhole.fy, 480.0 * 8 / 640, 1e-9);
}

TEST_F(Made, icl_nuims_files_for_povray_are_refused_by_name) {
    text("scene_00_0000.depth", "1 2 3");
    EXPECT_TRUE(tests::says(tests::refusal([&] { (void)open_capture(folder.path()); }), "POV-Ray"));
}

TEST_F(Made, sun_rgbd_rotates_the_bits_of_its_depth) {
    cv::Mat1w image(6, 8, static_cast<ushort>(2000 << 3));
    image(0, 0) = 0;
    image(1, 1) = 3000 << 3;
    picture("depth/a.png", image);
    colour("image/a.jpg", {8, 6});
    text("intrinsics.txt", "10 0 3.5 0 11 2.5 0 0 1 ");
    const Frame frame = open_capture(folder.path()).load(0);
    expect_camera(frame, 10, 11, 3.5, 2.5);
    expect_depth(frame);
    EXPECT_EQ(frame.registration, Registration::yes);
}

// ------------------------------------------------------------------------------------------------- sweeps

TEST_F(Made, kitti_sweeps_have_the_pose_of_their_scanner) {
    const fs::path sequence = "dataset/sequences/07";
    for (const char* name : {"000000", "000002"})
        text(sequence / "velodyne" / (std::string(name) + ".bin"), floats({1, 0, 0, 0.5F, 0, 2, 0, 0.25F}));
    text(sequence / "calib.txt", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0.5\n");
    text(sequence / "times.txt", "0\n0.5\n1\n");
    text("dataset/poses/07.txt", "1 0 0 1 0 1 0 2 0 0 1 3\n1 0 0 9 0 1 0 9 0 0 1 9\n1 0 0 nan 0 1 0 0 0 0 1 0\n");
    const Capture capture = open_capture(folder / sequence);
    EXPECT_EQ(capture.kind, "KITTI odometry");
    ASSERT_EQ(capture.entries.size(), 2U);
    const Frame frame = capture.load(0);
    ASSERT_TRUE(frame.world_from_camera);
    ASSERT_EQ(frame.cloud->points.size(), 2U);
    EXPECT_LT((frame.cloud->points[0] - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12) << "clouds stay in their frame";
    EXPECT_LT((*frame.world_from_camera * frame.cloud->points[0] - Eigen::Vector3d(1, 2, 4.5)).norm(), 1e-9);
    EXPECT_EQ(capture.entries[1].stamp_s, 1.0) << "rows are sweeps by number";
    EXPECT_FALSE(capture.load(1).world_from_camera);
    EXPECT_TRUE(warned(capture.load(1).warnings, "07.txt line 3: the pose has NaN"));
    EXPECT_TRUE(warned(capture.warnings, "3 poses, velodyne/ has 2 sweeps"));
}

TEST_F(Made, kitti_without_calibration_of_the_scanner_is_read_without_poses) {
    text("velodyne/000000.bin", floats({1, 0, 0, 0.5F}));
    text("calib.txt", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\n");
    text("poses.txt", "1 0 0 1 0 1 0 2 0 0 1 3\n");
    const Capture capture = open_capture(folder.path());
    EXPECT_TRUE(warned(capture.warnings, "no line \"Tr:\""));
    EXPECT_FALSE(capture.load(0).world_from_camera);
}

TEST_F(Made, nuscenes_poses_multiply_and_points_have_rings) {
    // In the order of the table; time decides. The second's pose is missing, the third is out of the folder.
    text("v1.0-mini/sample_data.json", R"([
        {"filename": "sweeps/LIDAR_TOP/b.pcd.bin", "timestamp": 2000000, "ego_pose_token": "none", "calibrated_sensor_token": "c", "prev": "a"},
        {"filename": "samples/LIDAR_TOP/a.pcd.bin", "timestamp": 1000000, "ego_pose_token": "e", "calibrated_sensor_token": "c", "prev": ""},
        {"filename": "../x.pcd.bin", "timestamp": 1, "ego_pose_token": "e", "calibrated_sensor_token": "c", "prev": ""},
        {"filename": "sweeps/LIDAR_TOP/gone.pcd.bin", "timestamp": 1, "ego_pose_token": "e", "calibrated_sensor_token": "c", "prev": ""},
        {"filename": "samples/CAM_FRONT/a.jpg", "timestamp": 1, "ego_pose_token": "e", "calibrated_sensor_token": "c", "prev": ""}])");
    text("v1.0-mini/ego_pose.json", R"([{"token": "e", "translation": [1000, 2000, 0],
        "rotation": [0.7071067811865476, 0, 0, 0.7071067811865476]}])");
    text("v1.0-mini/calibrated_sensor.json", R"([{"token": "c", "translation": [1, 0, 2], "rotation": [1, 0, 0, 0]}])");
    text("samples/LIDAR_TOP/a.pcd.bin", floats({1, 0, 0, 9, 31, 0, 1, 0, 9, 0, 0, 0, 1, 9, 7, 5, 5, 5, 5, 5}));
    text("sweeps/LIDAR_TOP/b.pcd.bin", floats({1, 0, 0, 9})); // 16 bytes: no whole point
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "nuScenes");
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_TRUE(warned(capture.warnings, "leaves the capture's folder"));
    EXPECT_TRUE(warned(capture.warnings, "1 sweep named there that do not exist")) << "gone";
    const Frame frame = capture.load(0);
    EXPECT_EQ(frame.name, "a");
    EXPECT_EQ(capture.entries[0].stamp_s, 1.0);
    ASSERT_EQ(frame.cloud->points.size(), 4U);
    ASSERT_TRUE(frame.world_from_camera);
    EXPECT_LT((*frame.world_from_camera * frame.cloud->points[0] - Eigen::Vector3d(1000, 2002, 2)).norm(), 1e-9);
    EXPECT_FALSE(capture.entries[1].world_from_camera);
    EXPECT_TRUE(warned(capture.entries[1].warnings, "no token"));
    EXPECT_THROW((void)capture.load(1), Error);
}

TEST_F(Made, nuscenes_tables_are_read_in_blocks_and_their_damage_is_named) {
    text("samples/LIDAR_TOP/a.pcd.bin", floats({1, 2, 3, 4, 5}));
    const std::string lidar =
        R"({"token": "t", "filename": "samples/LIDAR_TOP/a.pcd.bin", "timestamp": 7, "ego_pose_token": "e", "calibrated_sensor_token": "c", "prev": "", "x": [[1, {"filename": "y"}], null]})";
    const std::string pose = R"("translation": [1, 2, 3], "rotation": [1, 0, 0, 0])";
    std::string table = "[";
    while (table.size() < (3U << 20)) // the row that counts lies behind some blocks
        table += R"({"token": "0", "filename": "samples/CAM_FRONT/a.jpg", "prev": "", "timestamp": 1}, )";
    text("v1.0-trainval/sample_data.json", table + lidar + "]");
    text("v1.0-trainval/ego_pose.json", R"([{"token": "other", )" + pose + R"(}, {)" + pose + R"(, "token": "e"}])");
    text("v1.0-trainval/calibrated_sensor.json", R"([{"token": "c", )" + pose + R"(, "camera_intrinsic": [[1]]}])");
    const Capture capture = open_capture(folder.path());
    ASSERT_EQ(capture.entries.size(), 1U);
    EXPECT_EQ(capture.entries[0].stamp_s, 7e-6);
    ASSERT_TRUE(capture.entries[0].world_from_camera);
    EXPECT_EQ(capture.entries[0].world_from_camera->translation(), Eigen::Vector3d(2, 4, 6));
    for (const auto& [damaged, said] :
         {std::pair<std::string, const char*>{table + lidar, "not JSON"},
          {"{\"a\": 1}", "expected a list of objects"},
          {"[[1]]", "expected a list of objects"},
          {"[1]", "expected a list of objects"},
          {"", "byte 0: not JSON"},
          {"[{\"a\": NaN}]", "byte 7: not JSON"},
          {"[{\"a\": " + std::string(100, '['), "nested deeper than 64"},
          {"[{\"a\": \"" + std::string(5 << 20, 'a'), "a word of more than"},
          {"[" + lidar + ", {\"filename\": \"samples/LIDAR_TOP/a.pcd.bin\"}]", "\"timestamp\" is missing"}}) {
        text("v1.0-trainval/sample_data.json", damaged);
        const std::string refused = tests::refusal([&] { (void)open_capture(folder.path()); });
        EXPECT_TRUE(tests::says(refused, said));
        EXPECT_TRUE(tests::says(refused, "sample_data.json"));
    }
}

} // namespace
} // namespace scanshade
