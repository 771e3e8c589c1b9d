// Values -> GeoTIFF.
#include "io/output_file.h"
#include "io/rasters/cog.h"
#include "io/rasters/raster.h"
#include "io/rasters/tiff.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <pugixml.hpp>
#include <sstream>
#include <system_error>
#include <tbb/parallel_for.h>
#include <type_traits>

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

/// Tags of the full image that say where it lies and what it holds.
void add_place(std::vector<TiffTag>& tags, const Grid& grid) {
    tags.push_back(double_tag(tag_scale, {grid.cell, grid.cell, 0}));
    tags.push_back(double_tag(tag_tiepoints, {0, 0, 0, grid.x0, grid.y0, 0}));
    const GeoKeys& keys = grid.crs.keys;
    if (!keys.directory.empty()) // GDAL makes a system without a name of keys that name none
        tags.push_back(short_tag(tag_keys, keys.directory));
    if (!keys.doubles.empty())
        tags.push_back(double_tag(tag_key_doubles, keys.doubles));
    if (!keys.ascii.empty())
        tags.push_back(text_tag(tag_key_ascii, keys.ascii));
}

/// In order. `grid`: null for an overview.
std::vector<TiffTag> tags_of(cv::Size size, cv::Size tile, int type, const Grid* grid, const RasterText& text) {
    const bool floats = type == CV_32FC1;
    const auto number = [](int value) { return static_cast<std::uint32_t>(value); };
    const auto one = [](std::uint16_t id, int value) { return short_tag(id, {static_cast<std::uint16_t>(value)}); };
    std::vector<TiffTag> tags{long_tag(TIFFTAG_SUBFILETYPE, grid ? 0 : FILETYPE_REDUCEDIMAGE),
                              long_tag(TIFFTAG_IMAGEWIDTH, number(size.width)),
                              long_tag(TIFFTAG_IMAGELENGTH, number(size.height)),
                              one(TIFFTAG_BITSPERSAMPLE, floats ? 32 : 8),
                              one(TIFFTAG_COMPRESSION, COMPRESSION_LZW),
                              one(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK),
                              one(TIFFTAG_SAMPLESPERPIXEL, 1),
                              one(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG),
                              one(TIFFTAG_PREDICTOR, floats ? PREDICTOR_FLOATINGPOINT : PREDICTOR_HORIZONTAL),
                              long_tag(TIFFTAG_TILEWIDTH, number(tile.width)),
                              long_tag(TIFFTAG_TILELENGTH, number(tile.height)),
                              one(TIFFTAG_SAMPLEFORMAT, floats ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT)};
    if (grid)
        add_place(tags, *grid);
    if (grid && !text.description.empty())
        tags.push_back(text_tag(TIFFTAG_IMAGEDESCRIPTION, text.description));
    if (grid && !text.items.empty())
        tags.push_back(text_tag(tag_metadata, metadata_of(text)));
    if (floats)
        tags.push_back(text_tag(tag_nodata, "nan"));
    std::ranges::sort(tags, {}, &TiffTag::id);
    return tags;
}

/// A tile as it lies in a file: compressed. Beyond the raster is nothing.
std::string packed(const cv::Mat& part, cv::Size size) {
    const bool floats = part.depth() == CV_32F;
    cv::Mat tile(size, part.type(), floats ? cv::Scalar(std::nan("")) : cv::Scalar(0));
    part.copyTo(tile(cv::Rect(cv::Point(), part.size())));
    TiffOutput tiff;
    tiff.set(TIFFTAG_IMAGEWIDTH, size.width);
    tiff.set(TIFFTAG_IMAGELENGTH, size.height);
    tiff.set(TIFFTAG_TILEWIDTH, size.width);
    tiff.set(TIFFTAG_TILELENGTH, size.height);
    tiff.set(TIFFTAG_BITSPERSAMPLE, floats ? 32 : 8);
    tiff.set(TIFFTAG_SAMPLEFORMAT, floats ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
    tiff.set(TIFFTAG_SAMPLESPERPIXEL, 1);
    tiff.set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    tiff.set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    tiff.set(TIFFTAG_COMPRESSION, COMPRESSION_LZW);
    tiff.set(TIFFTAG_PREDICTOR, floats ? PREDICTOR_FLOATINGPOINT : PREDICTOR_HORIZONTAL);
    return tiff.packed_tile({tile.ptr<char>(), tile.total() * tile.elemSize()});
}

/// The mean of the known among four, or the first of them.
template <class Value>
void halve(const cv::Mat_<Value>& rows, Overviews overviews, cv::Mat_<Value>& half) {
    tbb::parallel_for(0, half.rows, [&](int r) {
        for (int c = 0; c < half.cols; ++c) {
            float sum = 0, count = 0;
            for (int y = 2 * r; y < std::min(2 * r + 2, rows.rows); ++y)
                for (int x = 2 * c; x < std::min(2 * c + 2, rows.cols); ++x)
                    if (const auto value = static_cast<float>(rows(y, x)); !std::isnan(value))
                        sum += value, ++count;
            const float mean = count > 0 ? sum / count : std::nanf("");
            if (overviews == Overviews::nearest)
                half(r, c) = rows(2 * r, 2 * c);
            else if constexpr (std::is_integral_v<Value>)
                half(r, c) = static_cast<Value>(std::lround(mean));
            else
                half(r, c) = mean;
        }
    });
}

cv::Mat halved(const cv::Mat& rows, Overviews overviews) {
    cv::Mat half((rows.rows + 1) / 2, (rows.cols + 1) / 2, rows.type());
    if (rows.depth() == CV_32F) {
        cv::Mat1f to = half;
        halve<float>(rows, overviews, to);
    } else {
        cv::Mat1b to = half;
        halve<std::uint8_t>(rows, overviews, to);
    }
    return half;
}

/// The full image, or an overview.
struct Level {
    cv::Size size;
    int written = 0;   ///< rows that lie in the spool
    cv::Mat waiting{}; ///< a row of tiles that is not full
    int waiting_rows = 0;
    CogImage image{};
};

} // namespace

