// The damaged inputs of the shared data folder, where it is at hand: refused or warned about as its table says.
#include "io/cameras/camera_file.h"
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "io/images/image_file.h"
#include "tests/support/data.h"
#include "tests/support/files.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

enum class Reader { depth, colour, cloud, camera, capture };

/// One row of broken/README.md: the words that the refusal must hold, or those that some warning must (empty = none at
/// all).
struct Case {
    const char* path;
    Reader reader;
    bool refused;
    const char* words;
    bool doubtful = false; ///< computed, but not to be believed
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.path; }

const Case cases[] = {
    {"images/depth_truncated.png", Reader::depth, true, "ends early at byte 45935"},
    {"images/depth_zero_bytes.png", Reader::depth, true, "empty file"},
    {"images/depth_8bit.png", Reader::depth, true, "8-bit"},
    {"images/depth_jpeg_renamed.png", Reader::depth, true, "JPEG"},
    {"images/depth_crc_error.png", Reader::depth, true, "CRC"},
    {"images/depth_rgb16.png", Reader::depth, true, "3 channels"},
    {"images/depth_all_zero.png", Reader::capture, false, "no valid depth", true},
    {"images/depth_all_65535.png", Reader::capture, false, "no valid depth", true},
    {"images/depth_huge_header.png", Reader::depth, true, "60000x60000"},
    {"images/depth_no_iend.png", Reader::depth, true, "IEND"},
    {"images/depth_short.pgm", Reader::depth, true, "needs 614400 bytes of samples, found 199983"},
    {"images/depth_maxval_255.pgm", Reader::depth, true, "8-bit"},
    {"images/color_truncated.jpg", Reader::colour, true, "ends early"},
    {"seq_negative_intrinsics", Reader::capture, true, "fx is -585"},
    {"seq_short_intrinsics", Reader::capture, true, "camera-intrinsics.txt line 2"},
    {"seq_pose_3_rows", Reader::capture, false, "frame-000220.pose.txt: 3 rows"},
    {"seq_pose_not_rotation", Reader::capture, false, "frame-000220.pose.txt: the matrix is not rigid"},
    {"tum_unsorted", Reader::capture, false, "depth.txt: time stamps are out of order"},
    {"tum_duplicate_stamp", Reader::capture, false, "rgb.txt line 3: repeats the time stamp"},
    {"tum_zero_quaternion", Reader::capture, false, "groundtruth.txt line 3: the quaternion is zero"},
    {"tum_nonunit_quaternion", Reader::capture, false,
     "groundtruth.txt line 3: the quaternion has length 2; normalised"},
    {"tum_nan_pose", Reader::capture, false, "groundtruth.txt line 3: tx is \"nan\""},
    {"tum_empty_list", Reader::capture, false, "rgb.txt: no entries"},
    {"tum_header_without_hash", Reader::capture, false, "groundtruth.txt line 1"},
    {"tum_clock_offset", Reader::capture, true, "1000.000 s after"},
    {"empty_dir", Reader::capture, true, "no frames found in"},
    {"pcd/ok_reference_160x120.pcd", Reader::cloud, false, ""},
    {"pcd/ok_reference_160x120_compressed.pcd", Reader::cloud, false, ""},
    {"pcd/count_too_high.pcd", Reader::cloud, true, "says 5000 points, the file holds 200"},
    {"pcd/count_too_low.pcd", Reader::cloud, false, "100 lines are left over"},
    {"pcd/width_height_points_disagree.pcd", Reader::cloud, true,
     "WIDTH 640 x HEIGHT 480 is 307200, but POINTS says 200"},
    {"pcd/huge_counts.pcd", Reader::cloud, true, "4000000000"},
    {"pcd/ascii_garbage_line.pcd", Reader::cloud, true, "line 112"},
    {"pcd/ascii_short_line.pcd", Reader::cloud, true, "line 62: 2 values, expected 3"},
    {"pcd/no_data_line.pcd", Reader::cloud, true, "no DATA line"},
    {"pcd/missing_z.pcd", Reader::cloud, true, "no field z"},
    {"pcd/bad_size.pcd", Reader::cloud, true, "line 4: SIZE 3"},
    {"pcd/all_nan.pcd", Reader::cloud, false, "no valid points", true},
    {"pcd/inf_and_huge.pcd", Reader::cloud, false, "treated as invalid"},
    {"pcd/binary_truncated.pcd", Reader::cloud, true, "need 307200 bytes, found 153508"},
    {"pcd/compressed_truncated.pcd", Reader::cloud, true, "316800 bytes expected at byte 202, found 211132"},
    {"pcd/compressed_size_lies.pcd", Reader::cloud, true, "byte 198 is 4294967280"},
    {"pcd/compressed_bad_backref.pcd", Reader::cloud, true, "byte 202 is damaged"},
    {"pcd/viewpoint_zero_quaternion.pcd", Reader::cloud, false, "zero quaternion; taken as identity"},
    {"ply/ok_reference_500.ply", Reader::cloud, false, ""},
    {"ply/ok_big_endian.ply", Reader::cloud, false, ""},
    {"ply/header_no_end.ply", Reader::cloud, true, "end_header"},
    {"ply/count_too_high.ply", Reader::cloud, true, "says 100000 of element vertex, the file holds 500"},
    {"ply/count_negative.ply", Reader::cloud, true, "line 4"},
    {"ply/count_overflow.ply", Reader::cloud, true, "line 4"},
    {"ply/unknown_type.ply", Reader::cloud, true, "float128"},
    {"ply/unknown_format.ply", Reader::cloud, true, "binary_middle_endian"},
    {"ply/list_in_vertex.ply", Reader::cloud, false, ""},
    {"ply/list_length_lies.ply", Reader::cloud, true, "4294967295"},
    {"ply/face_index_out_of_range.ply", Reader::cloud, false, "face 2 names vertex 99999 of 500", true},
    {"ply/zero_vertices.ply", Reader::cloud, false, "no points", true},
    // The data's README says line 9, the second vertex; lines counted from 1, it is the tenth (the first stands in line
    // 9).
    {"ply/ascii_missing_column.ply", Reader::cloud, true, "line 10: 2 values, expected 3 (record 2"},
    {"las/truncated.las", Reader::cloud, true, "the header says 1065 points"},
    {"las/count_huge.las", Reader::cloud, true, "4000000000 points"},
    {"las/bad_signature.las", Reader::cloud, true, "LAZF"},
    {"las/scale_zero.las", Reader::cloud, true, "x scale factor"},
    {"las/scale_nan.las", Reader::cloud, true, "y scale factor"},
    {"las/offset_beyond_file.las", Reader::cloud, true, "points are said to begin at byte"},
    {"las/bbox_lies.las", Reader::cloud, false, "the header's box"}, // 1065 points
    {"las/real_bad_vlr_count.las", Reader::cloud, false, "variable length records", true},
    {"las/real_empty_geotiff_vlrs.las", Reader::cloud, false, ""},
    {"las/real_no_points.las", Reader::cloud, false, "no points", true},
    {"camera/ok_open3d.json", Reader::camera, false, ""},
    {"camera/row_major.json", Reader::camera, true, "row by row"},
    {"camera/negative_fx.json", Reader::camera, true, "fx is -525"},
    {"camera/zero_fy.json", Reader::camera, true, "fy is 0"},
    {"camera/nan_cx.json", Reader::camera, true, "\"intrinsic_matrix\" holds NaN"},
    {"camera/trailing_comma.json", Reader::camera, true, "line 3, column 16"},
    {"camera/missing_matrix.json", Reader::camera, true, "\"intrinsic_matrix\""},
    {"camera/matrix_8_numbers.json", Reader::camera, true, "\"intrinsic_matrix\" has 8 numbers, expected 9"},
};

