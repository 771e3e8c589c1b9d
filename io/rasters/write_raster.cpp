// Values -> GeoTIFF.
#include "io/output_file.h"
#include "io/rasters/raster.h"
#include "io/rasters/tiff.h"

#include <algorithm>
#include <fmt/format.h>
#include <pugixml.hpp>
#include <sstream>

namespace scanshade::rasters {

namespace {

namespace fs = std::filesystem;

std::string xml_of(const pugi::xml_document& document) {
    std::ostringstream text;
    document.save(text, "  ", pugi::format_default | pugi::format_no_declaration);
    return text.str();
}

std::string metadata_of(const RasterText& text) {
    pugi::xml_document document;
    pugi::xml_node top = document.append_child("GDALMetadata");
    for (const auto& [name, value] : text.items) {
        pugi::xml_node item = top.append_child("Item");
        item.append_attribute("name").set_value(name.c_str());
        item.text().set(value.c_str());
    }
    return xml_of(document);
}

void set_place(TiffOutput& tiff, const Grid& grid) {
    tiff.set(tag_scale, std::vector{grid.cell, grid.cell, 0.0});
    tiff.set(tag_tiepoints, std::vector{0.0, 0.0, 0.0, grid.x0, grid.y0, 0.0});
    const GeoKeys& keys = grid.crs.keys;
    constexpr int raster_type = 1025, area = 1;
    tiff.set(tag_keys, keys.directory.empty() ? with_value({}, raster_type, area).directory : keys.directory);
    if (!keys.doubles.empty())
        tiff.set(tag_key_doubles, keys.doubles);
    if (!keys.ascii.empty())
        tiff.set(tag_key_ascii, keys.ascii);
}

void write(const fs::path& file, const cv::Mat& values, const Grid& grid, const RasterText& text) {
    constexpr std::uint64_t most_plain = std::uint64_t(1) << 31;
    const bool floats = values.depth() == CV_32F;
    const std::size_t row_bytes = values.elemSize() * static_cast<std::size_t>(values.cols);
    TiffOutput tiff(file, std::uint64_t(row_bytes) * static_cast<std::uint64_t>(values.rows) >= most_plain);
    constexpr std::size_t strip_bytes = 1 << 16;
    const int rows = std::clamp(static_cast<int>(strip_bytes / row_bytes), 1, values.rows);
    tiff.set(TIFFTAG_IMAGEWIDTH, values.cols);
    tiff.set(TIFFTAG_IMAGELENGTH, values.rows);
    tiff.set(TIFFTAG_BITSPERSAMPLE, static_cast<int>(values.elemSize1()) * 8);
    tiff.set(TIFFTAG_SAMPLEFORMAT, floats ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
    tiff.set(TIFFTAG_SAMPLESPERPIXEL, 1);
    tiff.set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    tiff.set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    tiff.set(TIFFTAG_COMPRESSION, COMPRESSION_LZW);
    tiff.set(TIFFTAG_PREDICTOR, floats ? PREDICTOR_FLOATINGPOINT : PREDICTOR_HORIZONTAL);
    tiff.set(TIFFTAG_ROWSPERSTRIP, rows);
    if (!text.description.empty())
        tiff.set(TIFFTAG_IMAGEDESCRIPTION, text.description);
    set_place(tiff, grid);
    if (!text.items.empty())
        tiff.set(tag_metadata, metadata_of(text));
    if (floats)
        tiff.set(tag_nodata, std::string("nan"));
    std::uint32_t strip = 0;
    for (int row = 0; row < values.rows; row += rows, ++strip) {
        const cv::Mat part = values.rowRange(row, std::min(row + rows, values.rows)).clone();
        tiff.write_strip(strip, {part.ptr<char>(), part.total() * part.elemSize()});
    }
    tiff.close();
}

} // namespace

void write_raster(const fs::path& file, const cv::Mat& values, const Grid& grid, const RasterText& text) {
    CV_Assert(values.type() == CV_32FC1 || values.type() == CV_8UC1);
    if (!grid.crs.text.empty()) {
        pugi::xml_document document;
        document.append_child("PAMDataset").append_child("SRS").text().set(grid.crs.text.c_str());
        write_atomically(file.string() + ".aux.xml", xml_of(document));
    }
    write_atomically(file, [&](const fs::path& temporary) { write(temporary, values, grid, text); });
}

} // namespace scanshade::rasters