struct RasterWriter::Parts {
    fs::path file;
    int type;
    Overviews overviews;
    std::string crs_text;
    cv::Size tile;
    std::vector<Level> levels{};
    std::optional<Spool> spool{};

    /// Rows go into the file by rows of tiles, and those, half as large, into the next level.
    void add(std::size_t index, const cv::Mat& rows) {
        Level& level = levels[index];
        for (int row = 0; row < rows.rows;) {
            const int due = std::min(tile.height, level.size.height - level.written); // of this row of tiles
            const int count = std::min(due - level.waiting_rows, rows.rows - row);
            const cv::Mat part = rows.rowRange(row, row + count);
            row += count;
            if (count == due) {
                add_tiles(index, part);
                continue;
            }
            level.waiting.create(tile.height, level.size.width, type);
            part.copyTo(level.waiting.rowRange(level.waiting_rows, level.waiting_rows + count));
            level.waiting_rows += count;
            if (level.waiting_rows == due) {
                level.waiting_rows = 0;
                add_tiles(index, level.waiting.rowRange(0, due));
            }
        }
    }

    void add_tiles(std::size_t index, const cv::Mat& rows) {
        Level& level = levels[index];
        std::vector<std::string> tiles(static_cast<std::size_t>((rows.cols + tile.width - 1) / tile.width));
        tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
            const int from = static_cast<int>(i) * tile.width, to = std::min(from + tile.width, rows.cols);
            tiles[i] = packed(rows.colRange(from, to), tile);
        });
        for (const std::string& each : tiles)
            level.image.tiles.push_back(spool->add(each));
        level.written += rows.rows;
        if (index + 1 < levels.size())
            add(index + 1, halved(rows, overviews));
    }
};

RasterWriter::RasterWriter(fs::path file, cv::Size size, int type, const Grid& grid, const RasterText& text,
                           Overviews overviews)
    : parts_(new Parts{std::move(file), type, overviews, grid.crs.text, {}}) {
    CV_Assert(type == CV_32FC1 || type == CV_8UC1);
    constexpr int most = 512, multiple = 16; // the specification of TIFF has multiples of 16
    const auto side = [&](int length) { return std::min((length + multiple - 1) / multiple * multiple, most); };
    parts_->tile = {side(size.width), side(size.height)};
    for (bool full = true;; full = false, size = {(size.width + 1) / 2, (size.height + 1) / 2}) {
        parts_->levels.push_back({.size = size});
        parts_->levels.back().image.tags = tags_of(size, parts_->tile, type, full ? &grid : nullptr, text);
        if (size.width <= parts_->tile.width && size.height <= parts_->tile.height)
            break;
    }
}

RasterWriter::RasterWriter(RasterWriter&&) noexcept = default;
RasterWriter::~RasterWriter() = default;

void RasterWriter::write(const cv::Mat& rows) {
    Parts& parts = *parts_;
    const Level& full = parts.levels.front();
    CV_Assert(rows.type() == parts.type && rows.cols == full.size.width &&
              full.written + full.waiting_rows + rows.rows <= full.size.height);
    try {
        if (!parts.spool) {
            const fs::path folder = parts.file.has_parent_path() ? parts.file.parent_path() : fs::path(".");
            fs::create_directories(folder);
            parts.spool.emplace(folder);
        }
        parts.add(0, rows);
    } catch (const std::system_error& failure) {
        throw Outage(fmt::format("{}: not written: {}", parts.file.string(), failure.what()));
    }
}

void RasterWriter::finish() {
    Parts& parts = *parts_;
    const Level& full = parts.levels.front();
    CV_Assert(full.written == full.size.height);
    if (!parts.crs_text.empty()) {
        pugi::xml_document document;
        document.append_child("PAMDataset").append_child("SRS").text().set(parts.crs_text.c_str());
        write_atomically(parts.file.string() + ".aux.xml", xml_of(document));
    }
    constexpr std::uint64_t most_plain = std::uint64_t(1) << 31;
    const std::uint64_t bytes = std::uint64_t(full.size.width) * std::uint64_t(full.size.height) *
                                static_cast<std::uint64_t>(CV_ELEM_SIZE(parts.type));
    std::vector<CogImage> images;
    for (Level& level : parts.levels)
        images.push_back(std::move(level.image));
    write_atomically(parts.file, [&](const fs::path& temporary) {
        write_cog(temporary, std::move(images), *parts.spool, bytes >= most_plain);
    });
    parts.spool.reset();
}

void write_raster(const fs::path& file, const cv::Mat& values, const Grid& grid, const RasterText& text) {
    RasterWriter writer(file, values.size(), values.type(), grid, text);
    writer.write(values);
    writer.finish();
}

} // namespace scanshade::rasters
