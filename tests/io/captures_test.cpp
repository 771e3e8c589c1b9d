// Captures in every layout but TUM's: what is paired, which camera, pose and unit a frame gets, what is doubted.
#include "io/captures/capture.h"
#include "tests/support/wall_captures.h"

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <sys/resource.h>

namespace scanshade {
namespace {

using namespace tests;

/// The world point that a pixel shows, up to the sign of the world's y.
Eigen::Vector3d in_world(const Capture& capture, std::size_t index, double fy, double y_sign) {
    const Pinhole& camera = capture.camera->pinhole;
    const Eigen::Vector3d seen((20 - camera.cx) / camera.fx * 2, (10 - camera.cy) / fy * 2, 2);
    Eigen::Vector3d world = *capture.entries[index].world_from_camera * seen;
    world.y() *= y_sign;
    return world;
}

TEST(captures, poses_of_cameras_with_y_upwards_are_turned_with_them) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 3);
    write_file(folder / "camera.json", R"({"fx": 50, "fy": 50, "cx": 31.5, "cy": 23.5, "width": 64, "height": 48})");
    const Capture as_written = open_capture(folder.path());
    write_file(folder / "camera.json", R"({"fx": 50, "fy": -50, "cx": 31.5, "cy": 23.5, "width": 64, "height": 48})");
    const Capture turned = open_capture(folder.path());
    EXPECT_EQ(turned.camera->pinhole.fy, 50);
    for (std::size_t i = 0; i < 3; ++i) {
        ASSERT_TRUE(turned.entries[i].world_from_camera.has_value());
        EXPECT_NEAR(turned.entries[i].world_from_camera->linear().determinant(), 1, 1e-9) << "a rotation, no mirror";
        // What fy = -50 meant with the poses as they are, and what is read, differ by the sign of the world's y only.
        EXPECT_TRUE(in_world(turned, i, 50, -1).isApprox(in_world(as_written, i, -50, 1), 1e-9)) << i;
    }
}

TEST(captures, a_single_depth_image_takes_the_colour_that_the_user_names) {
    const TemporaryFolder folder;
    write_pair(folder / "c.png", folder / "d.png", 1000);
    CaptureOptions options;
    options.colour = folder / "c.png";
    const Capture capture = open_capture(folder / "d.png", options);
    EXPECT_EQ(capture.registration, Registration::yes);
    EXPECT_FALSE(capture.load(0).colour.empty());
    options.colour = folder / "none.png";
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder / "d.png", options); }), "none.png: no such file"));
    options.colour = folder / "c.png";
    write_tum(folder / "tum", 1);
    EXPECT_THROW((void)open_capture(folder / "tum", options), Misuse);
}

TEST(captures, a_cameras_depth_correction_reaches_the_frames_and_holes_stay) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 1);
    write_camera(folder / "camera.json");
    const cv::Mat1f plain = open_capture(folder.path()).load(0).depth_m;
    CameraFile file = read_camera_file(folder / "camera.json");
    file.depth_correction = {1.02, -0.01, 0.005};
    write_camera_file(folder / "camera.json", file);
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.depth_correction, file.depth_correction);
    const cv::Mat1f corrected = capture.load(0).depth_m;
    for (int i = 0; i < corrected.size().area(); ++i) {
        const double z = plain.ptr<float>()[i];
        EXPECT_NEAR(corrected.ptr<float>()[i], z > 0 ? 1.02 * z - 0.01 + 0.005 * z * z : 0, 1e-6);
    }
}

static_assert(sizeof(CaptureEntry) <= 216, "a million of them, with names and paths, take 300 MB");

TEST(captures, stored_paths_are_the_paths_that_they_were_given) {
    for (const std::string path : {"", "a.png", "/a.png", "depth/a.png", "/data/depth/a b.png", "./a", "a/", "/"}) {
        const StoredPath stored(path);
        EXPECT_EQ(stored.string(), path);
        EXPECT_EQ(stored.path(), std::filesystem::path(path));
        EXPECT_EQ(stored.empty(), path.empty());
        const StoredPath copy = stored; // NOLINT(performance-unnecessary-copy-initialization): what is tested
        EXPECT_EQ(copy, stored);
        EXPECT_EQ(fmt::format("{}", copy), path);
    }
    StoredPath changed("depth/a.png");
    const StoredPath before = changed;
    changed = std::filesystem::path("colour/b.png");
    EXPECT_EQ(before, "depth/a.png");
    EXPECT_EQ(changed, "colour/b.png");
}

