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
    cv::Size piece; ///< of a tile, of a strip, or of a row of a strip
    int bits = 0;   ///< of a number: 8 and more, or 1 of a mask
    int format = 0; ///< SAMPLEFORMAT_...
    int step = 1;   ///< numbers from one of a band to its next
    int first = 0;  ///< number of the first of the band
    int plane = 0;  ///< of separate planes
    bool tiled = false;
    bool by_row = false; ///< strips are so long that they are read row by row

    [[nodiscard]] int cell_bytes() const { return bits / 8 * step; }
    [[nodiscard]] std::size_t row_bytes() const {
        return (static_cast<std::size_t>(piece.width) * static_cast<std::size_t>(step * bits) + 7) / 8;
    }
};

cv::Size size_of(const TiffInput& tiff) {
    const std::uint32_t width = tiff.number(TIFFTAG_IMAGEWIDTH, 0), height = tiff.number(TIFFTAG_IMAGELENGTH, 0);
    constexpr std::uint32_t most = 1 << 30;
    if (width == 0 || height == 0 || width > most || height > most)
        tiff.refuse(fmt::format("{} x {} cells, expected sides of 1 to {}", width, height, most));
    return {static_cast<int>(width), static_cast<int>(height)};
}

void set_pieces(const TiffInput& tiff, Layout& layout) {
    layout.tiled = TIFFIsTiled(tiff.get()) != 0;
    const auto height = static_cast<std::uint32_t>(layout.size.height);
    const std::uint32_t width =
        layout.tiled ? tiff.number(TIFFTAG_TILEWIDTH, 0) : static_cast<std::uint32_t>(layout.size.width);
    const std::uint32_t rows =
        layout.tiled ? tiff.number(TIFFTAG_TILELENGTH, 0) : std::min(tiff.number(TIFFTAG_ROWSPERSTRIP, height), height);
    layout.piece = {static_cast<int>(width), static_cast<int>(rows)};
    const std::uint64_t expected = layout.row_bytes() * rows;
    const tmsize_t stored = layout.tiled ? TIFFTileSize(tiff.get()) : TIFFStripSize(tiff.get());
    if (width == 0 || rows == 0 || stored <= 0 || expected != static_cast<std::uint64_t>(stored))
        tiff.refuse(fmt::format("{} of {}x{} cells that should have {} bytes have {}",
                                layout.tiled ? "tiles" : "strips", width, rows, expected, stored));
    constexpr std::uint64_t long_strip = 1 << 22; // bytes
    layout.by_row = !layout.tiled && expected > long_strip;
    if (layout.by_row)
        layout.piece.height = 1;
}

