// Files and values: images, cameras, atomic output and captures of every layout come back as they were written.
#include "io/cameras/camera_file.h"
#include "io/captures/capture.h"
#include "io/compression/deflate.h"
#include "io/images/exif.h"
#include "io/images/format.h"
#include "io/images/image_check.h"
#include "io/images/image_file.h"
#include "io/images/png_input.h"
#include "io/images/png_output.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "projection/srgb.h"
#include "tests/support/files.h"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <gtest/gtest.h>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <sys/resource.h>
#include <zlib.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::joined;
using tests::refusal;
using tests::says;
using tests::TemporaryFolder;
using tests::warned;
using tests::write_file;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

cv::Mat1f visibility_ramp() {
    cv::Mat1f map(7, 13);
    for (int i = 0; i < 91; ++i)
        map(i / 13, i % 13) = i % 10 == 3 ? nan : static_cast<float>(i) / 90.0F;
    return map;
}

/// A tilted wall 1 to 2 m away, with a hole in the corner.
cv::Mat1f wall(cv::Size size = {64, 48}) {
    cv::Mat1f depth(size);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            depth(y, x) = 1.0F + static_cast<float>(x) / static_cast<float>(size.width);
    depth(0, 0) = 0;
    return depth;
}

cv::Mat3b picture(cv::Size size = {64, 48}) {
    cv::Mat3b image(size);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            image(y, x) = {static_cast<uchar>(x), static_cast<uchar>(y), 200};
    return image;
}

double worst_difference(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }

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

