// COLMAP's dense workspaces: made here in code, whole and damaged.
#include "io/captures/capture.h"
#include "io/images/format.h"
#include "tests/support/colmap_workspace.h"
#include "tests/support/files.h"

#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::colmap_map;
using tests::corner_depth;
using tests::file_bytes;
using tests::refusal;
using tests::says;
using tests::small_camera;
using tests::TemporaryFolder;
using tests::warned;
using tests::write_colmap;
using tests::write_file;

class Colmap : public testing::Test {
  protected:
    [[nodiscard]] Capture open(const CaptureOptions& options = {}) const {
        return open_capture(folder.path(), options);
    }
    void cut(const fs::path& file, std::size_t bytes) {
        write_file(folder / file, file_bytes(folder / file).substr(0, bytes));
    }
    /// In the recording's units.
    static double depth(const Capture& capture, const Frame& frame, int v, int u) {
        return capture.unit.told(static_cast<double>(frame.depth_m(v, u)));
    }
    TemporaryFolder folder;
};

TEST_F(Colmap, workspaces_are_read_whatever_their_lists_are_written_in) {
    for (const bool text : {false, true}) {
        write_colmap(folder.path(), {.unit = 0.3, .text = text, .image_scale = 2, .images_in = "left/"});
        const Capture capture = open();
        EXPECT_EQ(capture.kind, "COLMAP");
        ASSERT_EQ(capture.entries.size(), 3U);
        EXPECT_TRUE(capture.warnings.empty()) << tests::joined(capture.warnings);
        const Frame frame = capture.load(2);
        EXPECT_EQ(frame.name, "left_2.jpg");
        EXPECT_TRUE(frame.warnings.empty()) << tests::joined(frame.warnings);
        const Pinhole &found = frame.camera.pinhole, &truth = small_camera().pinhole;
        EXPECT_EQ(found.size, truth.size);
        EXPECT_NEAR(found.fx, truth.fx, 1e-9);
        EXPECT_NEAR(found.cx, truth.cx, 1e-9);
        EXPECT_NEAR(found.cy, truth.cy, 1e-9);
        EXPECT_NEAR(depth(capture, frame, 20, 30), 0.3 * static_cast<double>(corner_depth(0)(20, 30)), 1e-6);
        EXPECT_EQ(frame.depth_m(3, 3), 0);
        ASSERT_TRUE(frame.world_from_camera); // the file has camera_from_world
        EXPECT_NEAR(capture.unit.told(frame.world_from_camera->translation().x()), -0.3 * 0.02, 1e-9);
        EXPECT_EQ(frame.colour.size(), truth.size);
        EXPECT_EQ(frame.registration, Registration::yes);
        fs::remove_all(folder / "sparse");
    }
}

TEST_F(Colmap, depth_is_measured_by_the_scene_so_the_unit_cancels) {
    std::vector<Frame> frames;
    for (const double unit : {1.0, 0.01, 100.0}) {
        write_colmap(folder.path(), {.unit = unit});
        const Capture capture = open();
        EXPECT_TRUE(capture.unit.arbitrary());
        EXPECT_TRUE(capture.depth.arbitrary);
        EXPECT_EQ(capture.median_depth, usual_median_depth);
        frames.push_back(capture.load(1));
        EXPECT_TRUE(doubts_in(frames.back().findings).empty()) << tests::joined(doubts_in(frames.back().findings));
        EXPECT_LT(cv::norm(frames.back().depth_m, frames.front().depth_m, cv::NORM_INF), 1e-5);
        EXPECT_NEAR(frames.back().world_from_camera->translation().x(),
                    frames.front().world_from_camera->translation().x(), 1e-7);
    }
    std::vector<float> known;
    for (const float z : frames.front().depth_m)
        if (z > 0)
            known.push_back(z);
    std::ranges::sort(known);
    EXPECT_NEAR(known[known.size() / 2], usual_median_depth, 0.01);
}

TEST_F(Colmap, a_given_unit_makes_metres_of_depths_and_poses) {
    write_colmap(folder.path(), {.unit = 4});
    const Capture capture = open({"", "4"});
    EXPECT_FALSE(capture.unit.arbitrary());
    const Frame frame = capture.load(2);
    EXPECT_NEAR(frame.depth_m(20, 30), corner_depth(0)(20, 30), 1e-6F);
    EXPECT_NEAR(frame.world_from_camera->translation().x(), -0.02, 1e-12);
    const Capture metres = open({"", "m"});
    EXPECT_NEAR(metres.load(2).world_from_camera->translation().x(), -0.08, 1e-12);
    require_metres(capture, "this");
    EXPECT_TRUE(says(refusal([&] { require_metres(open(), "refine"); }), "refine needs lengths in metres"));
}

