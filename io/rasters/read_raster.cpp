// GeoTIFF -> heights, in their place on the map.
#include "io/rasters/raster.h"

#include "io/files.h"
#include "io/images/image_check.h"
#include "io/rasters/tiff.h"
#include "io/rasters/vrt.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <optional>
#include <pugixml.hpp>

namespace scanshade::rasters {

namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t reduced = FILETYPE_REDUCEDIMAGE, mask = FILETYPE_MASK;

// --- place on the map ---

/// x = x0 + xc column + xr row, y = y0 + yc column + yr row; of the corner of a cell.
struct Affine {
    double x0 = 0, xc = 1, xr = 0, y0 = 0, yc = 0, yr = -1;
};

std::optional<Affine> affine_of_tags(const TiffInput& tiff) {
    const std::vector<double> m = tiff.doubles(tag_transformation), scale = tiff.doubles(tag_scale),
                              tie = tiff.doubles(tag_tiepoints);
    if (scale.size() >= 2 && tie.size() >= 6)
        return Affine{tie[3] - tie[0] * scale[0], scale[0], 0, tie[4] + tie[1] * scale[1], 0, -scale[1]};
    if (m.size() >= 8)
        return Affine{m[3], m[0], m[1], m[7], m[4], m[5]};
    return std::nullopt;
}

/// A file beside: the same name with another extension, or with one more.
std::optional<fs::path> beside(const fs::path& file, std::initializer_list<const char*> extensions) {
    for (const char* extension : extensions)
        for (const fs::path& path : {fs::path(file).replace_extension(extension), fs::path(file.string() + extension)})
            if (is_file(path))
                return path;
    return std::nullopt;
}

/// Six lines; the last two are the centre of the first cell.
std::optional<Affine> affine_of_world_file(const fs::path& file) {
    const auto path = beside(file, {".tfw", ".TFW", ".tifw", ".tiffw", ".wld"});
    if (!path)
        return std::nullopt;
    const std::string text = read_list_file(*path);
    std::vector<double> numbers;
    for (const TextLine& line : text_lines(text))
        for (const std::string_view word : words(line.text)) {
            const auto value = number(word);
            if (!value || !std::isfinite(*value))
                throw Error(
                    fmt::format("{}: a number expected, found {}", at_line(*path, line.number), in_quotes(word)));
            numbers.push_back(*value);
        }
    if (numbers.size() != 6)
        throw Error(fmt::format("{}: a world file has 6 numbers, found {}", path->string(), numbers.size()));
    const double xc = numbers[0], yc = numbers[1], xr = numbers[2], yr = numbers[3];
    return Affine{numbers[4] - (xc + xr) / 2, xc, xr, numbers[5] - (yc + yr) / 2, yc, yr};
}

/// GDAL's file beside a raster.
class Auxiliary {
  public:
    explicit Auxiliary(const fs::path& file) {
        const fs::path path = file.string() + ".aux.xml";
        if (!is_file(path))
            return;
        constexpr std::size_t most = 1 << 22;
        const std::string text = read_at_most(most, path, "a description of a raster");
        if (!document_.load_buffer(text.data(), text.size()))
            throw Error(path.string() + ": is no XML");
    }
    [[nodiscard]] std::string srs() const { return top().child("SRS").text().get(); }
    [[nodiscard]] std::optional<Affine> affine() const {
        std::string text = top().child("GeoTransform").text().get();
        std::ranges::replace(text, ',', ' ');
        std::vector<double> v;
        for (const std::string_view word : words(text))
            v.push_back(number(word).value_or(NAN));
        return v.size() == 6 ? std::optional(Affine{v[0], v[1], v[2], v[3], v[4], v[5]}) : std::nullopt;
    }

