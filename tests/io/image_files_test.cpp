// Image files: AO maps and depth images of every format come back as they were written, stored depth has the unit of
// its encoding, and a name stands for its format.
#include "io/images/format.h"
#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/wall.h"

#include <array>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

cv::Mat1f visibility_ramp() {
    cv::Mat1f map(7, 13);
    for (int i = 0; i < 91; ++i)
        map(i / 13, i % 13) = i % 10 == 3 ? nan : static_cast<float>(i) / 90.0F;
    return map;
}

// --- AO maps ---

class AoFormats : public ::testing::TestWithParam<std::pair<const char*, double>> {};

TEST_P(AoFormats, come_back_within_half_a_step_and_keep_holes) {
    const TemporaryFolder folder;
    const auto [name, tolerance] = GetParam();
    const AoFormat format = ao_format(name);
    const fs::path file = folder / ("map" + extension(format));
    const cv::Mat1f written = visibility_ramp();
    write_ao(file, written, format);
    const cv::Mat1f read = read_ao(file);
    ASSERT_EQ(read.size(), written.size());
    for (int i = 0; i < 91; ++i) {
        const float a = written(i / 13, i % 13), b = read(i / 13, i % 13);
        EXPECT_EQ(std::isnan(a), std::isnan(b)) << i;
        if (!std::isnan(a)) {
            EXPECT_NEAR(a, b, tolerance) << i;
        }
    }
}
// Half a step of 65534 and 254 steps; floats are exact.
INSTANTIATE_TEST_SUITE_P(all, AoFormats,
                         ::testing::Values(std::pair{"png16", 0.5001 / 65534}, std::pair{"png8", 0.5001 / 254},
                                           std::pair{"tiff", 0.0}, std::pair{"exr", 0.0}));

