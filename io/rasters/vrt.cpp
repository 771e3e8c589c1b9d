// GDAL's virtual rasters: a text that puts parts of other rasters side by side. Sources at the scale 1:1 only.
#include "io/rasters/vrt.h"

#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <pugixml.hpp>
#include <sstream>

namespace scanshade::rasters {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& file, const std::string& why) { throw Error(file.string() + ": " + why); }

/// A rectangle of whole cells.
cv::Rect rect_of(const pugi::xml_node& node, const fs::path& file) {
    cv::Rect rect;
    for (const auto& [name, to] : {std::pair("xOff", &rect.x), std::pair("yOff", &rect.y),
                                   std::pair("xSize", &rect.width), std::pair("ySize", &rect.height)}) {
        const auto value = number(node.attribute(name).value());
        if (!value || *value != std::floor(*value) || *value < 0 || *value > 0x7fffffff)
            refuse(file, fmt::format("{} {} of a source is {}, expected whole cells", node.name(), name,
                                     in_quotes(node.attribute(name).value())));
        *to = static_cast<int>(*value);
    }
    return rect;
}

struct Source {
    fs::path file;
    int band = 0;
    cv::Rect from, to;
    std::vector<double> nodata; ///< of ComplexSource, and of the band
};

Source source_of(const pugi::xml_node& node, const fs::path& file) {
    Source source;
    const pugi::xml_node name = node.child("SourceFilename");
    source.file = name.text().get();
    if (source.file.empty())
        refuse(file, fmt::format("a {} without SourceFilename", node.name()));
    if (name.attribute("relativeToVRT").as_int() == 1)
        source.file = file.parent_path() / source.file;
    source.band = node.child("SourceBand").text().as_int(1);
    source.from = rect_of(node.child("SrcRect"), file), source.to = rect_of(node.child("DstRect"), file);
    if (source.from.size() != source.to.size())
        refuse(file,
               fmt::format(
                   "source {} is scaled from {}x{} to {}x{} cells, expected 1:1; `gdal_translate` makes one raster",
                   source.file.string(), source.from.width, source.from.height, source.to.width, source.to.height));
    for (const char* element : {"ScaleRatio", "ScaleOffset", "LUT", "ColorTableComponent", "Exponent"})
        if (node.child(element))
            refuse(file, fmt::format("source {} is changed by {}, which is not read", source.file.string(), element));
    for (const pugi::xml_node& nodata : {node.child("NODATA"), node.parent().child("NoDataValue")})
        if (const auto value = number(trimmed(nodata.text().get())))
            source.nodata.push_back(*value);
    return source;
}

/// Well-known text, or a code such as EPSG:32633.
Crs crs_of_srs(const std::string& srs) {
    const auto code = srs.starts_with("EPSG:") ? number(std::string_view(srs).substr(5)) : std::nullopt;
    if (!code)
        return crs_of_text(srs);
    constexpr int first_geographic = 4000, last_geographic = 4999; // of EPSG's codes
    const bool geographic = *code >= first_geographic && *code <= last_geographic;
    GeoKeys keys = with_value({}, 1024, geographic ? 2 : 1);
    keys = with_value(std::move(keys), 1025, 1);
    return crs_of_keys(with_value(std::move(keys), geographic ? 2048 : 3072, static_cast<int>(*code)));
}

Grid grid_of(const pugi::xml_node& top, const fs::path& file, std::vector<std::string>& notes) {
    Grid grid;
    std::string text = top.child("GeoTransform").text().get();
    std::ranges::replace(text, ',', ' ');
    std::vector<double> v;
    for (const std::string_view word : words(text))
        v.push_back(number(word).value_or(NAN));
    constexpr double slack = 1e-6;
    if (v.size() != 6 || !(v[1] > 0) || v[2] != 0 || v[4] != 0 || !(std::abs(v[1] + v[5]) <= slack * v[1]) ||
        !std::isfinite(v[0] + v[3]))
        refuse(file, fmt::format("its GeoTransform is {}, expected square cells with north up", in_quotes(text)));
    grid.x0 = v[0], grid.cell = v[1], grid.y0 = v[3];
    if (const std::string srs = top.child("SRS").text().get(); !srs.empty())
        grid.crs = during(file.string(), [&] { return crs_of_srs(srs); });
    if (grid.crs.geographic)
        refuse(file, "coordinates are degrees, in which slopes mean nothing; project it first, such as by `gdalwarp "
                     "-t_srs EPSG:CODE`");
    if (!grid.crs.known)
        notes.push_back("The file names no coordinate system: metres are assumed.");
    notes.insert(notes.end(), grid.crs.notes.begin(), grid.crs.notes.end());
    return grid;
}

