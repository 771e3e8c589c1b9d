// Damaged and odd inputs: those made here, and, where they are at hand, those of the shared data folder and its good
// captures. A refusal must name the file and the place; usable parts must be used, with a warning.
#include "io/cameras/camera_file.h"
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "io/images/image_file.h"
#include "tests/support/files.h"
#include "tests/support/png.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::joined;
using tests::png;
using tests::refusal;
using tests::says;
using tests::TemporaryFolder;
using tests::warned;
using tests::write_file;

/// OpenCV writes EXR only where this is set when it first looks.
[[maybe_unused]] const bool exr_allowed = ::setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1) == 0;

// --- images made here ---

class BrokenImages : public ::testing::Test {
  protected:
    std::string depth_refusal(const std::string& bytes, const std::string& name = "d.png") {
        const fs::path file = write_file(folder_ / name, bytes);
        std::string message = refusal([&] { (void)read_stored_depth(file); });
        EXPECT_TRUE(message.empty() || says(message, file.string()));
        return message;
    }
    const TemporaryFolder folder_;
};

TEST_F(BrokenImages, a_sound_png_is_read) { EXPECT_EQ(depth_refusal(png(8, 4, 16, 0, 4)), ""); }

TEST_F(BrokenImages, a_png_cut_anywhere_is_refused) {
    const std::string whole = png(8, 4, 16, 0, 4);
    for (std::size_t length = 0; length < whole.size(); ++length)
        EXPECT_NE(depth_refusal(whole.substr(0, length)), "") << length;
    EXPECT_TRUE(says(depth_refusal(""), "empty file"));
    EXPECT_TRUE(says(depth_refusal(whole.substr(0, whole.size() - 12)), "IEND"));
}

TEST_F(BrokenImages, a_png_with_any_byte_changed_is_refused) {
    const std::string whole = png(8, 4, 16, 0, 4);
    for (std::size_t at = 0; at < whole.size(); ++at) {
        std::string changed = whole;
        changed[at] = static_cast<char>(changed[at] ^ 0x10);
        EXPECT_NE(depth_refusal(changed), "") << at;
    }
}

TEST_F(BrokenImages, sound_chunks_with_too_few_rows_are_refused) {
    // libpng alone would hand out an image whose lower half reads as holes.
    EXPECT_NE(depth_refusal(png(8, 4, 16, 0, 2)), "");
}

TEST_F(BrokenImages, what_cannot_be_depth_is_refused_by_its_header) {
    EXPECT_TRUE(says(depth_refusal(png(8, 4, 8, 0, 4)), "found 8-bit PNG"));
    EXPECT_TRUE(says(depth_refusal(png(8, 4, 16, 2, 4)), "3 channels"));
    EXPECT_TRUE(says(depth_refusal(png(60000, 60000, 16, 0, 4)), "60000x60000"));
    EXPECT_TRUE(says(depth_refusal(png(0xffffffff, 0xffffffff, 16, 0, 4)), "2^28"));
    EXPECT_TRUE(says(depth_refusal(png(0, 4, 16, 0, 4)), "0x4"));
    EXPECT_TRUE(says(depth_refusal("GIF89a..........."), "neither PNG"));
    std::vector<uchar> jpeg;
    cv::imencode(".jpg", cv::Mat1b(16, 16, uchar(9)), jpeg);
    EXPECT_TRUE(says(depth_refusal({jpeg.begin(), jpeg.end()}), "JPEG"));
}