TEST(depth_images, a_large_png_packed_and_unpacked_in_pieces_is_one_stream) {
    // 72 MB of pixels: two pieces in one direction, 69 in the other. A change in the last ones must not go unseen.
    cv::Mat1w image(6000, 6000);
    std::uint32_t random = 1;
    for (ushort& value : image) {
        random = random * 1664525 + 1013904223;
        value = static_cast<ushort>(2000 + (random >> 28));
    }
    std::string bytes = encoded_png(image);
    EXPECT_EQ(cv::norm(decoded_plain_png(bytes), image, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(cv::imdecode(std::vector<char>(bytes.begin(), bytes.end()), cv::IMREAD_UNCHANGED), image,
                       cv::NORM_INF),
              0)
        << "libpng reads the same";
    constexpr std::size_t from_end_of_stream = 12 + 4 + 2; // IEND, a checksum, and into the stream's own
    bytes[bytes.size() - from_end_of_stream] ^= 1;
    EXPECT_TRUE(decoded_plain_png(bytes).empty()) << "the stream's checksum does not fit";
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

// --- colour ---

TEST(colour_images, grey_and_16_bit_become_8_bit_bgr) {
    const TemporaryFolder folder;
    cv::imwrite((folder / "grey.png").string(), cv::Mat1b(4, 4, uchar(77)));
    EXPECT_EQ(read_colour(folder / "grey.png")(0, 0), cv::Vec3b(77, 77, 77));
    cv::imwrite((folder / "deep.png").string(), cv::Mat(4, 4, CV_16UC3, cv::Scalar(0x1000, 0x2000, 0x3000)));
    EXPECT_EQ(read_colour(folder / "deep.png")(0, 0), cv::Vec3b(0x10, 0x20, 0x30));
}

TEST(colour_images, png_pictures_are_exact_and_jpeg_is_close) {
    const TemporaryFolder folder;
    write_picture(folder / "p.png", picture());
    EXPECT_EQ(worst_difference(read_colour(folder / "p.png"), picture()), 0);
    write_picture(folder / "p.JPG", picture());
    EXPECT_LE(worst_difference(read_colour(folder / "p.JPG"), picture()), 12);
    EXPECT_THROW(write_picture(folder / "p.gif", picture()), Error);
}

/// Light, blue first, as it is stored and as others read it.
TEST(light_images, hold_srgb_as_integers_and_linear_light_as_floats) {
    const TemporaryFolder folder;
    ::setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
    cv::Mat3f light(9, 11);
    cv::RNG random(3);
    random.fill(light, cv::RNG::UNIFORM, 0.0, 1.0);
    light(0, 0) = {-0.5F, std::numeric_limits<float>::quiet_NaN(), 3.25F};
    for (const AoFormat format : {AoFormat::png8, AoFormat::png16, AoFormat::tiff, AoFormat::exr}) {
        const fs::path file = folder / ("light" + extension(format));
        write_light(file, light, format);
        const cv::Mat stored = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
        ASSERT_EQ(stored.channels(), 3);
        if (is_float(format)) {
            ASSERT_EQ(stored.type(), CV_32FC3);
            EXPECT_EQ(cv::norm(stored.rowRange(1, 9), light.rowRange(1, 9), cv::NORM_INF), 0);
            EXPECT_EQ(stored.at<cv::Vec3f>(0, 0)[2], 3.25F) << "more than white stays";
            continue;
        }
        ASSERT_EQ(stored.depth(), format == AoFormat::png16 ? CV_16U : CV_8U);
        const double most = format == AoFormat::png16 ? 65535 : 255;
        cv::Mat3d values;
        stored.convertTo(values, CV_64F);
        EXPECT_EQ(values(0, 0), cv::Vec3d(0, 0, most)) << "what is no light is black, what exceeds white is white";
        for (int i = 0; i < 3; ++i)
            EXPECT_EQ(values(5, 5)[i], std::round(most * srgb_from_linear(static_cast<double>(light(5, 5)[i]))));
    }
}

TEST(light_images, of_16_bits_come_back_bit_for_bit) {
    const TemporaryFolder folder;
    cv::Mat3w deep(256, 86);
    for (int i = 0; i < 256 * 86 * 3; ++i)
        deep.ptr<ushort>()[i] = static_cast<ushort>(std::min(i, 65535));
    cv::Mat3f light(deep.size());
    for (int i = 0; i < 256 * 86 * 3; ++i)
        light.ptr<float>()[i] = static_cast<float>(linear_from_srgb(deep.ptr<ushort>()[i] / 65535.0));
    write_light(folder / "light.png", light, AoFormat::png16);
    EXPECT_EQ(cv::norm(read_stored_colour(folder / "light.png").deep, deep, cv::NORM_INF), 0) << "all 65536 values";
}

TEST(colour_images, of_16_bits_keep_them_beside_the_8) {
    const TemporaryFolder folder;
    cv::theRNG().state = 9;
    for (const char* kind : {".png", ".tiff", ".ppm"})
        for (const int type : {CV_16UC3, CV_16UC1, CV_8UC3}) {
            const bool grey = CV_MAT_CN(type) == 1, deep = CV_MAT_DEPTH(type) == CV_16U;
            if (grey && std::string(kind) == ".ppm")
                continue;
            SCOPED_TRACE(fmt::format("{} of type {}", kind, type));
            cv::Mat image(19, 23, type), three;
            cv::randu(image, cv::Scalar::all(0), cv::Scalar::all(deep ? 65536 : 256));
            const fs::path file = folder / (std::string("image") + kind);
            ASSERT_TRUE(cv::imwrite(file.string(), image));
            const StoredColour stored = read_stored_colour(file);
            EXPECT_EQ(cv::norm(stored.colour, read_colour(file), cv::NORM_INF), 0);
            if (!deep) {
                EXPECT_TRUE(stored.deep.empty());
                continue;
            }
            grey ? cv::merge(std::vector<cv::Mat>(3, image), three) : void(three = image);
            ASSERT_EQ(stored.deep.size(), image.size());
            EXPECT_EQ(cv::norm(stored.deep, three, cv::NORM_INF), 0);
        }
    // Planes one after the other, and numbers up to 1023: as 8 bits, as ever.
    write_file(folder / "odd.ppm", "P6 1 1 1023\n" + std::string("\3\377\0\1\2\0", 6));
    EXPECT_TRUE(read_stored_colour(folder / "odd.ppm").deep.empty());
    EXPECT_EQ(read_colour(folder / "odd.ppm")(0, 0), cv::Vec3b(127, 0, 255))
        << "1023 is white: 1023, 1, 512 are red, green, blue";
    const std::string cut = tests::read_bytes(folder / "image.png");
    EXPECT_NE(refusal([&] { (void)stored_colour_in(cut.substr(0, cut.size() / 2), "cut.png"); }), "");
}

/// Of every format that OpenCV writes, too, and in each of its depths.
TEST(colour_images, are_read_as_opencv_reads_them) {
    const TemporaryFolder folder;
    cv::theRNG().state = 8;
    for (const char* kind : {".png", ".jpg", ".tiff", ".bmp", ".webp", ".ppm", ".pgm"})
        for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3}) {
            const std::string name(kind);
            const bool grey = CV_MAT_CN(type) == 1, alpha = CV_MAT_CN(type) == 4, deep = CV_MAT_DEPTH(type) == CV_16U;
            const bool only_grey = name == ".pgm", only_colour = name == ".webp" || name == ".ppm";
            const bool deep_too = name == ".png" || name == ".tiff" || name == ".ppm" || only_grey;
            const bool alpha_too = name == ".png" || name == ".tiff" || name == ".webp" || name == ".bmp";
            if ((grey ? only_colour : only_grey) || (deep && !deep_too) || (alpha && !alpha_too))
                continue;
            SCOPED_TRACE(name + " of type " + std::to_string(type));
            cv::Mat image(19, 23, type);
            cv::randu(image, cv::Scalar::all(0), cv::Scalar::all(deep ? 65536 : 256));
            const fs::path file = folder / ("image" + name);
            ASSERT_TRUE(cv::imwrite(file.string(), image));
            const cv::Mat theirs = cv::imread(file.string(), cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
            EXPECT_EQ(cv::norm(read_colour(file), theirs, cv::NORM_INF), 0);
        }
}

TEST(colour_images, netpbm_and_bmp_of_rare_kinds_are_read) {
    const TemporaryFolder folder;
    const auto read = [&](const std::string& bytes) { return read_colour(write_file(folder / "image", bytes)); };
    const cv::Vec3b black(0, 0, 0), white(255, 255, 255);
    EXPECT_EQ(read("P1\n# a comment\n3 1\n1 0\n1\n")(0, 1), white); // bits: 1 is black
    EXPECT_EQ(read("P1 3 1\n101")(0, 2), black);
    EXPECT_EQ(read("P4 3 1\n\xA0")(0, 1), white);
    EXPECT_EQ(read("P2 2 1 100\n50 100\n")(0, 0), cv::Vec3b(127, 127, 127));
    EXPECT_EQ(read("P2 2 1 1023\n512 1023\n")(0, 1), white);
    EXPECT_EQ(read("P5 2 1 100\n2d")(0, 0), cv::Vec3b(127, 127, 127)); // "2" is 50, "d" is 100
    EXPECT_EQ(read("P5 2 1 100\n2d")(0, 1), white);
    EXPECT_EQ(
        read("P7 WIDTH 2 HEIGHT 1 DEPTH 1 MAXVAL 1 TUPLTYPE BLACKANDWHITE ENDHDR\n" + std::string("\0\1", 2))(0, 1),
        white);
    EXPECT_EQ(read("P3 1 1 255\n1 2 3\n")(0, 0), cv::Vec3b(3, 2, 1));
    EXPECT_EQ(read("P7\nWIDTH 1\nHEIGHT 1\nDEPTH 4\nMAXVAL 255\nTUPLTYPE RGB_ALPHA\nENDHDR\n\1\2\3\4")(0, 0),
              cv::Vec3b(3, 2, 1));
    for (const char* broken :
         {"P1 3 1\n10", "P4 9 1\n\xA0", "P2 2 1 100\n50\n", "P3 1 1 255\n1 2 256\n", "P7\nWIDTH 1\n", "P2 1 1 255"})
        EXPECT_NE(refusal([&] { (void)read(broken); }), "") << broken;

    // 3x2 pixels of a palette of 2, in runs: the bottom row is 1 0 0, the top one ends after its first pixel.
    const auto bmp = [](const std::string& runs) {
        const std::string zeros(3, '\0');
        return "BM" + std::string(8, '\0') + '\x3e' + zeros + '\x28' + zeros + '\3' + zeros + '\2' + zeros +
               std::string("\1\0\x8\0\1", 5) + std::string(15, '\0') + '\2' + std::string(7, '\0') +
               std::string("\x9\x9\x9\0\1\2\3\0", 8) + runs;
    };
    const cv::Mat3b image = read(bmp(std::string("\1\1\2\0\0\0\1\1\0\1", 10)));
    EXPECT_EQ(image(1, 0), cv::Vec3b(1, 2, 3));
    EXPECT_EQ(image(1, 2), cv::Vec3b(9, 9, 9));
    EXPECT_EQ(image(0, 0), cv::Vec3b(1, 2, 3));
    EXPECT_TRUE(says(refusal([&] { (void)read(bmp("\4\1")); }), "a run leaves the image"));
    EXPECT_TRUE(says(refusal([&] { (void)read(bmp("\1\1")); }), "runs have no end"));
}

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

// --- atomic output ---

TEST(atomic_output, a_failed_write_leaves_neither_target_nor_temporary) {
    const TemporaryFolder folder;
    const fs::path target = folder / "new/map.png";
    const std::string message = refusal([&] {
        write_atomically(target, [](const fs::path& temporary) {
            write_file(temporary, "half");
            throw Error("disk on fire");
        });
    });
    EXPECT_TRUE(says(message, target.string()));
    EXPECT_TRUE(says(message, "disk on fire"));
    EXPECT_TRUE(fs::is_empty(target.parent_path()));
}

TEST(atomic_output, an_existing_file_stays_whole_until_the_new_one_is) {
    const TemporaryFolder folder;
    const fs::path target = write_file(folder / "map.png", "old");
    write_atomically(target, [&](const fs::path& temporary) {
        EXPECT_EQ(temporary.parent_path(), target.parent_path());
        EXPECT_EQ(temporary.extension(), ".png");
        EXPECT_TRUE(temporary.filename().string().starts_with("."));
        write_file(temporary, "new");
        EXPECT_EQ(file_bytes(target), "old");
    });
    EXPECT_EQ(file_bytes(target), "new");
}

TEST(atomic_output, leftovers_of_ones_own_targets_are_removed_and_nothing_else) {
    const TemporaryFolder folder;
    write_file(folder / ".map.tmp-999999999-3.png", "half");
    write_file(folder / ".other.tmp-999999999-3.png", "another machine is writing this");
    write_file(folder / "map.tmp-999999999-3.png", "the user's");
    write_file(folder / ".map.tmp-x-3.png", "the user's");
    write_file(folder / ".hidden", "the user's");
    const auto ours = [](std::string_view stem) { return stem == "map"; };
    EXPECT_EQ(remove_leftovers(folder.path(), ours), 1);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 4);
    EXPECT_EQ(remove_leftovers(folder / "nowhere", ours), 0);
}

