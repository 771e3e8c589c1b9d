// GDAL's virtual rasters: a text that puts parts of other rasters side by side. Sources at the scale 1:1 only.
#include "io/rasters/vrt.h"

#include "io/images/image_check.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <pugixml.hpp>

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
    std::optional<double> nodata; ///< of ComplexSource
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
    if (node.child("NODATA"))
        source.nodata = number(trimmed(node.child("NODATA").text().get()));
    return source;
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
        grid.crs = during(file.string(), [&] { return crs_of_text(srs); });
    if (grid.crs.geographic)
        refuse(file, "coordinates are degrees, in which slopes mean nothing; project it first, such as by `gdalwarp "
                     "-t_srs EPSG:CODE`");
    if (!grid.crs.known)
        notes.push_back("The file names no coordinate system: metres are assumed.");
    notes.insert(notes.end(), grid.crs.notes.begin(), grid.crs.notes.end());
    return grid;
}

/// Where the source has heights, they replace what is there.
void put(const Source& source, const fs::path& file, Raster& raster, bool first) {
    if (is_vrt(source.file))
        refuse(file, fmt::format("source {} is a virtual raster, too, expected a TIFF", source.file.string()));
    const Raster part = during(file.string(), [&] { return read_raster(source.file, source.band); });
    const cv::Rect whole(cv::Point(), part.z.size());
    if ((source.from & whole) != source.from || (source.to & cv::Rect(cv::Point(), raster.z.size())) != source.to)
        refuse(file, fmt::format("source {} has {}x{} cells, and a part of it is outside or would lie outside",
                                 source.file.string(), part.z.cols, part.z.rows));
    if (first)
        raster.base = part.base;
    for (int r = 0; r < source.from.height; ++r)
        for (int c = 0; c < source.from.width; ++c) {
            const double height = double(part.z(source.from.y + r, source.from.x + c)) + part.base;
            if (!std::isnan(height) && height != source.nodata)
                raster.z(source.to.y + r, source.to.x + c) = static_cast<float>(height - raster.base);
        }
}

} // namespace

bool is_vrt(const fs::path& file) { return lower_extension(file) == ".vrt"; }

Raster read_vrt(const fs::path& file, int band) {
    constexpr std::size_t most = 1 << 26;
    const std::string text = read_at_most(most, file, "a virtual raster");
    pugi::xml_document document;
    if (!document.load_buffer(text.data(), text.size()))
        refuse(file, "is no XML");
    const pugi::xml_node top = document.child("VRTDataset");
    Raster raster;
    const cv::Size size = image_check::checked_size(top.attribute("rasterXSize").as_ullong(),
                                                    top.attribute("rasterYSize").as_ullong(), file);
    const auto bands = top.children("VRTRasterBand");
    const auto count = std::distance(bands.begin(), bands.end());
    if (band == 0 && count > 1)
        refuse(file, fmt::format("{} bands: --band NUMBER says which has the heights", count));
    if (count == 0 || band > count)
        refuse(file, fmt::format("band {} of {}", std::max(band, 1), count));
    const pugi::xml_node chosen = *std::next(bands.begin(), std::max(band, 1) - 1);
    raster.grid = grid_of(top, file, raster.notes);
    require_memory(static_cast<std::uint64_t>(size.area()) * sizeof(float), file.string());
    raster.z = cv::Mat1f(size, std::nanf(""));
    bool first = true;
    for (const pugi::xml_node& node : chosen.children()) {
        const std::string_view kind = node.name();
        if (!kind.ends_with("Source"))
            continue;
        if (kind != "SimpleSource" && kind != "ComplexSource")
            refuse(file, fmt::format("a source of kind {}, which is not read", kind));
        put(source_of(node, file), file, raster, first);
        first = false;
    }
    if (first)
        refuse(file, "a virtual raster without sources");
    return raster;
}

} // namespace scanshade::rasters