TEST(ao_maps, closed_is_1_and_no_surface_is_0_in_integer_files) {
    const TemporaryFolder folder;
    write_ao(folder / "map.png", (cv::Mat1f(1, 4) << nan, 0.0F, 1.0F, 7.0F), AoFormat::png8);
    const cv::Mat stored = cv::imread((folder / "map.png").string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(stored.at<uchar>(0), 0);
    EXPECT_EQ(stored.at<uchar>(1), 1);
    EXPECT_EQ(stored.at<uchar>(2), 255);
    EXPECT_EQ(stored.at<uchar>(3), 255); // held within 0 .. 1
}

TEST(ao_maps, same_map_gives_same_bytes) {
    const TemporaryFolder folder;
    for (const char* name : {"png16", "tiff", "exr"}) {
        const AoFormat format = ao_format(name);
        write_ao(folder / "a", visibility_ramp(), format);
        write_ao(folder / "b", visibility_ramp(), format);
        EXPECT_EQ(file_bytes(folder / "a"), file_bytes(folder / "b")) << name;
    }
}

TEST(ao_maps, an_unknown_format_is_misuse) { EXPECT_THROW((void)ao_format("bmp"), Misuse); }

// --- depth images ---

TEST(depth_images, png_keeps_every_millimetre) {
    const TemporaryFolder folder;
    write_depth_png(folder / "depth.png", wall(), 1000);
    const cv::Mat1f read = depth_in_metres(read_stored_depth(folder / "depth.png"), depth_encoding("mm", "test"));
    EXPECT_LE(worst_difference(read, wall()), 0.00051);
    EXPECT_EQ(read(0, 0), 0);
}

TEST(depth_images, what_a_png_cannot_hold_becomes_a_hole) {
    const TemporaryFolder folder;
    write_depth_png(folder / "depth.png", (cv::Mat1f(1, 4) << nan, -1.0F, 65.535F, 100.0F), 1000);
    EXPECT_EQ(cv::countNonZero(read_stored_depth(folder / "depth.png")), 0);
}

TEST(depth_images, pgm_is_big_endian) {
    const TemporaryFolder folder;
    const auto file = write_file(folder / "d.pgm", "P5\n# by hand\n2 1\n65535\n" + std::string("\x01\x02\x03\x04", 4));
    const cv::Mat stored = read_stored_depth(file);
    EXPECT_EQ(stored.at<ushort>(0), 0x0102);
    EXPECT_EQ(stored.at<ushort>(1), 0x0304);
}

TEST(depth_images, pfm_starts_at_the_bottom_and_knows_both_byte_orders) {
    const TemporaryFolder folder;
    const std::array<float, 2> values{1.5F, 2.5F}; // bottom row, top row
    std::string little(reinterpret_cast<const char*>(values.data()), 8), big = little;
    std::reverse(big.begin(), big.begin() + 4);
    std::reverse(big.begin() + 4, big.end());
    for (const auto& [scale, bytes] : {std::pair{"-1.0", little}, {"1.0", big}}) {
        const cv::Mat stored =
            read_stored_depth(write_file(folder / "d.pfm", fmt::format("Pf\n1 2\n{}\n", scale) + bytes));
        EXPECT_EQ(stored.at<float>(0), 2.5F) << scale;
        EXPECT_EQ(stored.at<float>(1), 1.5F) << scale;
    }
}

TEST(depth_images, float_tiff_and_exr_are_metres_and_tiff_may_hold_integers) {
    const TemporaryFolder folder;
    write_float_tiff(folder / "d.tiff", wall());
    EXPECT_EQ(worst_difference(read_stored_depth(folder / "d.tiff"), wall()), 0);
    write_ao(folder / "d.exr", wall(), AoFormat::exr);
    EXPECT_EQ(worst_difference(read_stored_depth(folder / "d.exr"), wall()), 0);
    const cv::Mat1w integers(3, 5, ushort(1234));
    cv::imwrite((folder / "i.tiff").string(), integers);
    EXPECT_EQ(worst_difference(read_stored_depth(folder / "i.tiff"), integers), 0);
}

TEST(depth_images, the_signature_decides_the_format_not_the_name) {
    const TemporaryFolder folder;
    write_depth_png(folder / "depth.png", wall(), 1000);
    fs::rename(folder / "depth.png", folder / "depth.tiff");
    EXPECT_EQ(read_stored_depth(folder / "depth.tiff").type(), CV_16UC1);
}

TEST(depth_encodings, sentinels_and_non_numbers_are_holes) {
    const cv::Mat1w integers = (cv::Mat1w(1, 3) << 0, 65535, 500);
    const cv::Mat1f metres = depth_in_metres(integers, depth_encoding("mm", ""));
    EXPECT_EQ(metres(0), 0);
    EXPECT_EQ(metres(1), 0);
    EXPECT_FLOAT_EQ(metres(2), 0.5F);
    const float inf = std::numeric_limits<float>::infinity();
    const cv::Mat1f floats = depth_in_metres((cv::Mat1f(1, 4) << nan, inf, -1.0F, 2.0F), depth_encoding("m", ""));
    EXPECT_EQ(cv::countNonZero(floats), 1);
    EXPECT_EQ(floats(3), 2.0F);
}

TEST(depth_encodings, sun_rotates_and_nyu_swaps) {
    // SUN: 1057 mm rotated left by 3. NYU: disparity 986 byte-swapped is 351.3 / (1092.5 - 986) m (Open3D's constants).
    const cv::Mat1w sun = (cv::Mat1w(1, 1) << ushort(1057 << 3));
    EXPECT_FLOAT_EQ(depth_in_metres(sun, depth_encoding("sun", ""))(0), 1.057F);
    const auto swapped = [](int d) { return static_cast<ushort>((d << 8 | d >> 8) & 0xffff); };
    const cv::Mat1w nyu = (cv::Mat1w(1, 2) << swapped(986), swapped(2047));
    const cv::Mat1f metres = depth_in_metres(nyu, depth_encoding("nyu", ""));
    EXPECT_NEAR(metres(0), 351.3 / 106.5, 1e-5);
    EXPECT_EQ(metres(1), 0);
}

TEST(depth_encodings, integers_and_floats_are_not_mixed_up) {
    EXPECT_THROW((void)depth_in_metres(cv::Mat1w(1, 1, ushort(1)), depth_encoding("m", "")), Error);
    EXPECT_THROW((void)depth_in_metres(cv::Mat1f(1, 1, 1.0F), depth_encoding("tum", "")), Error);
    EXPECT_THROW((void)depth_in_metres(cv::Mat1f(1, 1, 1.0F), depth_encoding("nyu", "")), Error);
}

TEST(depth_encodings, a_number_is_units_per_metre_and_anything_else_is_misuse) {
    EXPECT_EQ(depth_encoding("10000", "test").units_per_metre, 10000);
    for (const char* text : {"", "0", "-5", "nan", "inf", "cm", "1000x"})
        EXPECT_THROW((void)depth_encoding(text, "test"), Misuse) << text;
}

// --- the table of formats ---

/// Names and signatures come from one table: a file is of the format that its extension says.
TEST(image_formats, files_written_under_an_extension_have_its_signature) {
    const TemporaryFolder folder;
    for (const ImageFormat& format : image_formats())
        for (const std::string_view extension : format.extensions) {
            if (!format.written || extension.empty())
                continue;
            EXPECT_EQ(image_format_by_extension(extension), &format);
            const bool colour = format.read_colour != nullptr;
            const std::string bytes =
                format.written(colour ? cv::Mat(cv::Mat3b(3, 4, {1, 2, 3})) : cv::Mat(cv::Mat1f(3, 4, 2.5F)));
            EXPECT_EQ(image_format(bytes), &format) << extension;
            EXPECT_EQ(read_image_header(bytes, "image").size, cv::Size(4, 3)) << extension;
        }
    EXPECT_EQ(image_format("GIF89a"), nullptr);
    EXPECT_EQ(image_format_by_extension(""), nullptr);
}

} // namespace
} // namespace scanshade