/// Numbers of text are compared in the precision of the heights, too.
auto is_same_as(double height) {
    return [height](double nodata) {
        return height == nodata || height == static_cast<double>(static_cast<float>(nodata));
    };
}

/// A part of each source at a time; those whose rows are passed are closed.
class VrtReader final : public RasterReader {
  public:
    /// `changed`: the band says that heights are numbers times a scale.
    VrtReader(fs::path file, cv::Size whole, Grid place, std::vector<std::string> said, std::vector<Source> sources,
              bool changed)
        : file_(std::move(file)), sources_(std::move(sources)), open_(sources_.size()) {
        size = whole, grid = std::move(place), notes = std::move(said);
        for (std::size_t i = 0; i < sources_.size(); ++i) {
            const std::unique_ptr<RasterReader> part = opened(sources_[i]);
            if (i == 0)
                base = part->base;
            step = std::max(step, part->step);
            if (changed && !part->scaled)
                refuse(file_, fmt::format("its band has a scale that source {} does not have, which is not read; "
                                          "`gdal_translate -unscale` makes a raster of heights",
                                          sources_[i].file.string()));
        }
    }

    /// Where a source has heights, they replace what is there.
    void read(int first, cv::Mat1f& z) override {
        z.setTo(std::nanf(""));
        for (std::size_t i = 0; i < sources_.size(); ++i) {
            const Source& source = sources_[i];
            const int begin = std::max(first, source.to.y), end = std::min(first + z.rows, source.to.br().y);
            if (begin < end && !open_[i])
                open_[i] = opened(source);
            for (int row = begin; row < end;) {
                constexpr int rows_at_once = 256;
                cv::Mat1f part(std::min(rows_at_once, end - row), open_[i]->size.width);
                during(file_.string(), [&] { open_[i]->read(row - source.to.y + source.from.y, part); });
                put(source, open_[i]->base, part, row - first, z);
                row += part.rows;
            }
            if (source.to.br().y <= first + z.rows)
                open_[i].reset();
        }
    }

  private:
    [[nodiscard]] std::unique_ptr<RasterReader> opened(const Source& source) const {
        if (is_vrt(source.file))
            refuse(file_, fmt::format("source {} is a virtual raster, too, expected a TIFF", source.file.string()));
        std::unique_ptr<RasterReader> part =
            during(file_.string(), [&] { return open_raster(source.file, source.band); });
        if ((source.from & cv::Rect(cv::Point(), part->size)) != source.from ||
            (source.to & cv::Rect(cv::Point(), size)) != source.to)
            refuse(file_, fmt::format("source {} has {}x{} cells, and a part of it is outside or would lie outside",
                                      source.file.string(), part->size.width, part->size.height));
        return part;
    }

    /// Rows of a source, to row `to` of z.
    void put(const Source& source, double source_base, const cv::Mat1f& part, int to, cv::Mat1f& z) const {
        for (int r = 0; r < part.rows; ++r)
            for (int c = 0; c < source.from.width; ++c) {
                const double height = double(part(r, source.from.x + c)) + source_base;
                if (!std::isnan(height) && std::ranges::none_of(source.nodata, is_same_as(height)))
                    z(to + r, source.to.x + c) = static_cast<float>(height - base);
            }
    }

    fs::path file_;
    std::vector<Source> sources_;
    std::vector<std::unique_ptr<RasterReader>> open_; ///< null: not now
};

} // namespace

bool is_vrt(const fs::path& file) { return lower_extension(file) == ".vrt"; }

std::unique_ptr<RasterReader> open_vrt(const fs::path& file, int band) {
    constexpr std::size_t most = 1 << 26;
    const std::string text = read_at_most(most, file, "a virtual raster");
    pugi::xml_document document;
    if (!document.load_buffer(text.data(), text.size()))
        refuse(file, "is no XML");
    const pugi::xml_node top = document.child("VRTDataset");
    constexpr int most_cells = 1 << 30; // of a side
    const int width = top.attribute("rasterXSize").as_int(), height = top.attribute("rasterYSize").as_int();
    if (width < 1 || height < 1 || width > most_cells || height > most_cells)
        refuse(file, fmt::format("rasterXSize {} and rasterYSize {}, expected 1 to {}",
                                 in_quotes(top.attribute("rasterXSize").value()),
                                 in_quotes(top.attribute("rasterYSize").value()), most_cells));
    const auto bands = top.children("VRTRasterBand");
    const auto count = std::distance(bands.begin(), bands.end());
    if (band == 0 && count > 1)
        refuse(file, fmt::format("{} bands: --band NUMBER says which has the heights", count));
    if (count == 0 || band > count)
        refuse(file, fmt::format("band {} of {}", std::max(band, 1), count));
    const pugi::xml_node chosen = *std::next(bands.begin(), std::max(band, 1) - 1);
    std::vector<std::string> notes;
    Grid grid = grid_of(top, file, notes);
    take_height_unit(grid.crs, std::string(trimmed(chosen.child("UnitType").text().get())), notes);
    const bool changed =
        chosen.child("Scale").text().as_double(1) != 1 || chosen.child("Offset").text().as_double(0) != 0;
    std::vector<Source> sources;
    for (const pugi::xml_node& node : chosen.children()) {
        const std::string_view kind = node.name();
        if (!kind.ends_with("Source"))
            continue;
        if (kind != "SimpleSource" && kind != "ComplexSource")
            refuse(file, fmt::format("a source of kind {}, which is not read", kind));
        sources.push_back(source_of(node, file));
    }
    if (sources.empty())
        refuse(file, "a virtual raster without sources");
    return std::make_unique<VrtReader>(file, cv::Size(width, height), std::move(grid), std::move(notes),
                                       std::move(sources), changed);
}