TEST_F(BrokenImages, pgm_and_pfm_sizes_must_fit_the_bytes) {
    const auto refused = [&](const std::string& header, std::size_t bytes) {
        return depth_refusal(header + std::string(bytes, 'x'), "d.pgm");
    };
    EXPECT_EQ(refused("P5 4 2 65535\n", 16), "");
    EXPECT_TRUE(says(refused("P5 4 2 65535\n", 15), "needs 16 bytes of samples, found 15"));
    EXPECT_TRUE(says(refused("P5 4 2 65535\n", 17), "found 17"));
    EXPECT_TRUE(says(refused("P5 4 2 255\n", 16), "8-bit"));
    EXPECT_TRUE(says(refused("P5 4 2 70000\n", 16), "maxval 70000"));
    EXPECT_TRUE(says(refused("P5 4 -2 65535\n", 16), "height"));
    EXPECT_TRUE(says(refused("P5 99999999 99999999 65535\n", 16), "2^28"));
    EXPECT_TRUE(says(refused("P5 4294967297 1 65535\n", 16), "width"));
    EXPECT_TRUE(says(refused("P5 4", 0), "height"));
    EXPECT_TRUE(says(refused("P2 1 1 65535\n", 5), "P5"));
    EXPECT_TRUE(says(refused("P6 1 1 65535\n", 6), "3 channels"));
    EXPECT_EQ(refused("Pf\n2 1\n-1\n", 8), "");
    EXPECT_TRUE(says(refused("Pf\n2 1\n0\n", 8), "scale"));
    EXPECT_TRUE(says(refused("PF\n2 1\n-1\n", 24), "3 channels"));
    EXPECT_TRUE(says(refused("Pf\n2 1\n-1\n", 7), "found 7"));
}

TEST_F(BrokenImages, tiff_and_exr_cut_anywhere_are_refused_or_lose_nothing) {
    const cv::Mat1f image(24, 16, 2.5F);
    for (const char* kind : {".tiff", ".exr"}) {
        std::vector<uchar> encoded;
        ASSERT_TRUE(cv::imencode(kind, image, encoded));
        const std::string whole(encoded.begin(), encoded.end());
        EXPECT_EQ(depth_refusal(whole), "");
        for (std::size_t length = 0; length < whole.size(); length += 7) { // TIFF ends in tags that no pixel needs
            if (depth_refusal(whole.substr(0, length)).empty()) {
                EXPECT_EQ(cv::norm(read_stored_depth(folder_ / "d.png"), image, cv::NORM_INF), 0) << kind << length;
            }
        }
    }
}

TEST_F(BrokenImages, changed_bytes_never_crash_a_reader) {
    // What is read may be wrong (TIFF and EXR have no checksums); it must be refused or be an image of sane size.
    cv::RNG random(3);
    for (const char* kind : {".tiff", ".exr", ".png", ".jpg", ".pgm"}) {
        const cv::Mat image = std::string(kind) == ".jpg" ? cv::Mat(cv::Mat1b(24, 16, uchar(8)))
                              : kind[1] == 'p'            ? cv::Mat(cv::Mat1w(24, 16, ushort(8)))
                                                          : cv::Mat(cv::Mat1f(24, 16, 2.5F));
        std::vector<uchar> encoded;
        ASSERT_TRUE(cv::imencode(kind, image, encoded));
        for (int i = 0; i < 300; ++i) {
            std::string changed(encoded.begin(), encoded.end());
            for (int k = 0; k < 3; ++k)
                changed[static_cast<std::size_t>(random.uniform(0, static_cast<int>(changed.size())))] =
                    static_cast<char>(random.next());
            const fs::path file = write_file(folder_ / "any", changed);
            (void)refusal([&] { (void)read_stored_depth(file); });
            (void)refusal([&] { (void)read_colour(file); });
        }
    }
}

TEST_F(BrokenImages, a_cut_jpeg_costs_the_colour_and_not_the_frame) {
    std::vector<uchar> jpeg;
    cv::Mat3b noise(48, 64);
    cv::randu(noise, 0, 255);
    cv::imencode(".jpg", noise, jpeg);
    write_file(folder_ / "color/1.jpg", {jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(jpeg.size() / 2)});
    write_depth_png(folder_ / "depth/1.png", cv::Mat1f(48, 64, 2.0F), 1000);
    EXPECT_TRUE(says(refusal([&] { (void)read_colour(folder_ / "color/1.jpg"); }), "ends early"));
    const Frame frame = open_capture(folder_.path()).load(0);
    EXPECT_TRUE(frame.colour.empty());
    EXPECT_EQ(frame.depth_m(0, 0), 2);
    EXPECT_TRUE(warned(frame.warnings, "1.jpg"));
}