// --- cameras ---

TEST(camera_files, our_json_comes_back_bit_for_bit) {
    const TemporaryFolder folder;
    CameraFile written;
    written.camera = {{525.1234567890123, 524.9, 319.5, 239.25, {640, 480}}, {0.1, -0.2, 1e-4, 2e-5, 0.03}, ""};
    written.depth_units_per_metre = 5000;
    written.registration = Registration::yes;
    write_camera_file(folder / "camera.json", written);
    const CameraFile read = read_camera_file(folder / "camera.json");
    EXPECT_EQ(read.camera.pinhole.fx, written.camera.pinhole.fx);
    EXPECT_EQ(read.camera.pinhole.cy, written.camera.pinhole.cy);
    EXPECT_EQ(read.camera.pinhole.size, cv::Size(640, 480));
    EXPECT_EQ(read.camera.distortion.p2, 2e-5);
    EXPECT_EQ(read.depth_units_per_metre, 5000);
    EXPECT_EQ(read.registration, Registration::yes);
    EXPECT_TRUE(says(read.camera.origin, "camera.json"));
}

CameraFile two_cameras() {
    CameraFile file;
    file.camera = {{585, 585, 320, 240, {640, 480}}, {}, ""};
    ColourCamera colour{{{525.25, 524.75, 319.5, 239.25, {1280, 960}}, {-0.06, 0.01, 1e-3, -2e-3, 0}, ""}, {}};
    colour.colour_from_depth = Eigen::Isometry3d::Identity();
    colour.colour_from_depth.linear() = Eigen::AngleAxisd(0.03, Eigen::Vector3d(1, 2, -2) / 3).toRotationMatrix();
    colour.colour_from_depth.translation() = Eigen::Vector3d(0.025, -0.001, 0.002);
    file.colour = colour;
    return file;
}

TEST(camera_files, a_colour_camera_a_depth_correction_and_a_clock_come_back) {
    const TemporaryFolder folder;
    CameraFile written = two_cameras();
    written.depth_correction = {1.01, -0.004, 0.002};
    written.pose_time_offset_s = -0.0125;
    write_camera_file(folder / "camera.json", written);
    const CameraFile read = read_camera_file(folder / "camera.json");
    EXPECT_EQ(read.depth_correction, written.depth_correction);
    EXPECT_EQ(read.pose_time_offset_s, -0.0125);
    ASSERT_TRUE(read.colour);
    EXPECT_EQ(read.colour->camera.pinhole.size, cv::Size(1280, 960));
    EXPECT_EQ(read.colour->camera.pinhole.fx, 525.25);
    EXPECT_EQ(read.colour->camera.distortion, written.colour->camera.distortion);
    EXPECT_TRUE(read.colour->colour_from_depth.isApprox(written.colour->colour_from_depth, 1e-12));

    write_camera_file(folder / "chain.yaml", two_cameras(), CameraFormat::kalibr);
    const CameraFile chain = read_camera_file(folder / "chain.yaml");
    EXPECT_EQ(chain.camera.pinhole.fx, 585);
    ASSERT_TRUE(chain.colour);
    EXPECT_EQ(chain.colour->camera.distortion, written.colour->camera.distortion);
    EXPECT_TRUE(chain.colour->colour_from_depth.isApprox(written.colour->colour_from_depth, 1e-12));
    EXPECT_TRUE(warned(chain.warnings, "cam1 as the colour camera"));
}

TEST(camera_files, what_only_ours_can_hold_is_refused_elsewhere) {
    const TemporaryFolder folder;
    CameraFile corrected, late;
    corrected.camera = late.camera = two_cameras().camera;
    corrected.depth_correction.scale = 1.02;
    late.pose_time_offset_s = 0.01;
    for (const CameraFormat format :
         {CameraFormat::open3d, CameraFormat::opencv, CameraFormat::ros, CameraFormat::colmap})
        EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "c", two_cameras(), format); }), "holds one camera"));
    EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "c", corrected, CameraFormat::kalibr); }),
                     "no depth correction, and there is one (1.02 z"));
    EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "c", late, CameraFormat::ros); }), "no time offset"));
    EXPECT_FALSE(fs::exists(folder / "c"));
}

