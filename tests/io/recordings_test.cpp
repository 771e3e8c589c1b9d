// Recordings as datasets and phones leave them: small ones made here, and samples with known truth from the folder
// SCANSHADE_RECORDINGS where it is given, NAME.truth.json beside each.
#include "io/captures/capture.h"
#include "tests/support/files.h"
#include "tests/support/small_capture.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

// ------------------------------------------------------------------------------------------------- made here

using tests::warned;
using tests::write_file;

/// A recording of one or two frames: 8x6 pixels at 2 m, pixel (1, 1) at 3 m, pixel (0, 0) a hole.
class Made : public testing::Test {
  protected:
    void depth(const std::string& name, double units_per_metre = 1000) {
        cv::Mat1w image(6, 8, static_cast<ushort>(2 * units_per_metre));
        image(0, 0) = 0;
        image(1, 1) = static_cast<ushort>(3 * units_per_metre);
        picture(name, image);
    }
    void colour(const std::string& name, cv::Size size) { picture(name, cv::Mat3b(size, {9, 99, 199})); }
    /// Low at (2, 2), high elsewhere.
    void confidence(const std::string& name) {
        cv::Mat1b image(6, 8, uchar(2));
        image(2, 2) = 0;
        image(3, 3) = 1;
        picture(name, image);
    }
    void picture(const std::string& name, const cv::Mat& image) {
        fs::create_directories((folder / name).parent_path());
        ASSERT_TRUE(cv::imwrite((folder / name).string(), image));
    }
    void text(const fs::path& name, const std::string& bytes) {
        fs::create_directories((folder / name).parent_path());
        write_file(folder / name, bytes);
    }
    /// A camera at (1, 2, 3), turned by a quarter about z: its x is the world's y.
    static constexpr const char* pose_rows = "0 -1 0 1\n1 0 0 2\n0 0 1 3\n0 0 0 1\n";
    static void expect_pose(const Frame& frame) {
        ASSERT_TRUE(frame.world_from_camera);
        EXPECT_LT((*frame.world_from_camera * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-6);
        EXPECT_LT((*frame.world_from_camera * Eigen::Vector3d(0, 0, 1) - Eigen::Vector3d(1, 2, 4)).norm(), 1e-6);
    }
    static void expect_depth(const Frame& frame) {
        EXPECT_EQ(frame.depth_m(0, 0), 0);
        EXPECT_NEAR(frame.depth_m(1, 1), 3, 1e-4);
        EXPECT_NEAR(frame.depth_m(5, 7), 2, 1e-4);
    }
    static void expect_camera(const Frame& frame, double fx, double fy, double cx, double cy) {
        const Pinhole& k = frame.camera.pinhole;
        EXPECT_EQ(k.size, cv::Size(8, 6));
        EXPECT_NEAR(k.fx, fx, 1e-6);
        EXPECT_NEAR(k.fy, fy, 1e-6);
        EXPECT_NEAR(k.cx, cx, 1e-6);
        EXPECT_NEAR(k.cy, cy, 1e-6);
    }
    tests::TemporaryFolder folder;
};

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

std::string floats(const std::vector<float>& values) {
    return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)};
}

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

TEST_F(Made, icl_nuims_files_for_povray_are_refused_by_name) {
    text("scene_00_0000.depth", "1 2 3");
    EXPECT_TRUE(tests::says(tests::refusal([&] { (void)open_capture(folder.path()); }), "POV-Ray"));
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

TEST_F(Made, colmaps_models_are_no_clouds) {
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"})
        text(name, std::string(32, '\0'));
    EXPECT_THROW((void)open_capture(folder.path()), NoFrames);
}

// ------------------------------------------------------------------------------------------------- samples

class Samples : public testing::TestWithParam<const char*> {};

void expect_camera(const Frame& frame, const Json& truth, double tolerance) {
    const Pinhole& k = frame.camera.pinhole;
    EXPECT_EQ(k.size, cv::Size(truth["size"][0], truth["size"][1]));
    const double found[] = {k.fx, k.fy, k.cx, k.cy};
    for (std::size_t i = 0; i < 4; ++i)
        EXPECT_NEAR(found[i], truth["K"][i].get<double>(), tolerance) << "fx fy cx cy"[3 * i] << i;
}

void expect_pose(const Frame& frame, const Json& truth, double tolerance) {
    ASSERT_EQ(frame.world_from_camera.has_value(), !truth.is_null());
    for (int row = 0; !truth.is_null() && row < 3; ++row)
        for (int column = 0; column < 4; ++column)
            EXPECT_NEAR(frame.world_from_camera->matrix()(row, column),
                        truth[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)].get<double>(),
                        tolerance);
}