// --- clouds made here ---

class BrokenClouds : public ::testing::Test {
  protected:
    std::string cloud_refusal(const std::string& bytes) {
        const fs::path file = write_file(folder_ / "c", bytes);
        warnings_.clear();
        std::string message = refusal([&] { (void)read_cloud(file, warnings_); });
        EXPECT_TRUE(message.empty() || says(message, file.string()));
        return message;
    }
    const TemporaryFolder folder_;
    std::vector<std::string> warnings_;
};

std::string pcd(const std::string& data, const std::string& body, const std::string& points = "2") {
    return "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " + points + "\nHEIGHT 1\nPOINTS " +
           points + "\nDATA " + data + "\n" + body;
}

TEST_F(BrokenClouds, pcd_headers_are_checked_line_by_line) {
    const std::string good = pcd("ascii", "1 2 3\n4 5 6\n");
    EXPECT_EQ(cloud_refusal(good), "");
    const auto with = [&](const std::string& from, const std::string& to) {
        std::string changed = good;
        return cloud_refusal(changed.replace(changed.find(from), from.size(), to));
    };
    EXPECT_TRUE(says(with("SIZE 4 4 4", "SIZE 4 3 4"), "line 3: SIZE 3"));
    EXPECT_TRUE(says(with("SIZE 4 4 4", "SIZE 4 4"), "line 3: SIZE has 2 values, expected 3"));
    EXPECT_TRUE(says(with("TYPE F F F", "TYPE F X F"), "line 4"));
    EXPECT_TRUE(says(with("COUNT 1 1 1", "COUNT 1 0 1"), "line 5: COUNT 0"));
    EXPECT_TRUE(says(with("COUNT 1 1 1", "COUNT 1 99999999999 1"), "line 5"));
    EXPECT_TRUE(says(with("WIDTH 2", "WIDTH 3"), "WIDTH 3 x HEIGHT 1 is 3, but POINTS says 2"));
    EXPECT_TRUE(says(with("WIDTH 2", "WIDTH -2"), "line 6"));
    EXPECT_TRUE(says(with("WIDTH 2", "WIDTH 18446744073709551616"), "line 6"));
    EXPECT_TRUE(says(with("FIELDS x y z", "FIELDS x y q"), "no field z"));
    EXPECT_TRUE(says(with("DATA ascii\n", ""), "no DATA line"));
    EXPECT_TRUE(says(with("DATA ascii", "DATA base64"), "line 9: DATA \"base64\""));
    EXPECT_TRUE(says(with("HEIGHT 1", "POINTS 2"), "second time"));
    EXPECT_TRUE(says(cloud_refusal("hello"), "begins with \"hell\": neither PLY, LAZ, LAS"));
    EXPECT_TRUE(says(cloud_refusal(""), "empty file"));
}