TEST(camera_files, damage_to_the_secondary_camera_names_the_key) {
    const TemporaryFolder folder;
    const std::string main = R"({"fx":5,"fy":5,"cx":1,"cy":1,"width":4,"height":4)";
    const auto message = [&](const std::string& more) {
        return refusal([&] { (void)read_camera_file(write_file(folder / "c.json", main + "," + more + "}")); });
    };
    const std::string numbers = R"("fx":5,"fy":5,"cx":1,"cy":1,"width":4,"height":4)";
    EXPECT_TRUE(says(message(R"("colour":3)"), "not an object that describes a camera"));
    EXPECT_TRUE(says(message(R"("colour":{)" + numbers + "}"), "\"colour_from_depth\" is missing"));
    EXPECT_TRUE(
        says(message(R"("colour":{)" + numbers + R"(,"colour_from_depth":[[1,0,0,0]]})"), "not a list of 4 rows"));
    EXPECT_TRUE(
        says(message(R"("colour":{)" + numbers + R"(,"colour_from_depth":[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]})"),
             "not a rotation and a shift"));
    EXPECT_TRUE(says(message(R"("depth_correction":1)"), "\"depth_correction\""));
    EXPECT_TRUE(says(message(R"("depth_correction":{"scale":0})"), "\"scale\" is 0"));
    EXPECT_TRUE(says(message(R"("depth_correction":{"offset_m":"far"})"), "\"offset_m\""));
    EXPECT_TRUE(says(message(R"("pose_time_offset_s":[])"), "\"pose_time_offset_s\""));
}

TEST(camera_files, known_cameras_go_by_name) {
    const CameraFile known = camera_from_argument("tum-fr1");
    EXPECT_EQ(known.camera.pinhole.fx, 517.3);
    EXPECT_EQ(known.camera.distortion.k1, 0.2624);
    EXPECT_TRUE(says(known.camera.origin, "freiburg1"));
    EXPECT_TRUE(says(refusal([] { (void)camera_from_argument("tum-fr9"); }), "primesense"));
}

/// A JPEG with an EXIF block of little-endian tags in its Exif directory: number, type (3 short, 4 long, 5 ratio),
/// value.
fs::path jpeg_with(const fs::path& file, const std::vector<std::array<unsigned, 4>>& tags) {
    std::string tiff("II*\0\x08\0\0\0", 8);
    const auto add = [&](unsigned value, int bytes) {
        for (int i = 0; i < bytes; ++i)
            tiff += static_cast<char>((value >> (8 * i)) & 0xFF);
    };
    add(1, 2); // one entry: where the Exif directory is
    add(0x8769, 2), add(4, 2), add(1, 4), add(26, 4), add(0, 4);
    add(static_cast<unsigned>(tags.size()), 2);
    unsigned ratios = 26 + 2 + 12 * static_cast<unsigned>(tags.size()) + 4;
    for (const auto& [tag, type, value, under] : tags) {
        add(tag, 2), add(type, 2), add(1, 4), add(type == 5 ? ratios : value, 4);
        ratios += type == 5 ? 8 : 0;
    }
    add(0, 4);
    for (const auto& [tag, type, value, under] : tags)
        if (type == 5)
            add(value, 4), add(under, 4);
    std::vector<unsigned char> encoded;
    cv::imencode(".jpg", cv::Mat3b(60, 80, cv::Vec3b(10, 20, 30)), encoded);
    std::string jpeg(encoded.begin(), encoded.end());
    const std::string block = std::string("Exif\0\0", 6) + tiff;
    const auto length = static_cast<unsigned>(block.size() + 2);
    jpeg.insert(2,
                std::string("\xFF\xE1", 2) + static_cast<char>(length >> 8) + static_cast<char>(length & 0xFF) + block);
    return write_file(file, jpeg);
}

TEST(exif, gives_the_focal_length_in_pixels) {
    const TemporaryFolder folder;
    const cv::Size size(80, 60); // its diagonal is 100
    // 26 mm on film of 43.27 mm diagonal.
    const auto film = exif_focal_length_px(jpeg_with(folder / "film.jpg", {{0xA405, 3, 26, 0}}), size);
    ASSERT_TRUE(film);
    EXPECT_NEAR(*film, 26 / 43.2666 * 100, 1e-9);
    // 4.2 mm before a sensor of 200 pixels per centimetre that was 800 x 600 pixels large: 84 px then, a tenth now.
    const auto sensor = exif_focal_length_px(
        jpeg_with(
            folder / "sensor.jpg",
            {{0x920A, 5, 42, 10}, {0xA002, 4, 800, 0}, {0xA003, 4, 600, 0}, {0xA20E, 5, 200, 1}, {0xA210, 3, 3, 0}}),
        size);
    ASSERT_TRUE(sensor);
    EXPECT_NEAR(*sensor, 8.4, 1e-9);
    EXPECT_FALSE(exif_focal_length_px(jpeg_with(folder / "none.jpg", {{0x920A, 5, 42, 10}}), size)); // of what sensor?
    EXPECT_FALSE(exif_focal_length_px(jpeg_with(folder / "zero.jpg", {{0xA405, 3, 0, 0}}), size));
    EXPECT_FALSE(exif_focal_length_px(write_file(folder / "broken.jpg", "\xFF\xD8\xFF\xE1"), size));
    EXPECT_FALSE(exif_focal_length_px(folder / "nowhere.jpg", size));
}

TEST(camera_files, a_text_matrix_is_read_by_rows_and_names_no_size) {
    const TemporaryFolder folder;
    const auto read = read_camera_file(write_file(folder / "k.txt", "\xEF\xBB\xBF"
                                                                    "585 0 320\r\n0 586 240\r\n0 0 1\r\n"));
    EXPECT_EQ(read.camera.pinhole.fy, 586);
    EXPECT_EQ(read.camera.pinhole.cx, 320);
    EXPECT_TRUE(read.camera.pinhole.size.empty());
}