Layout layout_of(const TiffInput& tiff, int band) {
    Layout layout;
    layout.size = size_of(tiff);
    const int bits = tiff.short_number(TIFFTAG_BITSPERSAMPLE, 1),
              samples = tiff.short_number(TIFFTAG_SAMPLESPERPIXEL, 1);
    layout.format = tiff.short_number(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
    layout.bits = bits;
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
    set_pieces(tiff, layout);
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
        return layout.bits == 32 ? &number_at<float> : &number_at<double>;
    const std::size_t index = layout.bits <= 8 ? 0 : layout.bits == 16 ? 1 : layout.bits == 32 ? 2 : 3;
    return layout.format == SAMPLEFORMAT_INT ? negative[index] : whole[index];
}

/// Reads the piece with that cell; false where it was never written.
bool read_piece(const TiffInput& tiff, const Layout& layout, int x, int y, std::string& piece) {
    const auto column = static_cast<std::uint32_t>(x), row = static_cast<std::uint32_t>(y);
    const auto plane = static_cast<std::uint16_t>(layout.plane);
    const std::uint32_t index =
        layout.tiled ? TIFFComputeTile(tiff.get(), column, row, 0, plane) : TIFFComputeStrip(tiff.get(), row, plane);
    if (TIFFGetStrileByteCount(tiff.get(), index) == 0)
        return false;
    if (layout.by_row) {
        if (TIFFReadScanline(tiff.get(), piece.data(), row, plane) != 1)
            tiff.fail();
        return true;
    }
    const auto rows = static_cast<std::size_t>(std::min(layout.piece.height, layout.size.height - y));
    const auto size = static_cast<tmsize_t>(layout.tiled ? piece.size() : rows * layout.row_bytes());
    if ((layout.tiled ? TIFFReadEncodedTile(tiff.get(), index, piece.data(), size)
                      : TIFFReadEncodedStrip(tiff.get(), index, piece.data(), size)) != size)
        tiff.fail();
    return true;
}

/// Calls take(row, column, number) for cells of the band in rows first .. last - 1; pieces that were never written have
/// none.
template <class Take>
void visit(const TiffInput& tiff, const Layout& layout, int first, int last, const Take& take) {
    const NumberAt read = reader_of(layout);
    const int cell_bytes = layout.cell_bytes();
    std::string piece(static_cast<std::size_t>(layout.piece.height) * layout.row_bytes(), '\0');
    for (int y = first / layout.piece.height * layout.piece.height; y < last; y += layout.piece.height)
        for (int x = 0; x < layout.size.width; x += layout.piece.width) {
            if (!read_piece(tiff, layout, x, y, piece))
                continue;
            const int columns = std::min(layout.piece.width, layout.size.width - x);
            for (int row = std::max(y, first); row < std::min(y + layout.piece.height, last); ++row) {
                const char* line = piece.data() + static_cast<std::size_t>(row - y) * layout.row_bytes();
                const char* at = line + layout.first * (layout.bits / 8);
                for (int i = 0; i < columns; ++i, at += cell_bytes)
                    take(row, x + i,
                         layout.bits == 1 ? static_cast<unsigned char>(line[i / 8]) >> (7 - i % 8) & 1 : read(at));
            }
        }
}

/// GDAL's metadata: SCALE, OFFSET, UNITTYPE.
struct Scaling {
    double scale = 1, offset = 0;
    std::string unit{};
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
        if (role == "unittype")
            scaling.unit = trimmed(item.text().get());
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
    const bool single = layout.format == SAMPLEFORMAT_IEEEFP && layout.bits == 32;
    return single ? static_cast<double>(static_cast<float>(*value)) : *value;
}

/// Whether single precision may lose digits of what the file holds.
bool needs_base(const Layout& layout, const Scaling& scaling) {
    return scaling.any() || layout.bits == 64 || (layout.bits == 32 && layout.format != SAMPLEFORMAT_IEEEFP);
}

/// The directory of the image proper: neither an overview nor a mask.
void find_image(TiffInput& tiff) {
    while ((tiff.number(TIFFTAG_SUBFILETYPE, 0) & (reduced | mask)) != 0)
        if (!tiff.next_directory())
            tiff.refuse("no image but overviews and masks");
}

/// A mask of 1 or 8 bits, behind the image: cells of 0 have no data.
class Mask {
  public:
    /// In the file, or in GDAL's NAME.msk beside it. Null where there is none of that size.
    static std::unique_ptr<Mask> find(const fs::path& file, cv::Size size) {
        auto found = std::make_unique<Mask>(file);
        find_image(found->tiff_);
        while (found->tiff_.next_directory())
            if ((found->tiff_.number(TIFFTAG_SUBFILETYPE, 0) & (reduced | mask)) == mask && found->fits(size))
                return found;
        const fs::path beside = file.string() + ".msk";
        if (!is_tiff(beside))
            return nullptr;
        found = std::make_unique<Mask>(beside);
        if (!found->fits(size))
            found->tiff_.refuse(
                fmt::format("expected a mask of one band of bytes, {}x{} cells", size.width, size.height));
        return found;
    }
    explicit Mask(const fs::path& file) : tiff_(file) {}

    void apply(int first, cv::Mat1f& z) const {
        visit(tiff_, layout_, first, first + z.rows, [&](int row, int column, double value) {
            if (value == 0)
                z(row - first, column) = std::nanf("");
        });
    }

  private:
    bool fits(cv::Size size) {
        const int bits = tiff_.short_number(TIFFTAG_BITSPERSAMPLE, 1);
        if (size_of(tiff_) != size || (bits != 1 && bits != 8) || tiff_.short_number(TIFFTAG_SAMPLESPERPIXEL, 1) != 1)
            return false;
        layout_.size = size, layout_.bits = bits, layout_.format = SAMPLEFORMAT_UINT;
        set_pieces(tiff_, layout_);
        return true;
    }

    TiffInput tiff_;
    Layout layout_;
};

class TiffReader final : public RasterReader {
  public:
    TiffReader(const fs::path& file, int band) : tiff_(file) {
        find_image(tiff_);
        layout_ = layout_of(tiff_, band);
        scaling_ = scaling_of(tiff_, band);
        nodata_ = nodata_of(tiff_, layout_);
        size = layout_.size;
        grid = grid_of(tiff_, size, notes);
        take_height_unit(grid.crs, scaling_.unit, notes);
        scaled = scaling_.any();
        if (layout_.format != SAMPLEFORMAT_IEEEFP)
            step = std::abs(scaling_.scale);
        mask_ = Mask::find(file, size);
        if (needs_base(layout_, scaling_))
            find_base();
    }

    void read(int first, cv::Mat1f& z) override {
        for (int row = first; row < first + z.rows;) {
            const int piece = row / layout_.piece.height * layout_.piece.height;
            if (piece != decoded_first_)
                decode(piece);
            const int count = std::min(piece + decoded_.rows, first + z.rows) - row;
            decoded_.rowRange(row - piece, row - piece + count).copyTo(z.rowRange(row - first, row - first + count));
            row += count;
        }
    }

  private:
    /// NaN where there is no data.
    [[nodiscard]] double height_of(double value) const {
        constexpr double absurd = 1e30;
        const double height = value * scaling_.scale + scaling_.offset;
        return value == nodata_ || !(std::abs(height) < absurd) ? std::nan("") : height;
    }

    /// The whole number at or below the first height of the file.
    void find_base() {
        for (int row = 0, found = 0; row < size.height && found == 0; row += layout_.piece.height)
            visit(tiff_, layout_, row, std::min(row + layout_.piece.height, size.height), [&](int, int, double value) {
                const double height = height_of(value);
                if (found == 0 && !std::isnan(height))
                    base = std::floor(height), found = 1;
            });
    }

    /// The rows of tiles, or of a strip, that begin there.
    void decode(int first) {
        const int last = std::min(first + layout_.piece.height, size.height);
        require_memory(std::uint64_t(size.width) * static_cast<std::uint64_t>(last - first) * sizeof(float),
                       tiff_.file().string());
        decoded_first_ = -1; // until it is there
        decoded_ = cv::Mat1f(last - first, size.width, std::nanf(""));
        visit(tiff_, layout_, first, last, [&](int row, int column, double value) {
            decoded_(row - first, column) = static_cast<float>(height_of(value) - base);
        });
        if (mask_)
            mask_->apply(first, decoded_);
        decoded_first_ = first;
    }

    TiffInput tiff_;
    Layout layout_;
    Scaling scaling_;
    std::optional<double> nodata_;
    std::unique_ptr<Mask> mask_;
    cv::Mat1f decoded_;
    int decoded_first_ = -1;
};

} // namespace

bool is_tiff(const fs::path& file) {
    if (!is_file(file))
        return false;
    const std::string start = read_bytes(file, 4);
    using namespace std::string_literals;
    return start == "II*\0"s || start == "MM\0*"s || start == "II+\0"s || start == "MM\0+"s;
}

std::unique_ptr<RasterReader> open_raster(const fs::path& file, int band) {
    if (is_vrt(file))
        return open_vrt(file, band);
    return std::make_unique<TiffReader>(file, band);
}

Raster read_raster(const fs::path& file, int band) {
    const std::unique_ptr<RasterReader> reader = open_raster(file, band);
    const auto width = static_cast<std::uint64_t>(reader->size.width),
               height = static_cast<std::uint64_t>(reader->size.height);
    (void)image_check::checked_size(width, height, file);
    require_memory(width * height * sizeof(float), file.string());
    Raster raster{cv::Mat1f(reader->size), reader->base, reader->grid, reader->notes};
    reader->read(0, raster.z);
    return raster;
}

} // namespace scanshade::rasters