TEST_F(BrokenClouds, pcd_bodies_must_hold_what_the_header_says) {
    EXPECT_TRUE(says(cloud_refusal(pcd("ascii", "1 2 3\n")), "says 2 points, the file holds 1"));
    EXPECT_TRUE(says(cloud_refusal(pcd("ascii", "1 2\n3 4 5 6\n")), "line 10: 2 values, expected 3"));
    EXPECT_TRUE(says(cloud_refusal(pcd("ascii", "1 2 3\n1 2 3x\n")), "line 11: \"3x\""));
    EXPECT_TRUE(says(cloud_refusal(pcd("binary", std::string(23, 'x'))), "need 24 bytes, found 23"));
    EXPECT_TRUE(says(cloud_refusal(pcd("binary", "", "2000000000")), "found 0"));
    const auto sizes = [](std::uint32_t packed, std::uint32_t unpacked) {
        std::string bytes(8, '\0');
        std::memcpy(bytes.data(), &packed, 4);
        std::memcpy(bytes.data() + 4, &unpacked, 4);
        return bytes;
    };
    EXPECT_TRUE(says(cloud_refusal(pcd("binary_compressed", "1234")), "before the two sizes"));
    EXPECT_TRUE(says(cloud_refusal(pcd("binary_compressed", sizes(4, 4294967280U) + "1234")), "4294967280"));
    EXPECT_TRUE(says(cloud_refusal(pcd("binary_compressed", sizes(100, 24) + "1234")), "100 bytes expected"));
    EXPECT_TRUE(says(cloud_refusal(pcd("binary_compressed", sizes(3, 24) + "\xe0\xff\xff")), "LZF"));
    EXPECT_TRUE(says(cloud_refusal(pcd("binary_compressed", sizes(3, 12 * 300000000U) + "\xe0\xff\xff", "300000000")),
                     "cannot unpack"));
}

TEST_F(BrokenClouds, odd_viewpoints_are_taken_as_identity) {
    for (const char* viewpoint : {"0 0 0 0 0 0 0", "nan 0 0 1 0 0 0", "1 2 3"}) {
        EXPECT_EQ(cloud_refusal(fmt::format("VERSION 0.7\nVIEWPOINT {}\n", viewpoint) +
                                pcd("ascii", "1 2 3\n4 5 6\n").substr(12)),
                  "");
        EXPECT_TRUE(warned(warnings_, "line 2: VIEWPOINT")) << viewpoint;
    }
}

std::string ply(const std::string& format, const std::string& header, const std::string& body) {
    return "ply\nformat " + format + " 1.0\n" + header + "end_header\n" + body;
}

const std::string vertices = "element vertex 2\nproperty float x\nproperty float y\nproperty float z\n";

TEST_F(BrokenClouds, ply_headers_are_checked_line_by_line) {
    const auto refused = [&](const std::string& header) {
        return cloud_refusal(ply("ascii", header, "1 2 3\n4 5 6\n"));
    };
    EXPECT_EQ(refused(vertices), "");
    EXPECT_TRUE(says(refused("element vertex -2\n"), "line 3"));
    EXPECT_TRUE(says(refused("element vertex 18446744073709551615\n"), "line 3"));
    EXPECT_TRUE(says(refused("element vertex 2\nproperty float128 x\n"), "line 4: property type \"float128\""));
    EXPECT_TRUE(says(refused("element vertex 2\nproperty float x\nproperty float y\n"), "no property z"));
    EXPECT_TRUE(says(refused("property float x\n"), "before the first element"));
    EXPECT_TRUE(says(refused("element vertex 2\nproperty list float int x\n"), "line 4"));
    EXPECT_TRUE(says(refused("element face 0\n"), "no element vertex"));
    EXPECT_TRUE(says(refused(vertices + vertices), "second element vertex"));
    EXPECT_TRUE(says(refused(vertices + "nonsense\n"), "line 7: \"nonsense\""));
    EXPECT_TRUE(says(refused("element nothing 4000000\n" + vertices), "no properties"));
    EXPECT_TRUE(says(cloud_refusal("ply\nformat binary_middle_endian 1.0\n"), "binary_middle_endian"));
    EXPECT_TRUE(says(cloud_refusal("ply\nformat ascii 1.0\n" + vertices), "no end_header"));
    EXPECT_TRUE(says(cloud_refusal("ply\n" + vertices + "end_header\n"), "no format"));
}