TEST(camera_files, bundle_fusion_info_gives_size_and_depth_unit) {
    const TemporaryFolder folder;
    const auto read = read_camera_file(write_file(
        folder / "info.txt", "m_versionNumber = 4\nm_depthWidth = 640\nm_depthHeight = 480\nm_depthShift = 1000\n"
                             "m_calibrationDepthIntrinsic = 582 0 320 0 0 583 240 0 0 0 1 0 0 0 0 1\n"));
    EXPECT_EQ(read.camera.pinhole.fx, 582);
    EXPECT_EQ(read.camera.pinhole.fy, 583);
    EXPECT_EQ(read.camera.pinhole.cy, 240);
    EXPECT_EQ(read.camera.pinhole.size, cv::Size(640, 480));
    EXPECT_EQ(read.depth_units_per_metre, 1000);
}

TEST(camera_files, every_format_comes_back_as_it_was_written) {
    const TemporaryFolder folder;
    const Pinhole pinhole{525.1234567890123, 524.9, 319.5, 239.25, {640, 480}};
    const Distortion none{}, brown{0.1, -0.2, 1e-4, 2e-5, 0.03}, four{0.1, -0.2, 1e-4, 2e-5, 0};
    const Distortion fisheye = kannala_brandt({0.1, -0.2, 0.03, -0.004});
    const Distortion rational{0.4321, 0.0187, -8.9e-5, -5.2e-5, 0, 0.7718, 0.1184, 0.0064};
    struct Row {
        CameraFormat format;
        const char* name;
        std::vector<Distortion> lenses;
    };
    for (const Row& row : {Row{CameraFormat::scanshade, "a.json", {none, brown, rational, fisheye}},
                           Row{CameraFormat::open3d, "b.json", {none}},
                           Row{CameraFormat::opencv, "c.yml", {none, brown, rational, fisheye}},
                           Row{CameraFormat::ros, "d.yaml", {none, brown, rational, fisheye}},
                           Row{CameraFormat::kalibr, "e.yaml", {none, four, fisheye}},
                           Row{CameraFormat::colmap, "f.txt", {none, four, brown, rational, fisheye}}})
        for (const Distortion& lens : row.lenses) {
            const fs::path file = folder / row.name;
            write_camera_file(file, {.camera = {pinhole, lens, ""}, .depth_units_per_metre = {}, .warnings = {}},
                              row.format);
            const Camera read = read_camera_file(file).camera;
            EXPECT_NEAR(read.pinhole.fx, pinhole.fx, 1e-9) << row.name;
            EXPECT_NEAR(read.pinhole.fy, pinhole.fy, 1e-9) << row.name;
            EXPECT_NEAR(read.pinhole.cx, pinhole.cx, 1e-9) << row.name << ": pixel centres are integers for us";
            EXPECT_NEAR(read.pinhole.cy, pinhole.cy, 1e-9) << row.name;
            EXPECT_EQ(read.pinhole.size, pinhole.size) << row.name;
            EXPECT_EQ(read.distortion, lens) << row.name;
        }
}

TEST(camera_files, what_a_format_cannot_say_is_refused_not_dropped) {
    const TemporaryFolder folder;
    const CameraFile bent{.camera = {{525, 525, 319.5, 239.5, {640, 480}}, {0.1, 0, 0, 0, 0.2}, ""},
                          .depth_units_per_metre = {},
                          .warnings = {}};
    EXPECT_TRUE(
        says(refusal([&] { write_camera_file(folder / "a.json", bent, CameraFormat::open3d); }), "no lens distortion"));
    EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "a.yaml", bent, CameraFormat::kalibr); }), "k3"));
    EXPECT_FALSE(fs::exists(folder / "a.json"));
    CameraFile rational = bent;
    rational.camera.distortion = {.k1 = 0.1, .k6 = 0.2};
    EXPECT_TRUE(says(refusal([&] { write_camera_file(folder / "a.yaml", rational, CameraFormat::kalibr); }), "k6 0.2"));
}

TEST(camera_files, yaml_and_colmap_of_the_wrong_shape_name_the_place) {
    const TemporaryFolder folder;
    const auto message = [&](const std::string& text) {
        return refusal([&] { (void)read_camera_file(write_file(folder / "c.yaml", text)); });
    };
    EXPECT_TRUE(
        says(message("camera_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1]\n"), "has 5 numbers, expected 9"));
    EXPECT_TRUE(says(message("cam0:\n  camera_model: omni\n"), "\"omni\", expected pinhole"));
    EXPECT_TRUE(says(message("image_width: 640\n"), "\"camera_matrix\""));
    const std::string fine = "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [5., 0., 1., 0., 5., 1., 0., 0., 1.]\n";
    EXPECT_TRUE(says(message(fine + "distortion_coefficients: [1., 2.]\n"), "has 2 numbers"));
    EXPECT_TRUE(says(message(fine + "distortion_coefficients: [1., 0., 0., 0., 0., 2., 0.]\n"), "4, 5 or 8"));
    EXPECT_TRUE(says(message(fine + "distortion_coefficients: [1., 0., 0., 0., 0., 2., 0., 0., 3., 0., 0., 0.]\n"),
                     "number 9 is 3: thin-prism"));
    EXPECT_TRUE(says(message("%YAML:1.0\n---\na: [1, 2\nb: 3\n"), "line"));
    EXPECT_TRUE(says(message("1 PINHOLE 640 480 500 500 320\n"), "line 1: PINHOLE has 3 numbers, expected 4"));
    EXPECT_TRUE(says(message("1 FOV 640 480 500 500 320 240 1\n"), "line 1: the camera model \"FOV\""));
    EXPECT_TRUE(says(message("1 PINHOLE 640 480 -500 500 320 240\n"), "fx is -500"));
}

TEST(camera_files, the_command_line_takes_numbers_or_a_file) {
    const CameraFile numbers = camera_from_argument("500, 501, 320, 240");
    EXPECT_EQ(numbers.camera.pinhole.fy, 501);
    EXPECT_TRUE(says(numbers.camera.origin, "--camera"));
    for (const char* text :
         {"500,501,320", "500,501,320,x", "-500,501,320,240", "0,501,320,240", "nowhere.json", "500,nan,1,1"})
        EXPECT_THROW((void)camera_from_argument(text), Misuse) << text;
}