void expect_depth(const Frame& frame, const Json& truth, bool confidence, double tolerance) {
    int holes = cv::countNonZero(frame.depth_m == 0);
    const auto hole = [&](const Json& pixel) { EXPECT_EQ(frame.depth_m(pixel[1].get<int>(), pixel[0].get<int>()), 0); };
    if (!confidence) {
        EXPECT_EQ(holes, truth["holes"].get<int>());
        std::ranges::for_each(truth["hole_pixels"], hole);
    } else {
        EXPECT_GE(holes, truth["holes"].get<int>());
    }
    for (const Json& probe : truth["probes"]) {
        const float z = frame.depth_m(probe["v"].get<int>(), probe["u"].get<int>());
        if (z > 0 || !confidence) {
            EXPECT_NEAR(static_cast<double>(z), probe["z_m"].get<double>(), tolerance) << probe.dump();
        }
    }
}

void expect_cloud(const Frame& frame, const Json& truth, const Json& tolerance) {
    ASSERT_TRUE(frame.cloud);
    EXPECT_EQ(frame.cloud->points.size(), truth["points"].get<std::size_t>());
    expect_pose(frame, truth["world_from_sensor"], tolerance["pose"]);
    const auto point = [](const Json& three) { return Eigen::Vector3d(three[0], three[1], three[2]); };
    for (const Json& probe : truth["probes"]) {
        const Eigen::Vector3d found = frame.cloud->points.at(probe["index"].get<std::size_t>());
        EXPECT_LT((found - point(probe["sensor"])).norm(), 1e-6) << probe.dump();
        EXPECT_LT((*frame.world_from_camera * found - point(probe["world"])).norm(), tolerance["point"].get<double>())
            << probe.dump();
    }
}

TEST_P(Samples, are_read_as_their_truth_says) {
    const char* const folder = std::getenv("SCANSHADE_RECORDINGS");
    if (!folder || !fs::exists(fs::path(folder) / (std::string(GetParam()) + ".truth.json")))
        GTEST_SKIP() << "no sample of " << GetParam() << " in SCANSHADE_RECORDINGS";
    std::ifstream stream(fs::path(folder) / (std::string(GetParam()) + ".truth.json"));
    const Json truth = Json::parse(stream);
    const Capture capture = open_capture(fs::path(folder) / truth["open"].get<std::string>());
    const Json& frames = truth["frames"];
    ASSERT_EQ(capture.entries.size(), frames.size());
    const Json& tolerance = truth["tolerance"];
    for (std::size_t i = 0; i < frames.size(); ++i) {
        SCOPED_TRACE(fmt::format("{} frame {}", capture.kind, capture.entries[i].name));
        Frame frame = capture.load(i);
        if (capture.unit.arbitrary()) { // the truth is in the recording's units
            frame.depth_m *= capture.unit.units_per_length;
            if (frame.world_from_camera)
                frame.world_from_camera->translation() *= capture.unit.units_per_length;
        }
        if (truth["kind"] == "clouds") {
            EXPECT_EQ(frame.name, frames[i]["name"].get<std::string>());
            expect_cloud(frame, frames[i], tolerance);
            ASSERT_TRUE(capture.entries[i].stamp_s);
            EXPECT_NEAR(*capture.entries[i].stamp_s, frames[i]["stamp_s"].get<double>(), 1e-4);
            continue;
        }
        expect_camera(frame, frames[i], tolerance["k_px"]);
        expect_pose(frame, frames[i]["world_from_camera"], tolerance["pose"]);
        expect_depth(frame, frames[i], !truth["confidence"].is_null(), tolerance["depth_m"]);
        if (const Json& stamp = frames[i]["stamp_s"]; !stamp.is_null()) {
            ASSERT_TRUE(capture.entries[i].stamp_s);
            EXPECT_NEAR(*capture.entries[i].stamp_s, stamp.get<double>(), 1e-4);
        }
        if (const Json& registered = truth["registered"]; registered.is_boolean()) {
            EXPECT_EQ(frame.registration == Registration::yes, registered.get<bool>());
        }
        if (!capture.entries[i].colour.empty() && (frame.registration == Registration::yes || frame.colour_camera)) {
            EXPECT_FALSE(frame.colour.empty());
        }
        if (const Json& lens = truth["distortion"]; lens.is_object()) {
            const Distortion& d = frame.camera.distortion;
            EXPECT_NEAR(d.k1, lens["k1"].get<double>(), 1e-9);
            EXPECT_NEAR(d.p2, lens["p2"].get<double>(), 1e-9);
            for (const auto& [key, found] : {std::pair{"p1", d.p1}, {"k3", d.k3}, {"k4", d.k4}, {"k6", d.k6}})
                if (lens.contains(key)) {
                    EXPECT_NEAR(found, lens[key].get<double>(), 1e-9) << key;
                }
        }
        if (const Json& colour = truth["colour_camera"]; colour.is_object()) {
            ASSERT_TRUE(frame.colour_camera);
            const Pinhole& k = frame.colour_camera->camera.pinhole;
            EXPECT_NEAR(k.fx, colour["K"][0].get<double>(), 0.01);
            EXPECT_NEAR(k.cy, colour["K"][3].get<double>(), 0.01);
            EXPECT_EQ(k.size, cv::Size(colour["size"][0], colour["size"][1]));
        }
        if (testing::Test::HasFailure())
            break;
    }
    if (const Json& sure = truth["confidence"]; sure.is_object()) {
        EXPECT_EQ(cv::countNonZero(capture.load(0).depth_m == 0),
                  frames[0]["holes_without_lowest_confidence"].get<int>());
    }
}

