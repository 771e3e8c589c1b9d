// Damaged and odd images and clouds, made here. A refusal must name the file and the place; usable parts must be used,
// with a warning.
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "io/images/image_file.h"
#include "tests/support/files.h"
#include "tests/support/png.h"

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

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
    EXPECT_TRUE(says(with("COUNT 1 1 1", "COUNT 1 0 1"), "line 2: no field y"));
    EXPECT_TRUE(says(with("COUNT 1 1 1", "COUNT 1 99999999999 1"), "line 5"));
    EXPECT_TRUE(says(with("WIDTH 2", "WIDTH 3"), "WIDTH 3 x HEIGHT 1 is 3, but POINTS says 2"));
    EXPECT_TRUE(says(with("WIDTH 2", "WIDTH -2"), "line 6"));
    EXPECT_TRUE(says(with("WIDTH 2", "WIDTH 18446744073709551616"), "line 6"));
    EXPECT_TRUE(says(with("FIELDS x y z", "FIELDS x y q"), "no field z"));
    EXPECT_TRUE(says(with("DATA ascii\n", ""), "no DATA line"));
    EXPECT_TRUE(says(with("DATA ascii", "DATA base64"), "line 9: DATA \"base64\""));
    EXPECT_TRUE(says(with("HEIGHT 1", "POINTS 2"), "second time"));
    EXPECT_TRUE(says(cloud_refusal("hello"), "begins with \"hell\": neither packed PLY, PLY, LAZ, LAS"));
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

} // namespace
} // namespace scanshade