TEST(camera_files, a_negative_fy_is_a_y_axis_upwards) {
    const TemporaryFolder folder;
    for (const CameraFile& read :
         {camera_from_argument("481.2,-480,319.5,239.5"),
          read_camera_file(write_file(folder / "k.txt", "481.2 0 319.5\n0 -480 239.5\n0 0 1\n"))}) {
        EXPECT_EQ(read.camera.pinhole.fy, 480);
        EXPECT_EQ(read.camera.pinhole.cy, 239.5) << "rows still go down";
        EXPECT_TRUE(read.y_was_up);
        EXPECT_TRUE(warned(read.warnings, "y is upwards")) << joined(read.warnings);
    }
    const CameraFile lens = read_camera_file(
        write_file(folder / "c.json", R"({"fx": 50, "fy": -50, "cx": 31.5, "cy": 23.5, "width": 64, "height": 48,
                                          "distortion": [0.1, 0, 0.02, 0.03, 0]})"));
    EXPECT_EQ(lens.camera.distortion.p1, -0.02);
    EXPECT_EQ(lens.camera.distortion.p2, 0.03);
    EXPECT_FALSE(camera_from_argument("481.2,480,319.5,239.5").y_was_up);
}

TEST(camera_files, json_of_the_wrong_shape_names_the_key) {
    const TemporaryFolder folder;
    const auto message = [&](const std::string& text) {
        return refusal([&] { (void)read_camera_file(write_file(folder / "c.json", text)); });
    };
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "width": 4, "height": 4})"), "\"cy\""));
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "cy": "x", "width": 4, "height": 4})"), "\"cy\""));
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 0, "height": 4})"), "\"width\""));
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 4, "height": 4, "distortion": [1]})"),
                     "\"distortion\" has 1 number, expected 5"));
    EXPECT_TRUE(says(message(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 4, "height": 4,
                                 "distortion": [1, 2, 3, 4, 5, 6, 7, "x"]})"),
                     "\"distortion\" is"));
    EXPECT_TRUE(says(message(R"({"fx": 1e999, "fy": 1, "cx": 1, "cy": 1, "width": 4, "height": 4})"), "c.json"));
    EXPECT_TRUE(says(message("[1, 2]"), "object"));
    EXPECT_TRUE(says(message(""), "empty"));
    EXPECT_TRUE(says(message("{\"fx\": 1,\n \"cx\": Infinity}"), "line 2"));
    EXPECT_TRUE(says(message("{\"fx\": 1,\n \"cx\": Infinity}"), "\"cx\""));
}

// --- captures ---

void write_pair(const fs::path& colour, const fs::path& depth, double units) {
    write_picture(colour, picture());
    write_depth_png(depth, wall(), units);
}

/// A capture in TUM's layout: colour a little before depth, poses at other times again.
void write_tum(const fs::path& folder, int frames) {
    std::string rgb = "# colour\n", depth = "# depth\n", poses = "# poses\n";
    for (int i = 0; i < frames; ++i) {
        const std::string colour_name = fmt::format("rgb/{:.6f}.png", 10 + i * 0.1),
                          depth_name = fmt::format("depth/{:.6f}.png", 10.01 + i * 0.1);
        write_pair(folder / colour_name, folder / depth_name, 5000);
        rgb += fmt::format("{:.6f} {}\n", 10 + i * 0.1, colour_name);
        depth += fmt::format("{:.6f} {}\n", 10.01 + i * 0.1, depth_name);
        poses += fmt::format("{:.4f} {} 2 3 0 0 0.7071 0.7071\n", 10.005 + i * 0.1, i);
    }
    write_file(folder / "rgb.txt", rgb);
    write_file(folder / "depth.txt", depth);
    write_file(folder / "groundtruth.txt", poses);
}

void write_camera(const fs::path& file) {
    CameraFile camera;
    camera.camera.pinhole = {60, 60, 31.5, 23.5, {64, 48}};
    camera.registration = Registration::yes;
    write_camera_file(file, camera);
}

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

TEST(captures, tum_without_its_depth_list_is_refused_by_that_name) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 2);
    fs::remove(folder / "depth.txt");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path()); }), "depth.txt: missing, though rgb.txt"));
    fs::remove(folder / "groundtruth.txt");
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path()); }), "depth.txt: missing"));
    fs::remove(folder / "rgb.txt");
    EXPECT_EQ(open_capture(folder.path()).kind, "colour and depth folders") << "nothing says TUM any more";
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

TEST(captures, tum_pairs_by_time_and_reads_poses) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 3);
    write_camera(folder / "camera.json");
    const Capture capture = open_capture(folder.path());
    EXPECT_EQ(capture.kind, "TUM RGB-D");
    EXPECT_EQ(capture.depth.units_per_metre, 5000);
    EXPECT_EQ(capture.registration, Registration::yes);
    EXPECT_TRUE(capture.warnings.empty()) << joined(capture.warnings);
    ASSERT_EQ(capture.entries.size(), 3);
    EXPECT_EQ(capture.entries[1].name, "10.110000"); // the depth image's own stamp
    const Frame frame = capture.load(2);
    EXPECT_LE(worst_difference(frame.depth_m, wall()), 0.00011);
    EXPECT_EQ(worst_difference(frame.colour, picture()), 0);
    EXPECT_EQ(frame.camera.pinhole.size, cv::Size(64, 48));
    ASSERT_TRUE(frame.world_from_camera);
    EXPECT_EQ(frame.world_from_camera->translation(), Eigen::Vector3d(2, 2, 3));
    // A quarter turn about z takes x to y.
    EXPECT_NEAR((*frame.world_from_camera * Eigen::Vector3d::UnitX()).y(), 3, 1e-9);
    EXPECT_TRUE(frame.warnings.empty()) << joined(frame.warnings);
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

TEST(captures, tum_poses_are_taken_between_their_neighbours_and_by_the_cameras_clock) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 3);
    write_camera(folder / "camera.json");
    std::string rows; // 100 poses a second, moving a metre a second along x
    for (int i = 0; i < 60; ++i)
        rows += fmt::format("{:.3f} {} 0 0 0 0 0 1\n", 9.903 + 0.01 * i, 9.903 + 0.01 * i);
    write_file(folder / "groundtruth.txt", rows);
    const CaptureEntry plain = open_capture(folder.path()).entries[1];
    ASSERT_TRUE(plain.world_from_camera);
    EXPECT_NEAR(plain.world_from_camera->translation().x(), *plain.stamp_s, 1e-9);
    EXPECT_NEAR(plain.motion->translation_per_s.x(), 1, 1e-6);
    CameraFile file = read_camera_file(folder / "camera.json");
    file.pose_time_offset_s = 0.0123;
    write_camera_file(folder / "camera.json", file);
    const CaptureEntry late = open_capture(folder.path()).entries[1];
    EXPECT_NEAR(late.world_from_camera->translation().x(), *late.stamp_s + 0.0123, 1e-9);
}