TEST(captures, the_users_words_override_the_captures) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 1);
    write_file(folder / "camera.json", "not even JSON"); // not needed
    CaptureOptions options;
    options.camera = "70,70,31.5,23.5";
    options.depth_scale = "2500";
    const Capture capture = open_capture(folder.path(), options);
    EXPECT_EQ(capture.camera->pinhole.fx, 70);
    EXPECT_EQ(capture.camera->pinhole.size, cv::Size(64, 48)); // from the images
    EXPECT_EQ(capture.depth.origin, "--depth-scale");
    EXPECT_NEAR(capture.load(0).depth_m(0, 1), 2 * wall()(0, 1), 0.001);
}

TEST(captures, seven_scenes_reads_matrices_and_never_claims_registration) {
    const TemporaryFolder folder;
    for (const char* name : {"frame-000009", "frame-000010"}) {
        write_pair(folder / (std::string(name) + ".color.jpg"), folder / (std::string(name) + ".depth.png"), 1000);
        write_file(folder / (std::string(name) + ".pose.txt"), "0 -1 0 5\n1 0 0 6\n0 0 1 7\n0 0 0 1\n");
    }
    write_file(folder / "camera-intrinsics.txt", "60 0 31.5\n0 60 23.5\n0 0 1\n");
    write_file(folder / "Thumbs.db", "foreign");
    write_file(folder / "._frame-000009.depth.png", "foreign");
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "7-Scenes / BundleFusion");
    EXPECT_EQ(capture.registration, Registration::no);
    ASSERT_EQ(capture.entries.size(), 2);
    const Frame frame = capture.load(1);
    EXPECT_EQ(frame.name, "frame-000010");
    EXPECT_EQ(frame.camera.pinhole.size, cv::Size(64, 48));
    EXPECT_TRUE((*frame.world_from_camera * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(5, 7, 7)));
}

TEST(captures, a_lost_pose_is_left_out_and_the_frame_stays) {
    const TemporaryFolder folder;
    write_pair(folder / "frame-000001.color.jpg", folder / "frame-000001.depth.png", 1000);
    write_file(folder / "frame-000001.pose.txt",
               "-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n0 0 0 1\n");
    const Frame frame = open_capture(folder.path()).load(0);
    EXPECT_FALSE(frame.world_from_camera);
    EXPECT_TRUE(warned(frame.warnings, "tracking was lost"));
}

constexpr const char* open3d_camera =
    R"({"width": 64, "height": 48, "intrinsic_matrix": [60, 0, 0, 0, 61, 0, 31.5, 23.5, 1]})";

TEST(captures, redwood_reads_match_log_and_column_major_camera) {
    const TemporaryFolder folder;
    write_pair(folder / "color/b.jpg", folder / "depth/00000.png", 1000);
    write_pair(folder / "color/a.jpg", folder / "depth/00001.png", 1000);
    write_file(folder / "rgbd.match", "depth/00000.png color/b.jpg\ncolor/a.jpg depth/00001.png\n");
    write_file(folder / "trajectory.log",
               "0 0 1\n1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n1 1 2\n1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n");
    write_file(folder / "camera_primesense.json", open3d_camera);
    write_file(folder / "camera_trajectory.json", "{}"); // poses, whatever its name begins with
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "Redwood / Open3D");
    EXPECT_EQ(capture.camera->pinhole.fy, 61);
    EXPECT_TRUE(says(capture.depth.origin, "assumed"));
    ASSERT_EQ(capture.entries.size(), 2);
    EXPECT_EQ(capture.entries[0].colour.path().filename(), "b.jpg");
    EXPECT_EQ(capture.entries[1].colour.path().filename(), "a.jpg");
    EXPECT_EQ(capture.load(1).world_from_camera->translation(), Eigen::Vector3d(4, 5, 6));
}

TEST(captures, colour_and_depth_folders_pair_by_name_in_natural_order) {
    const TemporaryFolder folder;
    for (const char* name : {"2", "10"})
        write_pair(folder / ("color/" + std::string(name) + ".png"), folder / ("depth/" + std::string(name) + ".png"),
                   1000);
    write_file(folder / "pose.txt", "0 0 0 0 0 0 1\n7 8 9 0 0 0 1"); // row N is image N's
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "colour and depth folders");
    EXPECT_FALSE(capture.camera);
    EXPECT_TRUE(warned(capture.warnings, "--camera"));
    ASSERT_EQ(capture.entries.size(), 2);
    EXPECT_EQ(capture.entries[0].name, "2");
    EXPECT_EQ(capture.load(0).world_from_camera->translation(), Eigen::Vector3d(7, 8, 9));
    EXPECT_TRUE(warned(capture.load(1).warnings, "pose.txt has no row"));
    EXPECT_TRUE(says(refusal([&] { check(capture.load(0).camera); }), "--camera"));
}