std::optional<Json> truth_of(const std::string& layout) {
    const char* const folder = std::getenv("SCANSHADE_RECORDINGS");
    if (!folder || !fs::exists(fs::path(folder) / (layout + ".truth.json")))
        return std::nullopt;
    std::ifstream stream(fs::path(folder) / (layout + ".truth.json"));
    return Json::parse(stream);
}

TEST(SampleFolders, sun_rgbd_is_a_capture_for_each_image) {
    const std::optional<Json> truth = truth_of("sunrgbd");
    if (!truth)
        GTEST_SKIP() << "no sample of sunrgbd in SCANSHADE_RECORDINGS";
    const fs::path folder = std::getenv("SCANSHADE_RECORDINGS");
    EXPECT_EQ(captures_below(folder / (*truth)["open"].get<std::string>()).size(), (*truth)["frames"].size());
    for (const Json& each : (*truth)["frames"]) {
        const Capture capture = open_capture(folder / each["open"].get<std::string>());
        EXPECT_EQ(capture.kind, "SUN RGB-D");
        ASSERT_EQ(capture.entries.size(), 1U);
        const Frame frame = capture.load(0);
        expect_camera(frame, each, (*truth)["tolerance"]["k_px"]);
        expect_depth(frame, each, false, (*truth)["tolerance"]["depth_m"]);
        EXPECT_EQ(frame.registration, Registration::yes);
        EXPECT_FALSE(frame.colour.empty());
    }
}

TEST(SampleFolders, a_generic_folder_names_what_it_did_not_use) {
    const std::optional<Json> truth = truth_of("generic-unused");
    if (!truth)
        GTEST_SKIP() << "no sample of generic-unused in SCANSHADE_RECORDINGS";
    const Capture capture =
        open_capture(fs::path(std::getenv("SCANSHADE_RECORDINGS")) / (*truth)["open"].get<std::string>());
    EXPECT_TRUE(warned(capture.warnings, "not used, though their names speak of poses or cameras: calibration.npz, "
                                         "camera_poses.csv, pose."));
    ASSERT_EQ(capture.entries.size(), (*truth)["frames"].size());
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        const Frame frame = capture.load(i);
        expect_depth(frame, (*truth)["frames"][i], false, (*truth)["tolerance"]["depth_m"]);
        EXPECT_FALSE(frame.world_from_camera);
    }
}

INSTANTIATE_TEST_SUITE_P(of, Samples,
                         testing::Values("scannet-export", "nerfstudio", "nerfstudio-perframe", "instant-ngp", "stray",
                                         "polycam", "arkitscenes", "bop", "replica", "icl-nuim", "scannetpp-iphone",
                                         "nyu-raw", "npy-folder", "scannet-sens", "ros1-bag", "ros1-bag-bz2",
                                         "ros1-bag-lz4", "ros2-db3", "mcap", "mcap-lz4", "mcap-zstd", "realsense-bag",
                                         "realsense-db3", "kitti-odometry", "nuscenes", "npz", "scannetpp-raw",
                                         "scannetpp-raw-lz4", "record3d", "azure-mkv", "colmap-dense",
                                         "colmap-dense-text", "hypersim"),
                         [](const auto& layout) {
                             std::string name = layout.param;
                             std::ranges::replace(name, '-', '_');
                             return name;
                         });

} // namespace
} // namespace scanshade