/// All warnings and doubts of a capture and its frames, which must all load.
std::vector<std::string> warnings_of(const fs::path& path) {
    const Capture capture = open_capture(path);
    std::vector<std::string> warnings = capture.warnings;
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        const Frame frame = capture.load(i);
        warnings.insert(warnings.end(), frame.warnings.begin(), frame.warnings.end());
        std::ranges::copy(doubts_in(frame.findings), std::back_inserter(warnings));
    }
    return warnings;
}

std::vector<std::string> use(const fs::path& path, Reader reader) {
    std::vector<std::string> warnings;
    switch (reader) {
    case Reader::depth:
        (void)read_stored_depth(path);
        break;
    case Reader::colour:
        (void)read_colour(path);
        break;
    case Reader::cloud:
        (void)read_cloud(path, warnings);
        break;
    case Reader::camera:
        warnings = read_camera_file(path).warnings;
        break;
    case Reader::capture:
        warnings = warnings_of(path);
        break;
    }
    return warnings;
}

class BrokenData : public ::testing::TestWithParam<Case> {};

TEST_P(BrokenData, is_refused_or_warned_about_as_the_table_says) {
    const Case& c = GetParam();
    const fs::path path = data_folder() / "broken" / c.path;
    if (!fs::exists(path))
        GTEST_SKIP() << path << " is not at hand";
    std::vector<std::string> warnings;
    const std::string message = refusal([&] { warnings = use(path, c.reader); });
    if (c.refused) {
        EXPECT_TRUE(says(message, c.words));
        EXPECT_TRUE(says(message, path.filename().string()));
        return;
    }
    EXPECT_EQ(message, "");
    if (*c.words == '\0')
        EXPECT_TRUE(warnings.empty()) << joined(warnings);
    else
        EXPECT_TRUE(warned(warnings, c.words));
}