bool share_a_grid(const std::vector<VrtTile>& tiles) {
    constexpr double least = 1e-3; // cells
    return std::ranges::all_of(tiles, [&](const VrtTile& tile) {
        const Grid &one = tiles.front().grid, &other = tile.grid;
        const auto whole = [&](double distance) {
            return std::abs(distance / one.cell - std::nearbyint(distance / one.cell)) < least;
        };
        return one.crs.epsg == other.crs.epsg && one.crs.text == other.crs.text && one.crs.unit_m == other.crs.unit_m &&
               std::abs(one.cell - other.cell) < 1e-9 * one.cell && whole(other.x0 - one.x0) &&
               whole(other.y0 - one.y0);
    });
}

void write_vrt(const fs::path& file, const std::vector<VrtTile>& tiles, int type) {
    const Grid& grid = tiles.front().grid;
    double west = grid.x0, north = grid.y0;
    for (const VrtTile& tile : tiles)
        west = std::min(west, tile.grid.x0), north = std::max(north, tile.grid.y0);
    const auto place_of = [&](const VrtTile& tile) {
        return cv::Rect(cv::Point(static_cast<int>(std::lround((tile.grid.x0 - west) / grid.cell)),
                                  static_cast<int>(std::lround((north - tile.grid.y0) / grid.cell))),
                        tile.size);
    };
    cv::Rect all(0, 0, 1, 1);
    for (const VrtTile& tile : tiles)
        all |= place_of(tile);
    pugi::xml_document document;
    pugi::xml_node top = document.append_child("VRTDataset");
    top.append_attribute("rasterXSize").set_value(all.width);
    top.append_attribute("rasterYSize").set_value(all.height);
    if (const std::string& text = grid.crs.text; grid.crs.epsg > 0 || !text.empty())
        top.append_child("SRS").text().set((text.empty() ? fmt::format("EPSG:{}", grid.crs.epsg) : text).c_str());
    top.append_child("GeoTransform")
        .text()
        .set(fmt::format("{:.17g}, {:.17g}, 0, {:.17g}, 0, {:.17g}", west, grid.cell, north, -grid.cell).c_str());
    pugi::xml_node band = top.append_child("VRTRasterBand");
    band.append_attribute("dataType").set_value(type == CV_32FC1 ? "Float32" : "Byte");
    band.append_attribute("band").set_value(1);
    if (type == CV_32FC1)
        band.append_child("NoDataValue").text().set("nan");
    const auto add_rectangle = [](pugi::xml_node to, const char* name, const cv::Rect& at) {
        pugi::xml_node node = to.append_child(name);
        node.append_attribute("xOff").set_value(at.x), node.append_attribute("yOff").set_value(at.y);
        node.append_attribute("xSize").set_value(at.width), node.append_attribute("ySize").set_value(at.height);
    };
    for (const VrtTile& tile : tiles) {
        pugi::xml_node source = band.append_child(type == CV_32FC1 ? "ComplexSource" : "SimpleSource");
        pugi::xml_node name = source.append_child("SourceFilename");
        name.append_attribute("relativeToVRT").set_value(1);
        name.text().set(fs::absolute(tile.file).lexically_relative(fs::absolute(file).parent_path()).c_str());
        source.append_child("SourceBand").text().set(1);
        add_rectangle(source, "SrcRect", cv::Rect(cv::Point(), tile.size));
        add_rectangle(source, "DstRect", place_of(tile));
        if (type == CV_32FC1)
            source.append_child("NODATA").text().set("nan");
    }
    std::ostringstream text;
    document.save(text, "  ", pugi::format_default | pugi::format_no_declaration);
    write_atomically(file, text.str());
}

} // namespace scanshade::rasters
