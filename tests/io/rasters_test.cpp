// Rasters of maps: written and read again, in all layouts, and what is refused.
#include "io/rasters/cog.h"
#include "io/rasters/raster.h"
#include "io/rasters/tiff.h"
#include "io/rasters/well_known_text.h"
#include "tests/support/files.h"

#include <cmath>
#include <cstring>
#include <functional>
#include <gtest/gtest.h>

namespace scanshade::rasters {
namespace {

namespace fs = std::filesystem;
using tests::refusal;
using tests::says;

fs::path folder() {
    fs::path path = fs::path(testing::TempDir()) / "rasters_test";
    fs::create_directories(path);
    return path;
}

cv::Mat1f heights() {
    cv::Mat1f z(37, 53);
    for (int r = 0; r < z.rows; ++r)
        for (int c = 0; c < z.cols; ++c)
            z(r, c) = 300 + 0.25F * static_cast<float>((r * 17 + c * 5) % 41);
    z(3, 4) = NAN;
    return z;
}

GeoKeys utm_33() {
    GeoKeys keys;
    for (const auto& [key, value] :
         {std::pair(1024, 1), std::pair(1025, 1), std::pair(3072, 32633), std::pair(3076, 9001)})
        keys = with_value(std::move(keys), key, value);
    return keys;
}

Grid grid() {
    Grid grid;
    grid.x0 = 500000.5, grid.y0 = 5200040.25, grid.cell = 0.5;
    grid.crs = crs_of_keys(utm_33());
    return grid;
}

bool same(const cv::Mat1f& a, const cv::Mat1f& b) {
    if (a.size() != b.size())
        return false;
    for (int r = 0; r < a.rows; ++r)
        for (int c = 0; c < a.cols; ++c)
            if (a(r, c) != b(r, c) && !(std::isnan(a(r, c)) && std::isnan(b(r, c))))
                return false;
    return true;
}

/// A TIFF of one strip, with tags of the test's own.
struct Made {
    int bits = 32, format = SAMPLEFORMAT_IEEEFP, samples = 1;
    std::string bytes; ///< of the strip
    cv::Size size;
    std::function<void(TiffOutput&)> more = [](TiffOutput&) {};