TEST_F(Colmap, geometric_depth_wins_and_missing_depth_is_counted) {
    write_colmap(folder.path());
    write_file(folder / "stereo/depth_maps/0.jpg.photometric.bin", colmap_map(cv::Mat1f(48, 64, 9.0F)));
    fs::rename(folder / "stereo/depth_maps/1.jpg.geometric.bin", folder / "stereo/depth_maps/1.jpg.photometric.bin");
    fs::remove(folder / "stereo/depth_maps/2.jpg.geometric.bin");
    write_file(folder / "stereo/depth_maps/other.png.geometric.bin", colmap_map(corner_depth(0)));
    const Capture capture = open();
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_TRUE(capture.entries[0].depth.string().ends_with("0.jpg.geometric.bin"));
    EXPECT_TRUE(capture.entries[1].depth.string().ends_with("1.jpg.photometric.bin"));
    EXPECT_TRUE(warned(capture.warnings, "1 image left out, without a depth map"));
    EXPECT_TRUE(warned(capture.warnings, "1 depth map geometric, 1 without one photometric"));
    EXPECT_TRUE(warned(capture.warnings, "such as other.png; not used"));
}

TEST_F(Colmap, binary_lists_win_over_text) {
    write_colmap(folder.path(), {.text = true});
    write_file(folder / "sparse/cameras.txt", "7 PINHOLE 64 48 1 1 1 1\n");
    write_colmap(folder.path());
    EXPECT_NEAR(open().load(0).camera.pinhole.fx, small_camera().pinhole.fx, 1e-9);
}

TEST_F(Colmap, cameras_may_differ_in_size_and_one_bad_camera_spoils_its_frames_only) {
    write_colmap(folder.path(), {.text = true});
    write_file(folder / "sparse/cameras.txt",
               "7 PINHOLE 64 48 50 50 32 24\n8 SIMPLE_PINHOLE 32 48 50 16 24\n9 FOV 64 48 "
               "50 50 32 24 1\n");
    write_file(folder / "sparse/images.txt",
               "1 1 0 0 0 0 0 0 7 0.jpg\n\n2 1 0 0 0 0 0 0 8 1.jpg\n\n3 1 0 0 0 0 0 0 9 2.jpg\n\n");
    write_file(folder / "stereo/depth_maps/1.jpg.geometric.bin",
               colmap_map(corner_depth(0)(cv::Rect(0, 0, 32, 48)).clone()));
    const Capture capture = open();
    ASSERT_EQ(capture.entries.size(), 3U);
    EXPECT_EQ(capture.load(0).camera.pinhole.size, cv::Size(64, 48));
    EXPECT_EQ(capture.load(1).camera.pinhole.size, cv::Size(32, 48));
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(2); }), "cameras.txt line 3: the camera model \"FOV\""));
    EXPECT_TRUE(warned(capture.warnings, "depth maps of several sizes"));
}

TEST_F(Colmap, without_poses_frames_have_the_only_camera) {
    write_colmap(folder.path());
    fs::remove(folder / "sparse/images.bin");
    const Capture capture = open();
    ASSERT_EQ(capture.entries.size(), 3U);
    EXPECT_TRUE(warned(capture.warnings, "neither images.bin nor images.txt; no poses"));
    const Frame frame = capture.load(1);
    EXPECT_FALSE(frame.world_from_camera);
    EXPECT_FALSE(frame.colour.empty());
    EXPECT_NEAR(frame.camera.pinhole.fx, small_camera().pinhole.fx, 1e-9);
}

TEST_F(Colmap, names_lead_nowhere_outside) {
    write_colmap(folder / "dense", {.text = true});
    write_file(folder / "secret.jpg.geometric.bin", colmap_map(corner_depth(0)));
    write_file(folder / "dense/sparse/images.txt",
               "1 1 0 0 0 0 0 0 7 ../../../secret.jpg\n\n2 1 0 0 0 0 0 0 7 .\\0.jpg\n\n3 1 0 0 0 0 0 0 7 /0.jpg\n\n");
    const Capture capture = open_capture(folder / "dense");
    ASSERT_EQ(capture.entries.size(), 3U);
    int refused = 0;
    for (std::size_t i = 0; i < 3; ++i)
        if (const std::string why = refusal([&] { (void)capture.load(i); }); !why.empty()) {
            EXPECT_TRUE(says(why, "leaves the capture's folder"));
            ++refused;
        }
    EXPECT_EQ(refused, 2);
}