TEST_F(BrokenClouds, ply_bodies_must_hold_what_the_header_says) {
    const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
    EXPECT_TRUE(says(cloud_refusal(ply("ascii", vertices, "1 2 3\n")), "says 2 of element vertex, the file holds 1"));
    EXPECT_TRUE(says(cloud_refusal(ply("ascii", vertices, "1 2 3\n4 5\n")), "line 9: 2 values, expected 3"));
    EXPECT_TRUE(says(cloud_refusal(ply("binary_little_endian", vertices, std::string(20, 'x'))), "holds 1"));
    EXPECT_TRUE(says(cloud_refusal(ply("ascii", vertices + faces, "1 2 3\n4 5 6\n4 0 1 0\n")), "line 12"));
    EXPECT_TRUE(says(cloud_refusal(ply("ascii", vertices + faces, "1 2 3\n4 5 6\n-1\n")), "line 12"));
    EXPECT_TRUE(says(cloud_refusal(ply("binary_little_endian", vertices + faces, std::string(24, '\0') + "\xff")),
                     "claims 255 values"));
    EXPECT_EQ(cloud_refusal(ply("ascii", vertices + faces, "1 2 3\n4 5 6\n3 0 1 2\n")), "");
    EXPECT_TRUE(warned(warnings_, "face 1 names vertex 2 of 2"));
    EXPECT_EQ(
        cloud_refusal(ply("ascii", "element vertex 0\nproperty float x\nproperty float y\nproperty float z\n", "")),
        "");
    EXPECT_TRUE(warned(warnings_, "no points"));
}

TEST_F(BrokenClouds, changed_bytes_never_crash_a_reader) {
    cv::RNG random(5);
    const std::string body(240, '\x3f');
    std::string twenty = vertices;
    twenty.replace(twenty.find(" 2"), 2, " 20");
    const std::string faces = "element face 2\nproperty list uchar int vertex_indices\n";
    std::string lines;
    for (int i = 0; i < 20; ++i)
        lines += "1.5 2 3\n";
    const std::string packed = std::string("\x78\0\0\0\xf0\0\0\0", 8) + std::string(120, '\x07');
    for (const std::string& whole :
         {pcd("ascii", lines, "20"), pcd("binary", body, "20"), pcd("binary_compressed", packed, "20"),
          ply("ascii", twenty + faces, lines + "3 0 1 2\n3 1 2 3\n"),
          ply("binary_big_endian", twenty + faces, body + std::string("\1\0\0\0\0\0", 6)),
          ply("binary_little_endian", twenty + "property list uchar uchar tags\n", body + body)}) {
        for (int i = 0; i < 400; ++i) {
            std::string changed =
                whole.substr(0, static_cast<std::size_t>(random.uniform(static_cast<int>(whole.size() / 2),
                                                                        static_cast<int>(whole.size()) + 1)));
            for (int k = 0; k < 2; ++k)
                changed[static_cast<std::size_t>(random.uniform(0, static_cast<int>(changed.size())))] =
                    static_cast<char>(random.next());
            const fs::path file = write_file(folder_ / "any", changed);
            (void)refusal([&] {
                std::vector<std::string> warnings;
                const Cloud cloud = read_cloud(file, warnings);
                const std::vector<float> values(cloud.points.size(), 0.5F);
                write_cloud(folder_ / "out", cloud, {{"ambient_occlusion", values}});
                (void)read_cloud(folder_ / "out", warnings);
            });
        }
    }
}

// --- the shared data ---

/// The folder with recorded and damaged data; the tests that need it are skipped where it is not.
fs::path data_folder() {
    const char* named = std::getenv("SCANSHADE_DATA");
    return named ? fs::path(named) : fs::path(SCANSHADE_SOURCE) / "../shared/data";
}

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
    {"pcd/count_too_low.pcd", Reader::cloud, false, "100 lines are left over", true},
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
    {"las/bbox_lies.las", Reader::cloud, false, "the header's box", true}, // 1065 points
    {"las/real_bad_vlr_count.las", Reader::cloud, false, "variable length records", true},
    {"las/real_empty_geotiff_vlrs.las", Reader::cloud, false, "", true},
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
        warnings.insert(warnings.end(), frame.doubts.begin(), frame.doubts.end());
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
    const tests::Ran ran =
        tests::run_program(fmt::format("run {} -o {} --write ao", run_on(path, c.reader), (folder / "out").string()));
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