  private:
    [[nodiscard]] pugi::xml_node top() const { return document_.child("PAMDataset"); }
    pugi::xml_document document_;
};

Crs crs_beside(const fs::path& file, const Auxiliary& auxiliary) {
    if (const std::string text = auxiliary.srs(); !text.empty())
        return during(file.string() + ".aux.xml", [&] { return crs_of_text(text); });
    if (const auto path = beside(file, {".prj", ".PRJ"})) {
        constexpr std::size_t most = 1 << 20;
        const std::string text = read_at_most(most, *path, "a coordinate system");
        return during(path->string(), [&] { return crs_of_text(text); });
    }
    return {};
}

void check_place(const TiffInput& tiff, const Affine& affine, const Grid& grid, cv::Size size) {
    for (const double value : {affine.x0, affine.xc, affine.xr, affine.y0, affine.yc, affine.yr})
        if (!std::isfinite(value))
            tiff.refuse("its place on the map is not a number");
    if (affine.xr != 0 || affine.yc != 0)
        tiff.refuse("rows of the raster do not run from west to east: it is turned; `gdalwarp` makes one that is not");
    if (!(affine.xc > 0) || !(affine.yr < 0))
        tiff.refuse(
            fmt::format("steps of {} to the east and {} to the north from cell to cell, expected one above 0 and "
                        "one below; `gdalwarp` makes a raster with north up",
                        affine.xc, affine.yr));
    constexpr double slack = 1e-6; // numbers that went through text
    if (std::abs(affine.xc + affine.yr) > slack * affine.xc)
        tiff.refuse(fmt::format("cells of {} by {}, expected squares; `gdalwarp -tr {} {}` makes them", affine.xc,
                                -affine.yr, std::min(affine.xc, -affine.yr), std::min(affine.xc, -affine.yr)));
    const double east = affine.x0 + size.width * affine.xc, south = affine.y0 + size.height * affine.yr;
    constexpr double small = 0.01, half = 90, whole = 360;
    const bool like_degrees = !grid.crs.known && affine.xc < small && std::abs(affine.x0) <= whole &&
                              std::abs(east) <= whole && std::abs(affine.y0) <= half && std::abs(south) <= half;
    if (grid.crs.geographic || like_degrees)
        tiff.refuse(fmt::format("coordinates are {}degrees, in which slopes mean nothing; project it first, such as by "
                                "`gdalwarp -t_srs EPSG:CODE -r bilinear`",
                                grid.crs.geographic ? "" : "probably "));
}

Grid grid_of(const TiffInput& tiff, cv::Size size, std::vector<std::string>& notes) {
    Grid grid;
    const Auxiliary auxiliary(tiff.file());
    GeoKeys keys{tiff.shorts(tag_keys), tiff.doubles(tag_key_doubles), tiff.ascii(tag_key_ascii)};
    constexpr int raster_type = 1025, point = 2, area = 1;
    const bool at_centre = value_of(keys, raster_type, area) == point;
    const bool has_keys = !keys.directory.empty();
    if (has_keys) {
        grid.crs = during(tiff.file().string(), [&] { return crs_of_keys(std::move(keys)); });
        grid.crs.keys = with_value(std::move(grid.crs.keys), raster_type, area);
    }
    // Keys may hold no more than the raster's type.
    constexpr int projected = 3072, model = 1024;
    if (!has_keys || (value_of(grid.crs.keys, projected, 0) == 0 && value_of(grid.crs.keys, model, 0) == 0))
        grid.crs = crs_beside(tiff.file(), auxiliary);
    std::optional<Affine> affine = affine_of_tags(tiff);
    if (affine && at_centre) {
        affine->x0 -= (affine->xc + affine->xr) / 2;
        affine->y0 -= (affine->yc + affine->yr) / 2;
    }
    if (!affine)
        affine = auxiliary.affine();
    if (!affine)
        affine = affine_of_world_file(tiff.file());
    if (!affine) {
        notes.push_back("The file does not say where it lies: cells of one metre are assumed.");
        affine = Affine{};
    }
    check_place(tiff, *affine, grid, size);
    grid.x0 = affine->x0, grid.y0 = affine->y0, grid.cell = affine->xc;
    if (!grid.crs.known)
        notes.push_back("The file names no coordinate system: metres are assumed.");
    notes.insert(notes.end(), grid.crs.notes.begin(), grid.crs.notes.end());
    constexpr int web_mercator = 3857;
    if (grid.crs.epsg == web_mercator)
        notes.push_back(
            "Web Mercator (EPSG 3857) stretches lengths by 1 / cos(latitude): slopes are too gentle, radii too "
            "short. Project it to a national grid or UTM first.");
    return grid;
}

// --- values ---

/// How a band's numbers are stored.
struct Layout {
    cv::Size size;
    cv::Size piece; ///< of a tile, or of a strip
    int bytes = 0;  ///< of a number
    int format = 0; ///< SAMPLEFORMAT_...
    int step = 1;   ///< numbers from one of a band to its next
    int first = 0;  ///< number of the first of the band
    int plane = 0;  ///< of separate planes
    bool tiled = false;
};

Layout layout_of(const TiffInput& tiff, int band) {
    Layout layout;
    layout.size =
        image_check::checked_size(tiff.number(TIFFTAG_IMAGEWIDTH, 0), tiff.number(TIFFTAG_IMAGELENGTH, 0), tiff.file());
    const int bits = tiff.short_number(TIFFTAG_BITSPERSAMPLE, 1),
              samples = tiff.short_number(TIFFTAG_SAMPLESPERPIXEL, 1);
    layout.format = tiff.short_number(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
    layout.bytes = bits / 8;
    const bool number = layout.format == SAMPLEFORMAT_IEEEFP
                            ? bits == 32 || bits == 64
                            : (layout.format == SAMPLEFORMAT_UINT || layout.format == SAMPLEFORMAT_INT) &&
                                  (bits == 8 || bits == 16 || bits == 32 || bits == 64);
    if (!number || tiff.short_number(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK) == PHOTOMETRIC_PALETTE)
        tiff.refuse(fmt::format("numbers of {} bits in sample format {}, expected heights: integers of 8 to 64 bits or "
                                "floats of 32 or 64",
                                bits, layout.format));
    if (band == 0 && samples > 1)
        tiff.refuse(fmt::format("{} bands: --band NUMBER says which has the heights", samples));
    if (band > samples)
        tiff.refuse(fmt::format("band {} of {}", band, samples));
    const bool separate = tiff.short_number(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) == PLANARCONFIG_SEPARATE;
    const int index = std::max(band, 1) - 1;
    layout.step = separate ? 1 : samples;
    layout.first = separate ? 0 : index;
    layout.plane = separate ? index : 0;
    layout.tiled = TIFFIsTiled(tiff.get()) != 0;
    const std::uint32_t height = static_cast<std::uint32_t>(layout.size.height);
    const std::uint32_t width =
        layout.tiled ? tiff.number(TIFFTAG_TILEWIDTH, 0) : static_cast<std::uint32_t>(layout.size.width);
    const std::uint32_t rows =
        layout.tiled ? tiff.number(TIFFTAG_TILELENGTH, 0) : std::min(tiff.number(TIFFTAG_ROWSPERSTRIP, height), height);
    const std::uint64_t expected = std::uint64_t(width) * rows * static_cast<std::uint64_t>(layout.bytes * layout.step);
    const tmsize_t stored = layout.tiled ? TIFFTileSize(tiff.get()) : TIFFStripSize(tiff.get());
    if (width == 0 || rows == 0 || stored <= 0 || expected != static_cast<std::uint64_t>(stored))
        tiff.refuse(fmt::format("{} of {}x{} cells that should have {} bytes have {}",
                                layout.tiled ? "tiles" : "strips", width, rows, expected, stored));
    layout.piece = {static_cast<int>(width), static_cast<int>(rows)};
    return layout;
}

template <class Number>
double number_at(const char* bytes) {
    Number value;
    std::memcpy(&value, bytes, sizeof value);
    return static_cast<double>(value);
}

using NumberAt = double (*)(const char*);

NumberAt reader_of(const Layout& layout) {
    const std::array<NumberAt, 4> whole{&number_at<std::uint8_t>, &number_at<std::uint16_t>, &number_at<std::uint32_t>,
                                        &number_at<std::uint64_t>};
    const std::array<NumberAt, 4> negative{&number_at<std::int8_t>, &number_at<std::int16_t>, &number_at<std::int32_t>,
                                           &number_at<std::int64_t>};
    if (layout.format == SAMPLEFORMAT_IEEEFP)
        return layout.bytes == 4 ? &number_at<float> : &number_at<double>;
    const std::size_t index = layout.bytes == 1 ? 0 : layout.bytes == 2 ? 1 : layout.bytes == 4 ? 2 : 3;
    return layout.format == SAMPLEFORMAT_INT ? negative[index] : whole[index];
}

/// Calls take(row, column, number) for every cell of the band; pieces that were never written have none.
template <class Take>
void visit(const TiffInput& tiff, const Layout& layout, const Take& take) {
    const NumberAt read = reader_of(layout);
    const int cell_bytes = layout.bytes * layout.step;
    std::string piece(static_cast<std::size_t>(layout.piece.area()) * static_cast<std::size_t>(cell_bytes), '\0');
    for (int y = 0; y < layout.size.height; y += layout.piece.height)
        for (int x = 0; x < layout.size.width; x += layout.piece.width) {
            const auto column = static_cast<std::uint32_t>(x), row = static_cast<std::uint32_t>(y);
            const auto plane = static_cast<std::uint16_t>(layout.plane);
            const std::uint32_t index = layout.tiled ? TIFFComputeTile(tiff.get(), column, row, 0, plane)
                                                     : TIFFComputeStrip(tiff.get(), row, plane);
            if (TIFFGetStrileByteCount(tiff.get(), index) == 0)
                continue;
            const int rows = std::min(layout.piece.height, layout.size.height - y);
            const auto size = static_cast<tmsize_t>(layout.tiled ? piece.size()
                                                                 : static_cast<std::size_t>(rows * layout.piece.width) *
                                                                       static_cast<std::size_t>(cell_bytes));
            if ((layout.tiled ? TIFFReadEncodedTile(tiff.get(), index, piece.data(), size)
                              : TIFFReadEncodedStrip(tiff.get(), index, piece.data(), size)) != size)
                tiff.fail();
            const int columns = std::min(layout.piece.width, layout.size.width - x);
            for (int j = 0; j < rows; ++j) {
                const char* at = piece.data() + static_cast<std::ptrdiff_t>(j) * layout.piece.width * cell_bytes +
                                 layout.first * layout.bytes;
                for (int i = 0; i < columns; ++i, at += cell_bytes)
                    take(y + j, x + i, read(at));
            }
        }
}

/// GDAL's metadata: SCALE, OFFSET.
struct Scaling {
    double scale = 1, offset = 0;
    [[nodiscard]] bool any() const { return scale != 1 || offset != 0; }
};

Scaling scaling_of(const TiffInput& tiff, int band) {
    Scaling scaling;
    const std::string text = tiff.ascii(tag_metadata);
    pugi::xml_document document;
    if (text.empty() || !document.load_buffer(text.data(), text.size()))
        return scaling;
    for (const pugi::xml_node& item : document.child("GDALMetadata").children("Item")) {
        if (item.attribute("sample").as_int() != std::max(band, 1) - 1)
            continue;
        const std::string_view role = item.attribute("role").value();
        double* to = role == "scale" ? &scaling.scale : role == "offset" ? &scaling.offset : nullptr;
        if (!to)
            continue;
        const auto value = number(trimmed(item.text().get()));
        if (!value || !std::isfinite(*value) || (role == "scale" && *value == 0))
            tiff.refuse(fmt::format("its {} of heights is {}, expected a number", role, in_quotes(item.text().get())));
        *to = *value;
    }
    return scaling;
}

/// The number of cells without data, as a number of the file's type.
std::optional<double> nodata_of(const TiffInput& tiff, const Layout& layout) {
    const std::string text = tiff.ascii(tag_nodata);
    const auto value = number(trimmed(text));
    if (!value)
        return std::nullopt;
    const bool single = layout.format == SAMPLEFORMAT_IEEEFP && layout.bytes == 4;
    return single ? static_cast<double>(static_cast<float>(*value)) : *value;
}

/// Whether single precision may lose digits of what the file holds.
bool needs_base(const Layout& layout, const Scaling& scaling) {
    return scaling.any() || layout.bytes == 8 || (layout.bytes == 4 && layout.format != SAMPLEFORMAT_IEEEFP);
}

void read_heights(const TiffInput& tiff, int band, Raster& raster) {
    const Layout layout = layout_of(tiff, band);
    require_memory(static_cast<std::uint64_t>(layout.size.area()) * sizeof(float), tiff.file().string());
    const Scaling scaling = scaling_of(tiff, band);
    const std::optional<double> nodata = nodata_of(tiff, layout);
    constexpr double absurd = 1e30;
    raster.z = cv::Mat1f(layout.size, std::nanf(""));
    bool first = needs_base(layout, scaling);
    visit(tiff, layout, [&](int row, int column, double value) {
        if (nodata && value == *nodata)
            return;
        const double height = value * scaling.scale + scaling.offset;
        if (!(std::abs(height) < absurd)) // NaN, too
            return;
        if (first)
            raster.base = std::floor(height);
        first = false;
        raster.z(row, column) = static_cast<float>(height - raster.base);
    });
}

/// Cells that a mask leaves out have no data. It is of 1 or 8 bits.
void apply_mask(const TiffInput& tiff, cv::Mat1f& z) {
    const cv::Size size(static_cast<int>(tiff.number(TIFFTAG_IMAGEWIDTH, 0)),
                        static_cast<int>(tiff.number(TIFFTAG_IMAGELENGTH, 0)));
    const int bits = tiff.short_number(TIFFTAG_BITSPERSAMPLE, 1);
    if (size != z.size() || (bits != 1 && bits != 8) || tiff.short_number(TIFFTAG_SAMPLESPERPIXEL, 1) != 1)
        return;
    if (bits == 8)
        return visit(tiff, layout_of(tiff, 0), [&](int row, int column, double value) {
            if (value == 0)
                z(row, column) = std::nanf("");
        });
    const bool tiled = TIFFIsTiled(tiff.get()) != 0;
    const auto width = static_cast<int>(tiled ? tiff.number(TIFFTAG_TILEWIDTH, 0) : tiff.number(TIFFTAG_IMAGEWIDTH, 0));
    const auto rows = static_cast<int>(tiled ? tiff.number(TIFFTAG_TILELENGTH, 0)
                                             : std::min<std::uint32_t>(tiff.number(TIFFTAG_ROWSPERSTRIP, UINT32_MAX),
                                                                       static_cast<std::uint32_t>(size.height)));
    const tmsize_t bytes = tiled ? TIFFTileSize(tiff.get()) : TIFFStripSize(tiff.get());
    const int row_bytes = (width + 7) / 8;
    if (width <= 0 || rows <= 0 || bytes < static_cast<tmsize_t>(row_bytes) * rows)
        tiff.fail();
    std::string piece(static_cast<std::size_t>(bytes), '\0');
    for (int y = 0; y < size.height; y += rows)
        for (int x = 0; x < size.width; x += width) {
            const auto column = static_cast<std::uint32_t>(x), row = static_cast<std::uint32_t>(y);
            const std::uint32_t index =
                tiled ? TIFFComputeTile(tiff.get(), column, row, 0, 0) : TIFFComputeStrip(tiff.get(), row, 0);
            if ((tiled ? TIFFReadEncodedTile(tiff.get(), index, piece.data(), bytes)
                       : TIFFReadEncodedStrip(tiff.get(), index, piece.data(), bytes)) < 0)
                tiff.fail();
            for (int j = 0; j < std::min(rows, size.height - y); ++j)
                for (int i = 0; i < std::min(width, size.width - x); ++i)
                    if ((static_cast<unsigned char>(piece[static_cast<std::size_t>(j * row_bytes + i / 8)]) >>
                             (7 - i % 8) &
                         1) == 0)
                        z(y + j, x + i) = std::nanf("");
        }
}

} // namespace

bool is_tiff(const fs::path& file) {
    if (!is_file(file))
        return false;
    const std::string start = read_bytes(file, 4);
    using namespace std::string_literals;
    return start == "II*\0"s || start == "MM\0*"s || start == "II+\0"s || start == "MM\0+"s;
}

Raster read_raster(const fs::path& file, int band) {
    if (is_vrt(file))
        return read_vrt(file, band);
    TiffInput tiff(file);
    Raster raster;
    while ((tiff.number(TIFFTAG_SUBFILETYPE, 0) & (reduced | mask)) != 0)
        if (!tiff.next_directory())
            tiff.refuse("no image but overviews and masks");
    read_heights(tiff, band, raster);
    raster.grid = grid_of(tiff, raster.z.size(), raster.notes);
    while (tiff.next_directory())
        if ((tiff.number(TIFFTAG_SUBFILETYPE, 0) & (reduced | mask)) == mask)
            apply_mask(tiff, raster.z);
    return raster;
}

} // namespace scanshade::rasters
