// Colour images of every format and depth are read as OpenCV reads them. Images of light come back.
#include "io/images/image_file.h"
#include "projection/base/error.h"
#include "projection/srgb.h"
#include "tests/support/files.h"
#include "tests/support/wall.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

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

} // namespace
} // namespace scanshade