TEST_F(Colmap, damaged_lists_keep_what_was_whole) {
    write_colmap(folder.path());
    cut("sparse/images.bin", 8 + 102 + 30); // within the second image
    const Capture capture = open();
    EXPECT_TRUE(warned(capture.warnings, "images.bin: ends early at offset 110; the 1 image before are used"));
    EXPECT_EQ(capture.entries.size(), 1U);

    std::string bytes = file_bytes(folder / "sparse/images.bin");
    const std::uint64_t many = std::uint64_t(1) << 62;
    std::memcpy(bytes.data() + 8 + 64 + 6, &many, 8); // points of the first
    write_file(folder / "sparse/images.bin", bytes);
    EXPECT_TRUE(warned(open().warnings, "points end early at offset 86"));
    std::memcpy(bytes.data(), &many, 8);
    write_file(folder / "sparse/images.bin", bytes);
    EXPECT_TRUE(says(refusal([&] { (void)open(); }), "images.bin: 4611686018427387904 images at offset 0"));

    write_colmap(folder.path());
    cut("sparse/cameras.bin", 30);
    EXPECT_TRUE(warned(open().warnings, "cameras.bin: ends early at offset 8, after 0 cameras"));
    write_colmap(folder.path());
    bytes = file_bytes(folder / "sparse/cameras.bin");
    bytes[12] = 99;
    write_file(folder / "sparse/cameras.bin", bytes);
    EXPECT_TRUE(warned(open().warnings, "an unknown camera model 99 at offset 12"));
    bytes[12] = 1, bytes[8] = 6; // another id
    write_file(folder / "sparse/cameras.bin", bytes);
    EXPECT_TRUE(says(refusal([&] { (void)open().load(0); }), "camera 7 of \"0.jpg\" is not among the cameras"));
}

TEST_F(Colmap, damaged_lines_and_poses_are_named) {
    write_colmap(folder.path(), {.text = true});
    write_file(folder / "sparse/images.txt",
               "1 0 0 0 0 0 0 0 7 0.jpg\n\n2 1 0 0 0 0 nan 0 7 1.jpg\n\n3 1 0 0 7 2.jpg\n\n");
    const Capture capture = open();
    EXPECT_EQ(capture.entries.size(), 2U);
    EXPECT_TRUE(warned(capture.warnings, "images.txt line 5: expected ID QW QX QY QZ TX TY TZ CAMERA NAME"));
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_FALSE(capture.load(i).world_from_camera);
        EXPECT_TRUE(warned(capture.load(i).warnings, fmt::format("images.txt line {}: no unit quaternion", 2 * i + 1)));
    }
}

TEST_F(Colmap, damaged_depth_maps_are_refused_by_name_and_place) {
    write_colmap(folder.path());
    const fs::path file = "stereo/depth_maps/1.jpg.geometric.bin";
    const auto why = [&](const std::string& bytes) {
        write_file(folder / file, bytes);
        const Capture capture = open();
        EXPECT_TRUE(refusal([&] { (void)capture.load(0); }).empty());
        return refusal([&] { (void)capture.load(1); });
    };
    const std::string whole = file_bytes(folder / file);
    EXPECT_TRUE(says(why(whole.substr(0, 999)),
                     "1.jpg.geometric.bin: 64x48 floats are 12288 bytes from offset 8 on, found 991"));
    EXPECT_TRUE(says(why(whole + "x"), "found 12289"));
    EXPECT_TRUE(says(why("64&48&3&" + std::string(3 * 12288, '\0')), "3 channels"));
    EXPECT_TRUE(says(why("99999&99999&1&"), "more than 2^28 pixels"));
    EXPECT_TRUE(says(why("0&48&1&"), "0x48"));
    EXPECT_TRUE(says(why("64&48&"), "16-bit or float depth expected"));
    EXPECT_TRUE(says(why(""), "empty file"));
}

TEST_F(Colmap, a_workspace_without_depth_maps_says_what_makes_them) {
    write_colmap(folder.path());
    fs::remove_all(folder / "stereo/depth_maps");
    fs::create_directories(folder / "stereo/depth_maps");
    EXPECT_TRUE(says(refusal([&] { (void)open(); }), "patch_match_stereo"));
}

TEST_F(Colmap, a_single_depth_map_has_no_unit_either) {
    const fs::path file = write_file(folder / "a.geometric.bin", colmap_map(cv::Mat1f(cv::Mat(corner_depth(0) * 50))));
    const Capture capture = open_capture(file, {"50,50,31.5,23.5", ""});
    EXPECT_EQ(capture.kind, "depth image");
    EXPECT_TRUE(capture.unit.arbitrary());
    EXPECT_NEAR(depth(capture, capture.load(0), 20, 30), 50 * static_cast<double>(corner_depth(0)(20, 30)), 1e-4);
    const Capture metric = open_capture(file, {"50,50,31.5,23.5", "50"});
    EXPECT_NEAR(metric.load(0).depth_m(20, 30), corner_depth(0)(20, 30), 1e-6F);
    EXPECT_EQ(open_capture(folder.path()).kind, "depth images");
}

TEST_F(Colmap, clouds_named_bin_stay_clouds) {
    write_file(folder / "1.bin", std::string(160, '\1'));
    EXPECT_EQ(open_capture(folder.path()).kind, "clouds");
    EXPECT_FALSE(has_depth_extension("1.bin"));
    EXPECT_TRUE(has_depth_extension("image.jpg.geometric.bin"));
}

} // namespace
} // namespace scanshade