#define NEEDS(path)                                                                                                    \
    if (!fs::exists(path))                                                                                             \
    GTEST_SKIP() << (path) << " is not at hand"

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

// --- the good captures, by the facts of the data's README ---

struct Good {
    const char* path;
    const char* kind;
    std::size_t frames;
    double fx; ///< 0 = the capture has no camera
    double least_holes, most_holes, nearest_m,
        farthest_m; ///< over all frames, a little wider than the README's roundings
    bool poses;
    Registration registration;
};
std::ostream& operator<<(std::ostream& out, const Good& c) { return out << c.path; }

class GoodCapture : public ::testing::TestWithParam<Good> {};

TEST_P(GoodCapture, holds_what_its_readme_says) {
    const Good& good = GetParam();
    const fs::path path = data_folder() / good.path;
    NEEDS(path);
    const Capture capture = open_capture(path);
    EXPECT_EQ(capture.kind, good.kind);
    ASSERT_EQ(capture.entries.size(), good.frames);
    EXPECT_EQ(capture.registration, good.registration);
    EXPECT_EQ(capture.camera ? capture.camera->pinhole.fx : 0, good.fx);
    for (std::size_t i = 0; i < good.frames; ++i) {
        const Frame frame = capture.load(i);
        EXPECT_EQ(frame.depth_m.size(), cv::Size(640, 480));
        EXPECT_EQ(frame.colour.size(), cv::Size(640, 480));
        EXPECT_EQ(frame.world_from_camera.has_value(), good.poses);
        EXPECT_TRUE(frame.warnings.empty()) << joined(frame.warnings);
        EXPECT_TRUE(frame.doubts.empty()) << joined(frame.doubts);
        const double holes = 1 - cv::countNonZero(frame.depth_m) / (640.0 * 480.0);
        double nearest = 0, farthest = 0;
        cv::minMaxLoc(frame.depth_m, &nearest, &farthest, nullptr, nullptr, frame.depth_m > 0);
        EXPECT_GE(holes, good.least_holes) << frame.name;
        EXPECT_LE(holes, good.most_holes) << frame.name;
        EXPECT_GE(nearest, good.nearest_m) << frame.name;
        EXPECT_LE(farthest, good.farthest_m) << frame.name;
    }
}
INSTANTIATE_TEST_SUITE_P(readme, GoodCapture,
                         ::testing::Values(Good{"rgbd_7scenes", "7-Scenes / BundleFusion", 40, 585, 0.0775, 0.1075,
                                                0.9649, 3.1151, true, Registration::no},
                                           Good{"rgbd_7scenes_sentinel", "7-Scenes / BundleFusion", 3, 585, 0.123,
                                                0.165, 0.9, 4.5, true, Registration::no},
                                           Good{"rgbd_redwood", "Redwood / Open3D", 5, 525, 0.1235, 0.1305, 0.9549,
                                                2.7021, true, Registration::unknown},
                                           Good{"rgbd_tum_fr1_desk", "TUM RGB-D", 6, 517.3, 0.1685, 0.1835, 0.735,
                                                2.1151, true, Registration::yes},
                                           Good{"rgbd_tum_converted", "TUM RGB-D", 20, 525, 0.078, 0.108, 0.9649,
                                                3.1151, true, Registration::unknown},
                                           Good{"rgbd_realsense", "colour and depth folders", 5, 617.25, 0.0044, 0.0651,
                                                0.2799, 3.1851, false, Registration::unknown},
                                           Good{"rgbd_kinect_pgm", "colour and depth folders", 2, 0, 0.3065, 0.3195,
                                                0.945, 9.8251, true, Registration::unknown}));