/// What a run on the input is typed as; cameras come with a truncated frame among sound ones.
std::string run_on(const fs::path& path, Reader reader) {
    if (reader == Reader::camera)
        return fmt::format("{} --camera {}", (data_folder() / "broken/seq_one_truncated").string(), path.string());
    const std::string name = path.filename().string();
    const bool tum = name.starts_with("tum_"), image = path.parent_path().filename() == "images";
    return path.string() + (tum ? " --camera 146.25,146.25,79.5,59.5" : image ? " --camera 585,585,320,240" : "");
}

TEST_P(BrokenData, the_program_ends_with_the_code_it_deserves) {
    const Case& c = GetParam();
    const fs::path path = data_folder() / "broken" / c.path;
    if (!fs::exists(path))
        GTEST_SKIP() << path << " is not at hand";
    if (!tests::program_is_built())
        GTEST_SKIP() << "the program is not built";
    const TemporaryFolder folder;
    const tests::Ran ran = tests::run_program(
        fmt::format("run {} -o {} --write ao --strict", run_on(path, c.reader), (folder / "out").string()));
    const int some_frames_are_bad = 2, nothing_could_be_done = 3;
    EXPECT_EQ(ran.exit_code, c.refused                                  ? nothing_could_be_done
                             : c.reader == Reader::camera || c.doubtful ? some_frames_are_bad
                                                                        : 0)
        << ran.err;
    if (c.refused) {
        EXPECT_TRUE(!fs::exists(folder / "out/ao") || fs::is_empty(folder / "out/ao")) << "a result of a refused input";
    }
}
INSTANTIATE_TEST_SUITE_P(readme, BrokenData, ::testing::ValuesIn(cases));

struct OneBadFrame {
    const char* path;
    const char* bad; ///< the frame's name
    const char* words;
};
std::ostream& operator<<(std::ostream& out, const OneBadFrame& c) { return out << c.path; }

class OneBadFrameOf : public ::testing::TestWithParam<OneBadFrame> {};