TEST(captures, tum_limit_is_obeyed) {
    const TemporaryFolder folder;
    write_tum(folder.path(), 2);
    CaptureOptions strict;
    strict.association_limit_s = 0.005; // colour is 10 ms away, poses 5 ms
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(folder.path(), strict); }), "0.010 s after rgb.txt"));
}

TEST(captures, tum_poses_end_with_the_trajectory) {
    // Depth at 10.01, 10.11, ..., 10.61; one pose each at 10.2 and 10.3. A frame takes a pose within 20 ms on either
    // side, also before the first and behind the last one, and none beyond that.
    const TemporaryFolder folder;
    write_tum(folder.path(), 7);
    write_camera(folder / "camera.json");
    write_file(folder / "groundtruth.txt", "10.2 1 0 0 0 0 0 1\n10.3 2 0 0 0 0 0 1\n");
    const Capture capture = open_capture(folder.path());
    ASSERT_EQ(capture.entries.size(), 7);
    for (std::size_t i = 0; i < 7; ++i) {
        const bool near = i == 2 || i == 3;
        EXPECT_EQ(capture.entries[i].world_from_camera.has_value(), near) << capture.entries[i].name;
        EXPECT_EQ(capture.entries[i].warnings.empty(), near) << joined(capture.entries[i].warnings);
    }
    EXPECT_EQ(capture.entries[2].world_from_camera->translation().x(), 1);
    EXPECT_EQ(capture.entries[3].world_from_camera->translation().x(), 2);
}

TEST(captures, tum_uses_each_colour_once) {
    const TemporaryFolder folder;
    write_pair(folder / "rgb/1.png", folder / "depth/1.png", 5000);
    write_file(folder / "rgb.txt", "1.000 rgb/1.png\n");
    write_file(folder / "depth.txt", "0.995 depth/1.png\n1.002 depth/1.png\n1.010 depth/1.png\n");
    const Capture capture = open_capture(folder.path());
    ASSERT_EQ(capture.entries.size(), 3);
    EXPECT_TRUE(capture.entries[0].colour.empty());
    EXPECT_FALSE(capture.entries[1].colour.empty()); // the nearest one
    EXPECT_TRUE(capture.entries[2].colour.empty());
}

TEST(captures, tum_takes_the_published_camera_only_for_the_benchmarks_own_recordings) {
    const TemporaryFolder folder;
    const auto open = [&](const std::string& name) {
        const fs::path capture = folder / name;
        write_depth_png(capture / "depth/1.png", wall({640, 480}), 5000);
        write_file(capture / "depth.txt", "1.0 depth/1.png\n");
        return open_capture(capture);
    };
    const Capture named = open("rgbd_dataset_freiburg2_xyz");
    EXPECT_EQ(named.camera->pinhole.fx, 520.9);
    EXPECT_EQ(named.registration, Registration::yes);
    EXPECT_TRUE(warned(named.warnings, "not applied to depth"));
    const Capture other = open("mine");
    EXPECT_EQ(other.camera->pinhole.fx, 525);
    EXPECT_TRUE(says(other.camera->origin, "assumed"));
    EXPECT_EQ(other.registration, Registration::unknown);
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
    EXPECT_TRUE(says(refusal([&] { (void)open_capture(write_file(folder / "notes.txt", "hello")); }), "neither"));
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
    EXPECT_TRUE(warned(frame.doubts, "implausible"));
    EXPECT_TRUE(warned(frame.doubts, "tum a median of"));
    CaptureOptions right;
    right.depth_scale = "tum";
    EXPECT_FALSE(warned(open_capture(folder / "d.png", right).load(0).doubts, "implausible"));
}