TEST(captures, depth_folders_need_no_colour) {
    const TemporaryFolder folder;
    write_depth_png(folder / "depth/1.png", wall(), 1000);
    EXPECT_TRUE(open_capture(folder.path()).load(0).colour.empty());
    const Capture flat = open_capture(folder / "depth");
    EXPECT_EQ(flat.kind, "depth images");
    EXPECT_LE(worst_difference(flat.load(0).depth_m, wall()), 0.00051);
}

TEST(captures, single_files_are_captures_of_one_frame) {
    const TemporaryFolder folder;
    write_float_tiff(folder / "d.tiff", wall());
    const Capture depth = open_capture(folder / "d.tiff");
    EXPECT_EQ(depth.kind, "depth image");
    EXPECT_EQ(depth.depth.origin, "assumed: floats are metres");
    EXPECT_EQ(worst_difference(depth.load(0).depth_m, wall()), 0);
    const auto cloud_file =
        write_file(folder / "c.dat", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                                     "property float z\nend_header\n1 2 3\n");
    const Capture cloud = open_capture(cloud_file); // recognised by content
    EXPECT_EQ(cloud.kind, "cloud");
    EXPECT_EQ(cloud.load(0).cloud->points[0], Eigen::Vector3d(1, 2, 3));
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(write_file(folder / "notes.txt", "hello")); }),
                     "text that begins with \"hello\": no cloud"));
}

/// A bulging wall as 64 x 48 pixels see it, without every seventh pixel; each point is multiplied by `by`.
std::string wall_as_cloud(const Eigen::Vector3d& by, bool with_a_face) {
    std::string points;
    int count = 0;
    for (int v = 0; v < 48; ++v)
        for (int u = 0; u < 64; ++u) {
            const double z = 2 + 0.3 * std::sin(0.1 * u) + 0.01 * v;
            const Eigen::Vector3d point = by.cwiseProduct(Eigen::Vector3d((u - 31.5) / 50 * z, (v - 23.5) / 50 * z, z));
            if ((u + 3 * v) % 7 == 0)
                continue;
            points += fmt::format("{:.6f} {:.6f} {:.6f}\n", point.x(), point.y(), point.z());
            ++count;
        }
    return fmt::format("ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float "
                       "z\n{}end_header\n{}{}",
                       count, with_a_face ? "element face 1\nproperty list uchar int vertex_indices\n" : "", points,
                       with_a_face ? "3 0 1 2\n" : "");
}

TEST(captures, a_depth_image_written_as_a_cloud_has_its_camera_again) {
    const TemporaryFolder folder;
    const auto loaded = [&](const Eigen::Vector3d& by, bool with_a_face = false) {
        return open_capture(write_file(folder / "c.ply", wall_as_cloud(by, with_a_face))).load(0);
    };
    const Frame metres = loaded({1, 1, 1}), opengl = loaded({1, -1, -1}, true),
                millimetres = loaded({1000, 1000, 1000});
    for (const Frame* frame : {&metres, &opengl, &millimetres}) {
        EXPECT_TRUE(frame->cloud->pixels_of_one_image);
        EXPECT_NEAR(frame->camera.pinhole.fx, 50, 0.01);
        EXPECT_NEAR(frame->camera.pinhole.cy, 23.5, 0.01);
        EXPECT_EQ(frame->camera.pinhole.size, cv::Size(64, 48));
        EXPECT_TRUE(frame->cloud->points[100].isApprox(metres.cloud->points[100], 1e-6));
    }
    EXPECT_FALSE(warned(metres.warnings, "millimetres"));
    EXPECT_TRUE(warned(millimetres.warnings, "taken for millimetres"));
    const Frame kilometres = loaded({1e5, 1e5, 1e5}); // rays from points need no unit
    EXPECT_FALSE(kilometres.cloud->pixels_of_one_image);
    EXPECT_EQ(kilometres.camera.pinhole.fx, 0);
}

TEST(captures, an_organised_cloud_of_a_pinhole_camera_may_be_in_millimetres) {
    const TemporaryFolder folder;
    std::string text = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 8\nHEIGHT 6\n"
                       "VIEWPOINT 1000 0 0 1 0 0 0\nPOINTS 48\nDATA ascii\n";
    for (int i = 0; i < 48; ++i)
        text +=
            fmt::format("{} {} 2000\n", (i % 8 - 3.5) * 40, (i / 8 - 2.5) * 40); // NOLINT(bugprone-integer-division)
    const Frame frame = open_capture(write_file(folder / "c.pcd", text)).load(0);
    EXPECT_TRUE(warned(frame.warnings, "taken for millimetres"));
    EXPECT_EQ(frame.cloud->points[0].z(), 2);
    EXPECT_EQ(frame.world_from_camera->translation().x(), 1);
}