    [[nodiscard]] fs::path write(const std::string& name, bool big = false) const {
        TiffOutput tiff(big);
        tiff.set(TIFFTAG_IMAGEWIDTH, size.width);
        tiff.set(TIFFTAG_IMAGELENGTH, size.height);
        tiff.set(TIFFTAG_BITSPERSAMPLE, bits);
        tiff.set(TIFFTAG_SAMPLEFORMAT, format);
        tiff.set(TIFFTAG_SAMPLESPERPIXEL, samples);
        tiff.set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
        tiff.set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
        tiff.set(TIFFTAG_ROWSPERSTRIP, size.height);
        more(tiff);
        tiff.write_strip(0, bytes);
        return tests::write_file(folder() / name, tiff.close());
    }
};

template <class Number>
Made made(const std::vector<Number>& numbers, cv::Size size) {
    Made file;
    file.bits = 8 * sizeof(Number);
    file.format = std::is_floating_point_v<Number> ? SAMPLEFORMAT_IEEEFP
                  : std::is_signed_v<Number>       ? SAMPLEFORMAT_INT
                                                   : SAMPLEFORMAT_UINT;
    file.size = size;
    file.bytes.assign(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(Number));
    return file;
}

void place(TiffOutput& tiff) {
    tiff.set(tag_scale, std::vector{2.0, 2.0, 0.0});
    tiff.set(tag_tiepoints, std::vector{0.0, 0.0, 0.0, 1000.0, 2000.0, 0.0});
    tiff.set(tag_keys, utm_33().directory);
}

TEST(Rasters, what_is_written_is_read_again_in_its_place) {
    const fs::path path = folder() / "round.tif";
    write_raster(path, heights(), grid(), {"a test", {{"SVF_DEFINITION", "solid-angle"}}});
    const Raster read = read_raster(path);
    EXPECT_TRUE(same(read.z, heights()));
    EXPECT_EQ(read.grid.x0, grid().x0);
    EXPECT_EQ(read.grid.y0, grid().y0);
    EXPECT_EQ(read.grid.cell, 0.5);
    EXPECT_EQ(read.grid.crs.keys.directory, utm_33().directory);
    EXPECT_EQ(read.grid.crs.epsg, 32633);
    EXPECT_TRUE(read.notes.empty()) << tests::joined(read.notes);
    const TiffInput tiff(path);
    EXPECT_EQ(tiff.ascii(tag_nodata), "nan");
    EXPECT_TRUE(says(tiff.ascii(tag_metadata), "<Item name=\"SVF_DEFINITION\">solid-angle</Item>"));
}

TEST(Rasters, bytes_have_no_nodata) {
    cv::Mat1b bytes(9, 11);
    cv::randu(bytes, 0, 255);
    const fs::path path = folder() / "bytes.tif";
    write_raster(path, bytes, grid(), {});
    cv::Mat1f expected;
    bytes.convertTo(expected, CV_32F);
    EXPECT_TRUE(same(read_raster(path).z, expected));
    EXPECT_EQ(TiffInput(path).ascii(tag_nodata), "");
}

TEST(Rasters, numbers_of_every_type_are_heights) {
    const cv::Size size(3, 2);
    const cv::Mat1f expected = (cv::Mat1f(2, 3) << 1, 2, 3, 100, 90, 80);
    const auto read = [&](auto number, const std::string& name) {
        using Number = decltype(number);
        Made file = made(std::vector<Number>{1, 2, 3, 100, 90, 80}, size);
        file.more = &place;
        const Raster raster = read_raster(file.write(name), 0);
        EXPECT_TRUE(same(cv::Mat(raster.z + raster.base), expected)) << name;
    };
    read(std::uint8_t{}, "u8.tif"), read(std::int8_t{}, "i8.tif"), read(std::uint16_t{}, "u16.tif");
    read(std::int16_t{}, "i16.tif"), read(std::uint32_t{}, "u32.tif"), read(std::int32_t{}, "i32.tif");
    read(std::uint64_t{}, "u64.tif"), read(std::int64_t{}, "i64.tif"), read(float{}, "f32.tif"),
        read(double{}, "f64.tif");
}

TEST(Rasters, doubles_keep_digits_that_single_precision_lacks) {
    Made file = made(std::vector<double>{4000.000125, 4000.00025}, {2, 1});
    file.more = &place;
    const Raster raster = read_raster(file.write("doubles.tif"));
    EXPECT_NEAR(raster.z(0, 1) - raster.z(0, 0), 0.000125, 1e-9);
    EXPECT_NEAR(raster.z(0, 0) + raster.base, 4000.000125, 1e-9);
}

TEST(Rasters, nodata_and_scale_are_the_files_own) {
    Made file = made(std::vector<std::int16_t>{-9999, 100, 250, 300}, {2, 2});
    file.more = [](TiffOutput& tiff) {
        place(tiff);
        tiff.set(tag_nodata, std::string("-9999"));
        tiff.set(tag_metadata,
                 std::string("<GDALMetadata><Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.01</Item><Item "
                             "name=\"OFFSET\" sample=\"0\" role=\"offset\">5</Item></GDALMetadata>"));
    };
    const Raster raster = read_raster(file.write("scaled.tif"));
    EXPECT_TRUE(std::isnan(raster.z(0, 0)));
    EXPECT_NEAR(raster.z(0, 1) + raster.base, 6, 1e-6);
    EXPECT_NEAR(raster.z(1, 1) + raster.base, 8, 1e-6);
    // A number of single precision, as GDAL prints it with 16 digits.
    Made floats = made(std::vector<float>{-3.4028235e38F, 7}, {2, 1});
    floats.more = [](TiffOutput& tiff) {
        place(tiff);
        tiff.set(tag_nodata, std::string("-3.402823466385289e+38"));
    };
    const Raster huge = read_raster(floats.write("huge.tif", true));
    EXPECT_TRUE(std::isnan(huge.z(0, 0)));
    EXPECT_EQ(huge.z(0, 1), 7);
}

TEST(Rasters, points_and_inner_tiepoints_lie_where_they_say) {
    Made file = made(std::vector<float>{1, 2, 3, 4}, {2, 2});
    file.more = [](TiffOutput& tiff) {
        place(tiff);
        tiff.set(tag_keys, with_value(utm_33(), 1025, 2).directory);
    };
    const Raster point = read_raster(file.write("point.tif"));
    EXPECT_EQ(point.grid.x0, 999); // half a cell of 2 west of the centre
    EXPECT_EQ(point.grid.y0, 2001);
    EXPECT_EQ(value_of(point.grid.crs.keys, 1025, 0), 1);
    file.more = [](TiffOutput& tiff) {
        place(tiff);
        tiff.set(tag_tiepoints, std::vector{10.0, 20.0, 0.0, 1020.0, 1960.0, 0.0});
    };
    const Raster inner = read_raster(file.write("inner.tif"));
    EXPECT_EQ(inner.grid.x0, 1000);
    EXPECT_EQ(inner.grid.y0, 2000);
}

TEST(Rasters, world_files_and_texts_beside_are_read) {
    Made file = made(std::vector<float>{1, 2, 3, 4}, {2, 2});
    for (const char* earlier : {"beside.tfw", "beside.prj"})
        fs::remove(folder() / earlier);
    const fs::path path = file.write("beside.tif");
    EXPECT_TRUE(tests::warned(read_raster(path).notes, "does not say where it lies"));
    tests::write_file(folder() / "beside.tfw", "0.5\n0\n0\n-0.5\n100.25\n199.75\n");
    tests::write_file(
        folder() / "beside.prj",
        R"(PROJCS["x",GEOGCS["y",UNIT["Degree",0.0174532925199433]],UNIT["Foot_US",0.3048006096012192]])");
    const Raster raster = read_raster(path);
    EXPECT_EQ(raster.grid.x0, 100);
    EXPECT_EQ(raster.grid.y0, 200);
    EXPECT_EQ(raster.grid.cell, 0.5);
    EXPECT_NEAR(raster.grid.crs.unit_m, 1200.0 / 3937, 1e-12);
    EXPECT_TRUE(tests::warned(raster.notes, "unit of heights"));
    // Its text has no code, so it goes beside what is written, from where it is read again.
    const fs::path copy = folder() / "copy.tif";
    write_raster(copy, raster.z, raster.grid, {});
    EXPECT_NEAR(read_raster(copy).grid.crs.unit_m, 1200.0 / 3937, 1e-12);
}

TEST(Rasters, what_cannot_be_a_height_field_of_square_cells_is_refused) {
    Made file = made(std::vector<float>{1, 2, 3, 4}, {2, 2});
    const auto refused = [&](const std::function<void(TiffOutput&)>& more) {
        file.more = more;
        return refusal([&] { (void)read_raster(file.write("refused.tif")); });
    };
    const auto keys = [](TiffOutput& tiff, const GeoKeys& changed) {
        place(tiff), tiff.set(tag_keys, changed.directory);
    };
    EXPECT_TRUE(says(refused([&](TiffOutput& tiff) { keys(tiff, with_value(utm_33(), 1024, 2)); }), "degrees"));
    EXPECT_TRUE(says(refused([](TiffOutput& tiff) {
                         tiff.set(tag_scale, std::vector{1e-5, 1e-5, 0.0});
                         tiff.set(tag_tiepoints, std::vector{0.0, 0.0, 0.0, 15.0, 47.0, 0.0});
                     }),
                     "probably degrees"));
    EXPECT_TRUE(says(refused([](TiffOutput& tiff) {
                         place(tiff), tiff.set(tag_scale, std::vector{2.0, 1.0, 0.0});
                     }),
                     "squares"));
    EXPECT_TRUE(says(refused([](TiffOutput& tiff) {
                         place(tiff), tiff.set(tag_scale, std::vector{2.0, -2.0, 0.0});
                     }),
                     "north up"));
    EXPECT_TRUE(says(refused([](TiffOutput& tiff) {
                         place(tiff), tiff.set(tag_scale, std::vector{std::nan(""), 2.0, 0.0});
                     }),
                     "not a number"));
    EXPECT_TRUE(says(refused([&](TiffOutput& tiff) { keys(tiff, with_value(utm_33(), 3076, 9999)); }), "key 3076"));
    EXPECT_TRUE(says(refused([&](TiffOutput& tiff) {
                         GeoKeys cut = utm_33();
                         cut.directory[3] = 40;
                         keys(tiff, cut);
                     }),
                     "key directory"));
    Made bands = made(std::vector<float>{1, 5, 2, 6, 3, 7, 4, 8}, {2, 2});
    bands.samples = 2;
    bands.more = &place;
    const fs::path two = bands.write("two.tif");
    EXPECT_TRUE(says(refusal([&] { (void)read_raster(two); }), "--band"));
    EXPECT_EQ(read_raster(two, 2).z(1, 1), 8);
    EXPECT_TRUE(says(refusal([&] { (void)read_raster(two, 3); }), "band 3 of 2"));
    Made short_of = made(std::vector<std::uint8_t>{1, 2, 3, 4}, {2, 2});
    short_of.bits = 4;
    EXPECT_TRUE(says(refusal([&] { (void)read_raster(short_of.write("four_bits.tif")); }), "4 bits"));
}

std::string vrt_of(const std::string& sources, const std::string& transform = "500000.5, 0.5, 0, 5200040.25, 0, -0.5") {
    return "<VRTDataset rasterXSize=\"53\" rasterYSize=\"37\"><GeoTransform>" + transform +
           "</GeoTransform><VRTRasterBand dataType=\"Float32\" band=\"1\">" + sources + "</VRTRasterBand></VRTDataset>";
}

std::string vrt_source(const std::string& name, int from, int to, int width, int shown_width) {
    const auto rect = [](const char* kind, int x, int w) {
        return "<" + std::string(kind) + " xOff=\"" + std::to_string(x) + "\" yOff=\"0\" xSize=\"" + std::to_string(w) +
               "\" ySize=\"37\"/>";
    };
    return "<SimpleSource><SourceFilename relativeToVRT=\"1\">" + name + "</SourceFilename><SourceBand>1</SourceBand>" +
           rect("SrcRect", from, width) + rect("DstRect", to, shown_width) + "</SimpleSource>";
}

TEST(Rasters, virtual_rasters_join_their_sources) {
    write_raster(folder() / "west.tif", heights().colRange(0, 30).clone(), grid(), {});
    write_raster(folder() / "east.tif", heights().colRange(20, 53).clone(), grid(), {});
    const fs::path path = folder() / "both.vrt";
    tests::write_file(path, vrt_of(vrt_source("west.tif", 0, 0, 30, 30) + vrt_source("east.tif", 5, 25, 28, 28)));
    const Raster raster = read_raster(path);
    EXPECT_TRUE(same(raster.z, heights()));
    EXPECT_EQ(raster.grid.x0, grid().x0);
    EXPECT_EQ(raster.grid.y0, grid().y0);
    const auto refused = [&](const std::string& text) {
        return refusal([&] { (void)read_raster(tests::write_file(folder() / "bad.vrt", text)); });
    };
    EXPECT_TRUE(says(refused(vrt_of(vrt_source("west.tif", 0, 0, 30, 15))), "1:1"));
    EXPECT_TRUE(says(refused(vrt_of(vrt_source("west.tif", 0, 40, 30, 30))), "outside"));
    EXPECT_TRUE(says(refused(vrt_of(vrt_source("bad.vrt", 0, 0, 30, 30))), "virtual raster, too"));
    EXPECT_TRUE(says(refused(vrt_of(vrt_source("west.tif", 0, 0, 30, 30), "0, 1, 0.5, 0, 0, -1")), "north up"));
    EXPECT_TRUE(says(refused(vrt_of("")), "without sources"));
    EXPECT_TRUE(says(refused("<VRT"), "no XML"));
}

/// GDAL takes a number without data from the band, as it takes a unit of heights; and a mask from beside the file.
TEST(Rasters, what_gdal_says_of_a_band_is_heard) {
    Made file = made(std::vector<float>{5, -9999.9F, 7, 8}, {2, 2});
    file.more = [](TiffOutput& tiff) {
        place(tiff);
        tiff.set(
            tag_metadata,
            std::string(R"(<GDALMetadata><Item name="UNITTYPE" sample="0" role="unittype">ft</Item></GDALMetadata>)"));
    };
    const Raster feet = read_raster(file.write("band.tif"));
    EXPECT_EQ(feet.grid.crs.height_unit_m, 0.3048);
    EXPECT_TRUE(tests::warned(feet.notes, "Heights are in ft"));
    const auto vrt = [&](const std::string& band) {
        return tests::write_file(
            folder() / "band.vrt",
            R"(<VRTDataset rasterXSize="2" rasterYSize="2"><GeoTransform>0,2,0,0,0,-2</GeoTransform><VRTRasterBand band="1">)" +
                band +
                R"(<SimpleSource><SourceFilename relativeToVRT="1">band.tif</SourceFilename><SrcRect xOff="0" yOff="0" xSize="2" ySize="2"/><DstRect xOff="0" yOff="0" xSize="2" ySize="2"/></SimpleSource></VRTRasterBand></VRTDataset>)");
    };
    const Raster whole = read_raster(vrt("<NoDataValue>-9999.9</NoDataValue><UnitType>us-ft</UnitType>"));
    EXPECT_TRUE(std::isnan(whole.z(0, 1)));
    EXPECT_EQ(whole.z(1, 1), 8);
    EXPECT_NEAR(whole.grid.crs.height_unit_m, 1200.0 / 3937, 1e-12);
    EXPECT_TRUE(says(refusal([&] { (void)read_raster(vrt("<Scale>0.01</Scale>")); }), "scale"));
    Made mask = made(std::vector<std::uint8_t>{255, 255, 0, 255}, {2, 2});
    fs::rename(mask.write("mask.tif"), folder() / "band.tif.msk");
    EXPECT_TRUE(std::isnan(read_raster(folder() / "band.tif").z(1, 0)));
    EXPECT_EQ(read_raster(folder() / "band.tif").z(0, 0), 5);
    write_raster(folder() / "large.tif", heights(), grid(), {});
    fs::rename(folder() / "large.tif", folder() / "band.tif.msk");
    EXPECT_TRUE(says(refusal([&] { (void)read_raster(folder() / "band.tif"); }), "expected a mask"));
    fs::remove(folder() / "band.tif.msk");
}

/// GDAL in the same process describes its tags to libtiff, which then hands them out in another way.
TEST(Rasters, tags_are_read_beside_gdal_too) {
    Made file = made(std::vector<float>{5, -9999, 7, 8}, {2, 2});
    file.more = [](TiffOutput& tiff) {
        place(tiff);
        tiff.set(tag_nodata, std::string("-9999"));
        tiff.set(tag_metadata,
                 std::string(R"(<GDALMetadata><Item name="SCALE" sample="0" role="scale">2</Item></GDALMetadata>)"));
    };
    const fs::path path = file.write("beside_gdal.tif");
    static TIFFExtendProc before = nullptr;
    before = TIFFSetTagExtender([](TIFF* tiff) {
        static char name[] = "described";
        static const TIFFFieldInfo rows[] = {{tag_nodata, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, name},
                                             {tag_metadata, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, name},
                                             {tag_key_ascii, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, name},
                                             {tag_scale, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, name},
                                             {tag_keys, -1, -1, TIFF_SHORT, FIELD_CUSTOM, 1, 1, name}};
        TIFFMergeFieldInfo(tiff, rows, std::size(rows));
    });
    const Raster raster = read_raster(path);
    TIFFSetTagExtender(before);
    EXPECT_TRUE(std::isnan(raster.z(0, 1)));
    EXPECT_EQ(raster.z(1, 1) + raster.base, 16);
    EXPECT_EQ(raster.grid.cell, 2);
    EXPECT_EQ(raster.grid.crs.epsg, 32633);
}

/// Larger than a tile, with holes at its end.
const cv::Mat1f& large_heights() {
    static const cv::Mat1f heights = [] {
        cv::Mat1f z(1100, 700);
        cv::RNG(7).fill(z, cv::RNG::UNIFORM, 300, 340);
        z(cv::Rect(690, 1090, 10, 10)) = NAN;
        z(0, 0) = NAN;
        return z;
    }();
    return heights;
}

/// Rows in any portions, each of them once or not at all.
cv::Mat1f read_in_portions(const fs::path& path, int rows) {
    const auto reader = open_raster(path);
    cv::Mat1f z(reader->size);
    for (int row = 0; row < z.rows; row += rows) {
        cv::Mat1f part = z.rowRange(row, std::min(row + rows, z.rows));
        reader->read(row, part);
        if (reader->base != 0)
            part += reader->base;
    }
    return z;
}

TEST(Rasters, rows_in_portions_are_those_of_the_whole) {
    const fs::path tiled = folder() / "tiled.tif", vrt = folder() / "stacked.vrt";
    write_raster(tiled, large_heights(), grid(), {});
    const std::string rects =
        "<SrcRect xOff=\"0\" yOff=\"0\" xSize=\"700\" ySize=\"1100\"/><DstRect xOff=\"0\" yOff=\"";
    const std::string name = "<SimpleSource><SourceFilename relativeToVRT=\"1\">tiled.tif</SourceFilename>";
    const std::string size = "\" xSize=\"700\" ySize=\"1100\"/></SimpleSource>";
    tests::write_file(vrt,
                      "<VRTDataset rasterXSize=\"700\" rasterYSize=\"2200\"><GeoTransform>0,1,0,0,0,-1</GeoTransform>"
                      "<VRTRasterBand band=\"1\">" +
                          name + rects + "0" + size + name + rects + "1100" + size + "</VRTRasterBand></VRTDataset>");
    cv::Mat1f twice;
    cv::vconcat(large_heights(), large_heights(), twice);
    Made strip = made(std::vector<float>(large_heights().begin(), large_heights().end()), large_heights().size());
    Made doubles = made(std::vector<double>(large_heights().begin(), large_heights().end()), large_heights().size());
    strip.more = doubles.more = place; // one strip of 3 MB is read at once, one of 6 MB row by row
    const fs::path strips = strip.write("one_strip.tif"), rows = doubles.write("row_by_row.tif");
    for (const int portion : {1, 77, 512, 5000}) {
        EXPECT_TRUE(same(read_in_portions(tiled, portion), large_heights())) << portion;
        EXPECT_TRUE(same(read_in_portions(vrt, portion), twice)) << portion;
        EXPECT_TRUE(same(read_in_portions(strips, portion), large_heights())) << portion;
        EXPECT_LT(cv::norm(read_in_portions(rows, portion)(cv::Rect(1, 1, 600, 1000)) -
                               large_heights()(cv::Rect(1, 1, 600, 1000)),
                           cv::NORM_INF),
                  1e-4)
            << portion;
    }
}

TEST(Rasters, rows_in_portions_make_the_same_file) {
    write_raster(folder() / "at_once.tif", large_heights(), grid(), {"text", {}});
    const cv::Mat1f& z = large_heights();
    for (const int rows : {1, 100, 512, 600}) {
        RasterWriter writer(folder() / "portions.tif", z.size(), CV_32FC1, grid(), {"text", {}});
        for (int row = 0; row < z.rows; row += rows)
            writer.write(z.rowRange(row, std::min(row + rows, z.rows)));
        writer.finish();
        EXPECT_EQ(tests::file_bytes(folder() / "portions.tif"), tests::file_bytes(folder() / "at_once.tif")) << rows;
    }
}

/// Directories from large to small at the head, tiles from small to large behind them; a cell of an overview is the
/// mean of those that are known.
TEST(Rasters, a_written_raster_is_cloud_optimized) {
    const fs::path path = folder() / "cog.tif";
    write_raster(path, large_heights(), grid(), {});
    TiffInput tiff(path);
    std::vector<std::uint64_t> directories, tiles;
    std::vector<cv::Size> sizes;
    cv::Mat1f first_tile(512, 512);
    do {
        directories.push_back(TIFFCurrentDirOffset(tiff.get()));
        tiles.push_back(TIFFGetStrileOffset(tiff.get(), 0));
        sizes.emplace_back(tiff.number(TIFFTAG_IMAGEWIDTH, 0), tiff.number(TIFFTAG_IMAGELENGTH, 0));
        EXPECT_EQ(tiff.number(TIFFTAG_SUBFILETYPE, 0) & FILETYPE_REDUCEDIMAGE, directories.size() == 1 ? 0U : 1U);
        if (directories.size() == 2) {
            ASSERT_GT(TIFFReadEncodedTile(tiff.get(), 0, first_tile.data, 512 * 512 * 4), 0);
        }
    } while (tiff.next_directory());
    EXPECT_EQ(sizes, (std::vector<cv::Size>{{700, 1100}, {350, 550}, {175, 275}}));
    EXPECT_EQ(directories.front(), 8U);
    EXPECT_TRUE(std::ranges::is_sorted(directories));
    EXPECT_TRUE(std::is_sorted(tiles.rbegin(), tiles.rend()));
    EXPECT_GT(tiles.back(), directories.back());
    const cv::Mat1f& z = large_heights();
    EXPECT_NEAR(first_tile(1, 1), (z(2, 2) + z(2, 3) + z(3, 2) + z(3, 3)) / 4, 1e-4);
    EXPECT_NEAR(first_tile(0, 0), (z(0, 1) + z(1, 0) + z(1, 1)) / 3, 1e-4);
}

TEST(Rasters, big_tiff_holds_the_same) {
    const fs::path path = folder() / "big_cog.tif";
    const cv::Mat1f z(16, 16, 7.0F);
    TiffOutput tile;
    for (const auto& [tag, value] :
         {std::pair(TIFFTAG_IMAGEWIDTH, 16), std::pair(TIFFTAG_IMAGELENGTH, 16), std::pair(TIFFTAG_TILEWIDTH, 16),
          std::pair(TIFFTAG_TILELENGTH, 16), std::pair(TIFFTAG_BITSPERSAMPLE, 32),
          std::pair(TIFFTAG_SAMPLESPERPIXEL, 1), std::pair(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP),
          std::pair(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG), std::pair(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK)})
        tile.set(static_cast<std::uint32_t>(tag), value);
    Spool spool(folder());
    const auto part = spool.add(tile.packed_tile({reinterpret_cast<const char*>(z.data), 16 * 16 * 4}));
    const auto one = [](int id, int value) {
        return short_tag(static_cast<std::uint16_t>(id), {static_cast<std::uint16_t>(value)});
    };
    write_cog(
        path,
        {{{one(TIFFTAG_IMAGEWIDTH, 16), one(TIFFTAG_IMAGELENGTH, 16), one(TIFFTAG_BITSPERSAMPLE, 32),
           one(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK), one(TIFFTAG_SAMPLESPERPIXEL, 1),
           one(TIFFTAG_TILEWIDTH, 16), one(TIFFTAG_TILELENGTH, 16), one(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP)},
          {part}}},
        spool, true);
    EXPECT_EQ(tests::file_bytes(path).substr(2, 1), "\x2b");
    EXPECT_TRUE(same(read_raster(path).z, z));
}

TEST(Rasters, cut_files_are_refused_wherever_they_end) {
    const fs::path whole = folder() / "whole.tif";
    write_raster(whole, heights(), grid(), {"text", {}});
    const std::string bytes = tests::file_bytes(whole);
    for (std::size_t length = 0; length < bytes.size(); length += 97) {
        const fs::path cut = tests::write_file(folder() / "cut.tif", bytes.substr(0, length));
        EXPECT_TRUE(says(refusal([&] { (void)read_raster(cut); }), "cut.tif")) << length;
    }
}

TEST(Rasters, systems_have_the_names_that_files_give) {
    const std::string text = "UTM 33N|WGS 84|";
    const auto crs = [&](std::vector<std::uint16_t> directory) {
        directory.insert(directory.begin(), {1, 1, 0, static_cast<std::uint16_t>(directory.size() / 4)});
        return crs_of_keys({std::move(directory), {}, text});
    };
    const Crs projected = crs({1024, 0, 1, 1, 1026, 34737, 7, 8, 3072, 0, 1, 32633, 3073, 34737, 8, 0});
    EXPECT_EQ(projected.name, "UTM 33N");
    EXPECT_EQ(projected.epsg, 32633);
    const Crs geographic = crs({1024, 0, 1, 2, 1026, 34737, 7, 8, 2048, 0, 1, 4326});
    EXPECT_EQ(geographic.name, "WGS 84");
    EXPECT_EQ(geographic.epsg, 4326);
    EXPECT_EQ(crs({1024, 0, 1, 1, 3072, 0, 1, 32633}).name, "");
    EXPECT_EQ(crs_of_text(R"(GEOGCS["WGS 84",UNIT["degree",0.0174],AUTHORITY["EPSG","4326"]])").name, "WGS 84");
}

TEST(Rasters, keys_that_are_not_counted_or_name_nothing_are_none) {
    // 3073 is beyond the count and beyond the text; 1026 begins where the text ends, with no letter.
    const Crs crs = crs_of_keys({{1, 1, 0, 2, 1024, 0, 1, 1, 1026, 34737, 0, 5, 3073, 34737, 8, 60000}, {}, "UTM|"});
    EXPECT_EQ(crs.name, "");
    // A unit of its own size, which begins where the doubles end.
    EXPECT_THROW((void)crs_of_keys({{1, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, 32767, 3077, 34736, 0, 1}, {2.0}, ""}),
                 Error);
}

TEST(Rasters, units_follow_keys_codes_and_texts) {
    EXPECT_EQ(crs_of_keys(utm_33()).unit_m, 1);
    const auto of_code = [](int code) { return crs_of_keys(with_value(with_value({}, 1024, 1), 3072, code)); };
    EXPECT_NEAR(of_code(2264).unit_m, 1200.0 / 3937, 1e-12); // North Carolina, US survey feet
    EXPECT_EQ(of_code(2222).unit_m, 0.3048);                 // Arizona, feet
    EXPECT_EQ(of_code(25832).unit_m, 1);
    const Crs mixed = crs_of_keys(with_value(with_value(with_value({}, 1024, 1), 3072, 2264), 4096, 5703));
    EXPECT_EQ(mixed.height_unit_m, 1); // NAVD88 height in metres
    EXPECT_NEAR(crs_of_keys(with_value(with_value(with_value({}, 1024, 1), 3072, 32633), 4096, 6360)).height_unit_m,
                1200.0 / 3937, 1e-12);
    const Crs compound = crs_of_text(
        R"(COMPD_CS["a + b",PROJCS["a",GEOGCS["g",UNIT["degree",0.0174],AUTHORITY["EPSG","4258"]],UNIT["metre",1,AUTHORITY["EPSG","9001"]],AUTHORITY["EPSG","25832"]],VERT_CS["b",VERT_DATUM["d",2005],UNIT["US survey foot",0.304800609601219],AUTHORITY["EPSG","6360"]]])");
    EXPECT_EQ(compound.epsg, 25832);
    EXPECT_EQ(compound.name, "a");
    EXPECT_EQ(compound.unit_m, 1);
    EXPECT_NEAR(compound.height_unit_m, 0.3048006, 1e-7);
    EXPECT_EQ(value_of(compound.keys, 3072, 0), 25832);
    EXPECT_EQ(value_of(compound.keys, 4096, 0), 6360);
    EXPECT_EQ(compound.text, "");
    const Crs second = crs_of_text(
        R"(PROJCRS["a",BASEGEOGCRS["g",ID["EPSG",4269]],CS[Cartesian,2],AXIS["e",east],AXIS["n",north],LENGTHUNIT["US survey foot",0.304800609601219],ID["EPSG",2264]])");
    EXPECT_EQ(second.epsg, 2264);
    EXPECT_NEAR(second.unit_m, 0.3048006, 1e-7);
    EXPECT_TRUE(crs_of_text(R"(GEOGCS["WGS 84",UNIT["degree",0.0174],AUTHORITY["EPSG","4326"]])").geographic);
    EXPECT_TRUE(says(refusal([] { (void)crs_of_text("PROJCS[\"a\",UNIT["); }), "byte"));
}

} // namespace
} // namespace scanshade::rasters