TEST_P(OneBadFrameOf, a_sequence_leaves_the_others_alone) {
    const auto& [name, bad, words] = GetParam();
    const fs::path path = data_folder() / "broken" / name;
    NEEDS(path);
    const Capture capture = open_capture(path);
    EXPECT_GE(capture.entries.size(), 3);
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        const std::string message = refusal([&] { EXPECT_FALSE(capture.load(i).depth_m.empty()); });
        if (capture.entries[i].name == bad)
            EXPECT_TRUE(says(message, words));
        else
            EXPECT_EQ(message, "");
    }
}
INSTANTIATE_TEST_SUITE_P(readme, OneBadFrameOf,
                         ::testing::Values(OneBadFrame{"seq_nan_pose", "frame-000220", "frame-000220.pose.txt line 2"},
                                           OneBadFrame{"seq_missing_depth", "frame-000220", "frame-000220.depth"},
                                           OneBadFrame{"seq_size_mismatch", "frame-000220",
                                                       "depth is 320x240, but its camera is for 640x480"},
                                           OneBadFrame{"seq_one_truncated", "frame-000220",
                                                       "frame-000220.depth.png: PNG ends early at byte 30000"},
                                           OneBadFrame{"seq_odd_names", "frame-000239", "frame-000239.depth"},
                                           OneBadFrame{"tum_missing_depth_file", "6.733333", "depth.txt line 3"},
                                           OneBadFrame{
                                               "tum_path_escape", "6.666667",
                                               "depth.txt line 2: \"../../outside.png\" leaves the capture's folder"}));

TEST(broken_data, unpaired_files_are_reported_and_foreign_ones_ignored) {
    const fs::path path = data_folder() / "broken/seq_odd_names";
    NEEDS(path);
    const Capture capture = open_capture(path);
    ASSERT_EQ(capture.entries.size(), 4); // 200, 220, the unpaired 239 and the misspelt 00239
    EXPECT_EQ(capture.entries[3].name, "frame-00239");
    EXPECT_TRUE(warned(capture.entries[3].warnings, "has no partner"));
}

TEST(broken_data, crlf_and_byte_order_marks_are_valid) {
    const fs::path path = data_folder() / "broken/tum_crlf_bom";
    NEEDS(path);
    const Capture capture = open_capture(path);
    ASSERT_EQ(capture.entries.size(), 4);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_TRUE(capture.load(i).world_from_camera);
        EXPECT_FALSE(capture.load(i).colour.empty());
    }
}

TEST(broken_data, no_frame_of_a_duplicate_stamp_is_used_twice) {
    const fs::path path = data_folder() / "broken/tum_duplicate_stamp";
    NEEDS(path);
    std::vector<fs::path> colours;
    for (const CaptureEntry& entry : open_capture(path).entries)
        if (!entry.colour.empty())
            colours.push_back(entry.colour);
    std::sort(colours.begin(), colours.end());
    EXPECT_EQ(std::adjacent_find(colours.begin(), colours.end()), colours.end());
    EXPECT_EQ(colours.size(), 3);
}

TEST(broken_data, a_camera_of_another_size_is_refused_naming_both) {
    const fs::path path = data_folder() / "broken";
    NEEDS(path);
    CaptureOptions options;
    options.camera = (path / "camera/wrong_size.json").string();
    const Capture capture = open_capture(path / "seq_nan_pose", options);
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(0); }), "depth is 640x480, but its camera is for 320x240"));
}

TEST(broken_data, controls_are_read_exactly) {
    const fs::path path = data_folder() / "broken";
    NEEDS(path);
    std::vector<std::string> warnings;
    const Cloud plain = read_cloud(path / "pcd/ok_reference_160x120.pcd", warnings);
    const Cloud packed = read_cloud(path / "pcd/ok_reference_160x120_compressed.pcd", warnings);
    EXPECT_EQ(plain.grid, cv::Size(160, 120));
    EXPECT_EQ(plain.colours, packed.colours);
    for (std::size_t i = 0; i < plain.points.size(); ++i)
        EXPECT_TRUE(plain.points[i] == packed.points[i] || (plain.points[i].hasNaN() && packed.points[i].hasNaN()));
    const Cloud little = read_cloud(path / "ply/ok_reference_500.ply", warnings),
                big = read_cloud(path / "ply/ok_big_endian.ply", warnings);
    EXPECT_EQ(little.points, big.points);
    EXPECT_EQ(little.colours, big.colours);
    EXPECT_EQ(read_camera_file(path / "camera/ok_open3d.json").camera.pinhole.cx, 319.5);
}

} // namespace
} // namespace scanshade