TEST(captures, frame_names_are_unique_and_fit_for_files) {
    const TemporaryFolder folder;
    const std::string cloud =
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    write_file(folder / "a.ply", cloud);
    write_file(folder / "a.PLY", cloud);
    const Capture capture = open_capture(folder.path());
    ASSERT_EQ(capture.entries.size(), 2);
    EXPECT_NE(capture.entries[0].name, capture.entries[1].name);
}

TEST(captures, a_pcd_viewpoint_is_the_pose_and_leaves_the_points_alone) {
    const TemporaryFolder folder;
    // w x y z = 0 1 0 0: a half turn about x; points stay in the camera's frame.
    const auto file = write_file(folder / "c.pcd",
                                 "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\n"
                                 "VIEWPOINT 1 2 3 0 1 0 0\nPOINTS 1\nDATA ascii\n0 0 2\n");
    const Frame frame = open_capture(file).load(0);
    EXPECT_EQ(frame.cloud->points[0], Eigen::Vector3d(0, 0, 2));
    EXPECT_TRUE((*frame.world_from_camera * frame.cloud->points[0]).isApprox(Eigen::Vector3d(1, 2, 1)));
}

TEST(captures, a_wrong_depth_scale_is_doubted_with_the_alternatives) {
    const TemporaryFolder folder;
    const cv::Mat1f far_wall(2.0 * wall() + 1.0);
    write_depth_png(folder / "d.png", far_wall, 5000); // TUM's unit, read as millimetres: 15 to 25 m
    const Frame frame = open_capture(folder / "d.png").load(0);
    EXPECT_TRUE(warned(doubts_in(frame.findings), "implausible"));
    EXPECT_TRUE(warned(doubts_in(frame.findings), "tum a median of"));
    CaptureOptions right;
    right.depth_scale = "tum";
    EXPECT_FALSE(warned(doubts_in(open_capture(folder / "d.png", right).load(0).findings), "implausible"));
}

TEST(captures, noise_in_place_of_surfaces_is_doubted) {
    const TemporaryFolder folder;
    cv::Mat1w noise(48, 64);
    cv::RNG random(7);
    for (auto& value : noise)
        value = static_cast<ushort>(random.uniform(500, 9000));
    cv::imwrite((folder / "d.png").string(), noise);
    EXPECT_TRUE(warned(doubts_in(open_capture(folder / "d.png").load(0).findings), "noise"));
}

TEST(captures, colour_of_another_size_is_left_out_and_depth_stays) {
    const TemporaryFolder folder;
    write_picture(folder / "color/1.png", picture({32, 24}));
    write_depth_png(folder / "depth/1.png", wall(), 1000);
    const Frame frame = open_capture(folder.path()).load(0);
    EXPECT_TRUE(frame.colour.empty());
    EXPECT_FALSE(frame.depth_m.empty());
    EXPECT_TRUE(warned(frame.warnings, "32x24"));
}

/// With no file to be opened until it goes.
class NoFiles {
  public:
    NoFiles() {
        ::getrlimit(RLIMIT_NOFILE, &before_);
        const rlimit none{0, before_.rlim_max};
        ::setrlimit(RLIMIT_NOFILE, &none);
    }
    ~NoFiles() { ::setrlimit(RLIMIT_NOFILE, &before_); }
    NoFiles(const NoFiles&) = delete;
    NoFiles& operator=(const NoFiles&) = delete;

  private:
    rlimit before_ = {};
};

TEST(captures, what_ails_the_machine_or_the_share_is_no_fault_of_a_frame) {
    const TemporaryFolder folder;
    const std::filesystem::path share = folder / "share";
    write_picture(share / "color/1.png", picture(wall().size()));
    write_depth_png(share / "depth/1.png", wall(), 1000);
    const Capture capture = open_capture(share);
#ifndef __SANITIZE_ADDRESS__ // to tell whether an object is one, the sanitizer of undefined behaviour opens a pipe
    {
        const NoFiles none;
        EXPECT_THROW((void)capture.load(0), Outage);
    }
#endif
    EXPECT_FALSE(capture.load(0).colour.empty());
    std::filesystem::rename(share, folder / "elsewhere");
    EXPECT_THROW((void)capture.load(0), Outage);
    std::filesystem::create_directories(share);
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(0); }), "no such file")) << "the share is there, the file is not";
}

TEST(captures, an_empty_folder_error_names_the_files_looked_for) {
    const TemporaryFolder folder;
    const std::string message = refusal([&] { (void)open_capture(folder.path()); });
    EXPECT_TRUE(says(message, "no frames found in " + folder.path().string()));
    EXPECT_TRUE(says(message, "depth.txt"));
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder / "nowhere"); }), "no such file"));
}

} // namespace
} // namespace scanshade
