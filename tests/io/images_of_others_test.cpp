// Depth images as other programs write them: one channel among many, other types of numbers, a channel of opacity.
#include "io/images/image_file.h"
#include "tests/support/files.h"
#include "tests/support/png.h"

#include <functional>
#include <gtest/gtest.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <opencv2/imgcodecs.hpp>
#include <tiffio.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

constexpr int width = 7, height = 5;

/// Depth at (v, u): 1, 1.5, 2 ...; other channels hold 9.
float depth_at(int v, int u) { return 1 + 0.5F * static_cast<float>(v * width + u); }

void write_exr(const fs::path& file, const std::vector<std::string>& names, const std::string& depth) {
    Imf::Header header(width, height);
    cv::Mat1f others(height, width, 9.0F), z(height, width);
    for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u)
            z(v, u) = depth_at(v, u);
    z(0, 0) = 1e10F;
    Imf::FrameBuffer buffer;
    for (const std::string& name : names) {
        header.channels().insert(name, Imf::Channel(Imf::FLOAT));
        cv::Mat1f& image = name == depth ? z : others;
        buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(image.data), sizeof(float), image.step[0]));
    }
    Imf::OutputFile output(file.c_str(), header);
    output.setFrameBuffer(buffer);
    output.writePixels(height);
}

struct Channels {
    const char* name;
    std::vector<std::string> names;
    const char* depth; ///< the one that is read; none: refused
};
void PrintTo(const Channels& row, std::ostream* to) { *to << row.name; }
class ExrChannels : public testing::TestWithParam<Channels> {};

TEST_P(ExrChannels, of_depth_are_told_by_their_names) {
    const TemporaryFolder folder;
    const Channels& row = GetParam();
    const fs::path file = folder / "depth.exr";
    write_exr(file, row.names, row.depth ? row.depth : "");
    if (!row.depth) {
        const std::string complaint = refusal([&] { (void)read_stored_depth(file); });
        EXPECT_TRUE(says(complaint, "none of them is called Z or depth"));
        for (const std::string& name : row.names)
            EXPECT_TRUE(says(complaint, name));
        return;
    }
    const cv::Mat1f found = read_stored_depth(file);
    EXPECT_EQ(found(2, 3), depth_at(2, 3));
    EXPECT_EQ(found(0, 0), 1e10F);
}

INSTANTIATE_TEST_SUITE_P(
    Of, ExrChannels,
    testing::Values(Channels{"blender", {"Combined.R", "Combined.G", "Combined.B", "Combined.A", "Depth.Z"}, "Depth.Z"},
                    Channels{"blender_layer",
                             {"ViewLayer.Combined.R", "ViewLayer.Depth.Z", "ViewLayer.Normal.Z"},
                             "ViewLayer.Depth.Z"},
                    Channels{"z_beside_colour", {"R", "G", "B", "A", "Z"}, "Z"},
                    Channels{"called_depth", {"R", "G", "B", "depth"}, "depth"},
                    Channels{"unreal", {"FinalImage.R", "FinalImage.G", "WorldDepth.R"}, "WorldDepth.R"},
                    Channels{"alone", {"V"}, "V"}, Channels{"colour", {"R", "G", "B"}, nullptr},
                    Channels{"normals", {"Normal.X", "Normal.Y", "Normal.Z"}, nullptr}),
    [](const auto& info) { return std::string(info.param.name); });

template <class Number>
fs::path write_tiff(const fs::path& file, int format, const std::function<Number(int, int)>& of) {
    TIFF* const tiff = TIFFOpen(file.c_str(), "w");
    const std::initializer_list<std::pair<int, int>> tags{{TIFFTAG_IMAGEWIDTH, width},
                                                          {TIFFTAG_IMAGELENGTH, height},
                                                          {TIFFTAG_BITSPERSAMPLE, 8 * sizeof(Number)},
                                                          {TIFFTAG_SAMPLESPERPIXEL, 1},
                                                          {TIFFTAG_SAMPLEFORMAT, format},
                                                          {TIFFTAG_ROWSPERSTRIP, 2},
                                                          {TIFFTAG_COMPRESSION, COMPRESSION_LZW},
                                                          {TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK},
                                                          {TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG}};
    for (const auto& [tag, value] : tags)
        TIFFSetField(tiff, static_cast<std::uint32_t>(tag), value);
    for (int v = 0; v < height; ++v) {
        std::vector<Number> row;
        for (int u = 0; u < width; ++u)
            row.push_back(of(v, u));
        TIFFWriteScanline(tiff, row.data(), static_cast<std::uint32_t>(v), 0);
    }
    TIFFClose(tiff);
    return file;
}