TEST(good_data, single_depth_images_need_their_encoding_and_doubt_the_wrong_one) {
    const fs::path folder = data_folder() / "single_frames";
    NEEDS(folder);
    struct Row {
        const char *file, *scale;
        double nearest_m, farthest_m, holes;
    };
    for (const Row& row :
         {Row{"NYU_depth.pgm", "nyu", 1.385, 6.75, 0.072}, Row{"SUN_depth.png", "sun", 1.0569, 9.8701, 0.182},
          Row{"TUM_depth.png", "tum", 1.46, 9.335, 0.192}}) {
        CaptureOptions options;
        options.depth_scale = row.scale;
        const Frame right = open_capture(folder / row.file, options).load(0);
        EXPECT_TRUE(right.warnings.empty()) << joined(right.warnings);
        EXPECT_TRUE(right.doubts.empty()) << joined(right.doubts);
        double nearest = 0, farthest = 0;
        cv::minMaxLoc(right.depth_m, &nearest, &farthest, nullptr, nullptr, right.depth_m > 0);
        EXPECT_GE(nearest, row.nearest_m) << row.file;
        EXPECT_LE(farthest, row.farthest_m) << row.file;
        EXPECT_NEAR(1 - cv::countNonZero(right.depth_m) / 307200.0, row.holes, 0.001) << row.file;
        EXPECT_TRUE(warned(open_capture(folder / row.file).load(0).doubts, "--depth-scale")) << row.file;
    }
}

TEST(good_data, organised_clouds_keep_invalid_points_and_their_colours) {
    const fs::path folder = data_folder() / "organised";
    NEEDS(folder);
    const std::pair<const char*, double> invalid_share[] = {
        {"learn0", 0.407},  {"learn9", 0.321},  {"learn20", 0.368},     {"learn27", 0.347},
        {"learn40", 0.439}, {"office1", 0.172}, {"capture0001", 0.187}, {"frame_20121214T142255.814212", 0.116}};
    for (const auto& [name, share] : invalid_share) {
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(folder / (std::string(name) + ".pcd"), warnings);
        EXPECT_TRUE(warnings.empty()) << joined(warnings);
        EXPECT_EQ(cloud.grid, cv::Size(640, 480));
        const auto invalid =
            std::count_if(cloud.points.begin(), cloud.points.end(), [](const auto& p) { return p.hasNaN(); });
        EXPECT_NEAR(static_cast<double>(invalid) / 307200, share, 0.0006) << name;
        EXPECT_EQ(cloud.colours.empty(), std::string(name) == "capture0001");
    }
}

TEST(good_data, clouds_survive_a_field_more_with_every_bit) {
    const fs::path data = data_folder();
    NEEDS(data / "unorganised");
    const TemporaryFolder folder;
    for (const char* name :
         {"unorganised/frag_115.ply", "unorganised/fragment.pcd", "unorganised/bun0.pcd", "unorganised/milk_color.pcd",
          "organised/learn0.pcd", "terrain_utm/samp11-utm.pcd", "broken/ply/list_in_vertex.ply"}) {
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(data / name, warnings);
        write_cloud(folder / "same", cloud, {});
        EXPECT_TRUE(file_bytes(folder / "same") == file_bytes(data / name)) << name;
        const std::vector<float> values(cloud.points.size(), 0.5F);
        write_cloud(folder / "more", cloud, {{"ambient_occlusion", values}});
        const Cloud more = read_cloud(folder / "more", warnings);
        EXPECT_EQ(more.points.size(), cloud.points.size()) << name;
        EXPECT_EQ(more.colours, cloud.colours) << name;
    }
}

TEST(good_data, lists_whose_images_are_all_missing_are_reported_as_such) {
    const fs::path path = data_folder() / "tum_lists_fr1_xyz";
    NEEDS(path);
    const Capture capture = open_capture(path);
    EXPECT_EQ(capture.entries.size(), 798);
    EXPECT_TRUE(warned(capture.warnings, "none of its 798 images is there"));
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(0); }), "depth.txt line 4"));
}

} // namespace
} // namespace scanshade