/// Decoded by a library that had no part in writing it.
TEST(images, our_pngs_come_back_bit_by_bit) {
    cv::theRNG().state = 9;
    for (const int type : {CV_8UC1, CV_16UC1, CV_8UC3, CV_16UC3})
        for (const cv::Size size : {cv::Size(1, 1), cv::Size(13, 7), cv::Size(641, 479)}) {
            cv::Mat image(size, type);
            cv::randu(image, cv::Scalar::all(0), cv::Scalar::all(image.depth() == CV_8U ? 256 : 65536));
            const std::string bytes = encoded_png(image);
            const cv::Mat view(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
            const cv::Mat back = cv::imdecode(view, cv::IMREAD_UNCHANGED);
            ASSERT_EQ(back.type(), type);
            ASSERT_EQ(back.size(), size);
            EXPECT_EQ(cv::norm(back, image, cv::NORM_INF), 0);
            if (type == CV_16UC3)
                EXPECT_TRUE(decoded_plain_png(bytes).empty());
            else
                EXPECT_EQ(cv::norm(decoded_plain_png(bytes), image, cv::NORM_INF), 0);
            const cv::Mat inner = image(cv::Rect(0, 0, (size.width + 1) / 2, size.height)); // rows lie apart in memory
            EXPECT_EQ(encoded_png(inner), encoded_png(inner.clone()));
        }
    EXPECT_THROW((void)encoded_png(cv::Mat1f(4, 4, 0.5F)), Error);
    EXPECT_THROW((void)encoded_png(cv::Mat()), Error);
}

/// Calls `work` from ever deeper in the stack.
void at_depths(int depths, const std::function<void()>& work) {
    if (depths == 0)
        return;
    [[maybe_unused]] volatile char further[1 << 16];
    further[0] = '\0';
    work();
    at_depths(depths - 1, work);
    further[1] = '\0'; // not a tail call: the frame stays
}

/// ISA-L's levels 1 and 2 hash an address: one packing in some thousands of the same pixels is another. Small images
/// are packed by level 3, the others by level 0.
TEST(images, the_same_pixels_are_the_same_bytes_wherever_the_stack_lies) {
    cv::theRNG().state = 4;
    std::vector<cv::Mat> images(530);
    for (std::size_t i = 0; i < images.size(); ++i) { // rows that begin alike, so that the first bytes are found again
        const int rows = i < 500 ? 12 : 4000;
        cv::Mat1b row(1, 24), noise(rows, 24);
        cv::randu(row, 0, 256);
        cv::randu(noise, 0, 256);
        cv::repeat(row, rows, 1, images[i]);
        noise.copyTo(images[i], noise > (i < 500 ? 230 : 150));
    }
    std::vector<std::string> first;
    std::size_t different = 0;
    at_depths(80, [&] {
        for (std::size_t i = 0; i < images.size(); ++i)
            if (std::string bytes = encoded_png(images[i]); i == first.size())
                first.push_back(std::move(bytes));
            else
                different += bytes != first[i];
    });
    EXPECT_EQ(different, 0U);
}

/// Codes are made from a few rows. They must fit the others as well: whether all rows are alike, one object stands
/// before nothing, or a strip lies between the rows that were looked at.
TEST(images, a_png_is_as_small_as_by_the_slower_packer) {
    cv::theRNG().state = 8;
    cv::Mat1b noise(480, 640);
    cv::randn(noise, 128, 6);
    for (const cv::Rect& seen : {cv::Rect(0, 0, 640, 480), cv::Rect(0, 0, 640, 240), cv::Rect(0, 100, 640, 9),
                                 cv::Rect(300, 200, 40, 90), cv::Rect(100, 50, 440, 380), cv::Rect()}) {
        cv::Mat1b image(noise.size(), 0);
        if (!seen.empty())
            noise(seen).copyTo(image(seen));
        std::string rows; // as the writer filters them
        for (int y = 0; y < image.rows; ++y) {
            rows += '\2';
            for (int x = 0; x < image.cols; ++x)
                rows += static_cast<char>(image(y, x) - (y > 0 ? image(y - 1, x) : 0));
        }
        EXPECT_LT(encoded_png(image).size(), deflated(rows).size() * 21 / 20 + 500) << seen;
    }
}

/// An image that is packed in bands: a row's differences are those to the last row of the band before.
TEST(images, bands_of_a_large_png_fit_together) {
    cv::Mat1w image(3000, 12000); // 72 MB
    for (int y = 0; y < image.rows; ++y)
        for (int x = 0; x < image.cols; ++x)
            image(y, x) = static_cast<ushort>(x * (y / 500 + 1) + y);
    EXPECT_EQ(cv::norm(decoded_plain_png(encoded_png(image)), image, cv::NORM_INF), 0);
}

/// PNGs that another library wrote, with each of the five filters, in one chunk or many, as it reads them itself; what
/// is not plain grey or RGB is left to it, and so is what is damaged.
TEST(images, plain_pngs_are_read_as_libpng_reads_them) {
    cv::theRNG().state = 3;
    const auto chunk = [](const std::string& type, const std::string& content) {
        std::string bytes;
        const auto append = [&](unsigned long value) {
            for (const int shift : {24, 16, 8, 0})
                bytes += static_cast<char>(value >> shift & 0xff);
        };
        append(content.size());
        bytes += type + content;
        append(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()) + 4, static_cast<uInt>(bytes.size() - 4)));
        return bytes;
    };
    const auto png = [&](cv::Size size, int bits, int channels, const std::string& filtered, std::size_t piece,
                         bool transparent) {
        std::string head(8, '\0');
        for (int i = 0; i < 4; ++i) {
            head[3 - i] = static_cast<char>(size.width >> (8 * i) & 0xff);
            head[7 - i] = static_cast<char>(size.height >> (8 * i) & 0xff);
        }
        uLongf length = compressBound(filtered.size());
        std::string packed(length, '\0');
        compress2(reinterpret_cast<Bytef*>(packed.data()), &length, reinterpret_cast<const Bytef*>(filtered.data()),
                  filtered.size(), 6);
        packed.resize(length);
        std::string file =
            "\x89PNG\r\n\x1a\n" +
            chunk("IHDR", head + static_cast<char>(bits) + (channels == 3 ? '\x02' : '\0') + std::string(3, '\0'));
        if (transparent)
            file += chunk("tRNS", std::string(2 * static_cast<std::size_t>(channels), '\0'));
        for (std::size_t at = 0; at < packed.size(); at += piece)
            file += chunk("IDAT", packed.substr(at, piece));
        return file + chunk("IEND", "");
    };
    const auto libpng = [](const std::string& bytes) {
        return cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data())),
                            cv::IMREAD_UNCHANGED);
    };
    for (const auto& [bits, channels] : {std::pair(8, 1), std::pair(16, 1), std::pair(8, 3)})
        for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(37, 11), cv::Size(320, 241)}) {
            std::string filtered; // any bytes are some image, whatever the filter
            for (int y = 0; y < size.height; ++y) {
                filtered += static_cast<char>(y % 5);
                for (int i = 0; i < size.width * channels * bits / 8; ++i)
                    filtered += static_cast<char>(cv::theRNG().uniform(0, 256) & cv::theRNG().uniform(0, 256));
            }
            for (const std::size_t piece : {std::size_t(7), std::size_t(1) << 20}) {
                const std::string file = png(size, bits, channels, filtered, piece, false);
                const cv::Mat ours = decoded_plain_png(file), theirs = libpng(file);
                ASSERT_EQ(read_image_header(file, "image").bits, bits);
                ASSERT_EQ(ours.type(), theirs.type());
                ASSERT_EQ(ours.size(), size);
                EXPECT_EQ(cv::norm(ours, theirs, cv::NORM_INF), 0) << size << " of " << bits << " bits";
            }
            EXPECT_TRUE(decoded_plain_png(png(size, bits, channels, filtered, 1000, true)).empty()) << "transparency";
            EXPECT_TRUE(decoded_plain_png(png(size, bits, channels, filtered + "x", 1000, false)).empty())
                << "more than pixels";
            EXPECT_TRUE(decoded_plain_png(png(size, bits, channels, filtered.substr(1), 1000, false)).empty())
                << "fewer";
            filtered[0] = 5;
            EXPECT_TRUE(decoded_plain_png(png(size, bits, channels, filtered, 1000, false)).empty())
                << "no such filter";
        }
}

TEST(captures, noise_in_place_of_surfaces_is_doubted) {
    const TemporaryFolder folder;
    cv::Mat1w noise(48, 64);
    cv::RNG random(7);
    for (auto& value : noise)
        value = static_cast<ushort>(random.uniform(500, 9000));
    cv::imwrite((folder / "d.png").string(), noise);
    EXPECT_TRUE(warned(open_capture(folder / "d.png").load(0).doubts, "noise"));
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