double millimetres(int v, int u) { return 1000.0 * static_cast<double>(depth_at(v, u)); }

TEST(TiffNumbers, of_all_widths_are_read) {
    const TemporaryFolder folder;
    const auto expect_millimetres = [](const fs::path& file) {
        SCOPED_TRACE(file);
        const cv::Mat1w found = read_stored_depth(file);
        EXPECT_EQ(found(2, 3), millimetres(2, 3));
        EXPECT_EQ(found(0, 0), 0) << "negative numbers mark holes";
    };
    const auto integer = [](auto hole) {
        return [=](int v, int u) { return v + u == 0 ? hole : static_cast<decltype(hole)>(millimetres(v, u)); };
    };
    expect_millimetres(write_tiff<std::uint16_t>(folder / "u16.tif", SAMPLEFORMAT_UINT, integer(std::uint16_t(0))));
    expect_millimetres(write_tiff<std::int16_t>(folder / "i16.tif", SAMPLEFORMAT_INT, integer(std::int16_t(-1))));
    expect_millimetres(write_tiff<std::int32_t>(folder / "i32.tif", SAMPLEFORMAT_INT, integer(std::int32_t(-1))));
    expect_millimetres(write_tiff<std::uint32_t>(folder / "u32.tif", SAMPLEFORMAT_UINT, integer(std::uint32_t(0))));
    const cv::Mat1f f32 = read_stored_depth(write_tiff<float>(folder / "f32.tif", SAMPLEFORMAT_IEEEFP, depth_at));
    const cv::Mat1f f64 = read_stored_depth(write_tiff<double>(folder / "f64.tif", SAMPLEFORMAT_IEEEFP, depth_at));
    const cv::Mat1f f16 =
        read_stored_depth(write_tiff<std::uint16_t>(folder / "f16.tif", SAMPLEFORMAT_IEEEFP, [](int v, int u) {
            cv::Mat half;
            cv::Mat1f(1, 1, depth_at(v, u)).convertTo(half, CV_16F);
            return *half.ptr<std::uint16_t>();
        }));
    for (const cv::Mat1f& found : {f32, f64, f16})
        EXPECT_EQ(found(2, 3), depth_at(2, 3));
}

TEST(TiffNumbers, that_are_no_depth_are_refused_with_the_value) {
    const TemporaryFolder folder;
    const auto complaint = [&](const fs::path& file) { return refusal([&] { (void)read_stored_depth(file); }); };
    EXPECT_TRUE(
        says(complaint(write_tiff<std::int32_t>(folder / "wide.tif", SAMPLEFORMAT_INT, [](int, int) { return 70000; })),
             "integers of 32 bits holds 70000, expected depth of 16 bits"));
    EXPECT_TRUE(says(complaint(write_tiff<std::uint32_t>(folder / "mark.tif", SAMPLEFORMAT_UINT,
                                                         [](int, int) { return 0xffffffffU; })),
                     "holds 4294967295"));
    EXPECT_TRUE(
        says(complaint(write_tiff<std::int8_t>(folder / "i8.tif", SAMPLEFORMAT_INT, [](int, int) { return 1; })),
             "8-bit TIFF"));
}

TEST(GreyWithAlpha, of_16_bits_is_depth_and_of_8_is_not) {
    const TemporaryFolder folder;
    for (const int bits : {8, 16}) {
        const fs::path file = folder / "grey_alpha.png";
        const std::string sample = (bits == 16 ? std::string("\x03\xe8", 2) : "\x07") + std::string(bits / 8, '\xff');
        std::string rows;
        for (int v = 0; v < height; ++v) {
            rows += '\0'; // no filter
            for (int u = 0; u < width; ++u)
                rows += sample;
        }
        const std::string header =
            big_endian(width) + big_endian(height) + static_cast<char>(bits) + '\4' + std::string(3, '\0');
        write_file(file, std::string("\x89PNG\r\n\x1a\n") + png_chunk("IHDR", header) +
                             png_chunk("IDAT", compressed(rows)) + png_chunk("IEND", ""));
        if (bits == 16) {
            EXPECT_EQ(cv::Mat1w(read_stored_depth(file))(2, 3), 1000);
        } else {
            EXPECT_TRUE(says(refusal([&] { (void)read_stored_depth(file); }), "8-bit PNG"));
        }
    }
}

} // namespace
} // namespace scanshade
