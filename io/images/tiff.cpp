// TIFF with libtiff, from memory and to memory; its errors become ours.
#include "io/images/readers.h"

#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <fmt/format.h>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <tiffio.h>
#include <vector>

namespace scanshade::images {

namespace {

using image_check::refuse;

/// A file in memory: reads from `bytes`, appends to `sink`.
struct Memory {
    std::string_view bytes;
    std::string sink;
    std::size_t at = 0;
    std::string trouble = {}; ///< libtiff's first error

    [[nodiscard]] std::size_t size() const { return std::max(bytes.size(), sink.size()); }
};

Memory& memory_of(thandle_t handle) { return *static_cast<Memory*>(handle); }

tmsize_t read_memory(thandle_t handle, void* to, tmsize_t count) {
    Memory& memory = memory_of(handle);
    const std::string_view rest = memory.bytes.substr(std::min(memory.at, memory.bytes.size()));
    const std::size_t length = std::min(rest.size(), static_cast<std::size_t>(count));
    std::memcpy(to, rest.data(), length);
    memory.at += length;
    return static_cast<tmsize_t>(length);
}

tmsize_t write_memory(thandle_t handle, void* from, tmsize_t count) {
    Memory& memory = memory_of(handle);
    const auto length = static_cast<std::size_t>(count);
    memory.sink.resize(std::max(memory.sink.size(), memory.at + length));
    std::memcpy(memory.sink.data() + memory.at, from, length);
    memory.at += length;
    return count;
}

toff_t seek_memory(thandle_t handle, toff_t offset, int from) {
    Memory& memory = memory_of(handle);
    memory.at = offset + (from == SEEK_CUR ? memory.at : from == SEEK_END ? memory.size() : 0);
    return memory.at;
}

toff_t size_of_memory(thandle_t handle) { return memory_of(handle).size(); }

int map_memory(thandle_t handle, void** base, toff_t* size) {
    Memory& memory = memory_of(handle);
    if (memory.bytes.empty())
        return 0;                                   // is being written
    *base = const_cast<char*>(memory.bytes.data()); // is only read
    *size = memory.bytes.size();
    return 1;
}

int keep_tiff_error(TIFF*, void* user, const char*, const char* format, va_list values) {
    auto& memory = *static_cast<Memory*>(user);
    char text[512];
    if (memory.trouble.empty() && std::vsnprintf(text, sizeof text, format, values) > 0)
        memory.trouble = text;
    return 1; // reported
}

int pass_over_warning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

using Tiff = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

Tiff opened(Memory& memory, const char* mode) {
    constexpr tmsize_t most_at_once = tmsize_t(1) << 30; // bytes that libtiff may allocate for a tag or a tile
    const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                   &TIFFOpenOptionsFree);
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), most_at_once);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), &keep_tiff_error, &memory);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), &pass_over_warning, nullptr);
    const auto close_nothing = [](thandle_t) { return 0; };
    const auto unmap_nothing = [](thandle_t, void*, toff_t) {};
    return {TIFFClientOpenExt("", mode, &memory, &read_memory, &write_memory, &seek_memory, close_nothing,
                              &size_of_memory, &map_memory, unmap_nothing, options.get()),
            &TIFFClose};
}

/// A TIFF to be read, its first image.
class TiffSource {
  public:
    TiffSource(std::string_view bytes, const Path& file)
        : file_(file), memory_{bytes, {}}, tiff_(opened(memory_, "r")) {
        if (!tiff_)
            fail();
    }
    template <class Value>
    Value field(std::uint32_t tag, Value otherwise) const {
        Value value = otherwise;
        return TIFFGetFieldDefaulted(tiff_.get(), tag, &value) ? value : otherwise;
    }
    [[noreturn]] void fail() const {
        refuse(file_, fmt::format("TIFF of {} bytes is damaged or cut short: {}", memory_.bytes.size(),
                                  memory_.trouble.empty() ? "libtiff does not say where" : memory_.trouble));
    }
    [[nodiscard]] TIFF* get() const { return tiff_.get(); }

  private:
    const Path& file_;
    Memory memory_;
    Tiff tiff_;
};

/// How many bytes one coded byte can become; none where nothing is known of the compression.
std::optional<std::uint64_t> expansion(std::uint16_t compression) {
    switch (compression) {
    case COMPRESSION_NONE:
        return 1;
    case COMPRESSION_LZW:
        return 4096; // a code of 12 bits stands for fewer bytes than there are codes
    case COMPRESSION_ADOBE_DEFLATE:
    case COMPRESSION_DEFLATE:
        return 1032;
    case COMPRESSION_PACKBITS:
        return 128;
    default:
        return std::nullopt;
    }
}

std::uint64_t coded_bytes(const TiffSource& source) {
    std::uint64_t sum = 0;
    const std::uint32_t pieces =
        TIFFIsTiled(source.get()) ? TIFFNumberOfTiles(source.get()) : TIFFNumberOfStrips(source.get());
    for (std::uint32_t i = 0; i < pieces; ++i)
        sum += TIFFGetStrileByteCount(source.get(), i);
    return sum;
}

ImageFacts facts_of(const TiffSource& source, const Path& file) {
    ImageFacts facts;
    facts.size = image_check::checked_size(source.field<std::uint32_t>(TIFFTAG_IMAGEWIDTH, 0),
                                           source.field<std::uint32_t>(TIFFTAG_IMAGELENGTH, 0), file);
    facts.bits = source.field<std::uint16_t>(TIFFTAG_BITSPERSAMPLE, 1);
    facts.channels = source.field<std::uint16_t>(TIFFTAG_SAMPLESPERPIXEL, 1);
    facts.floats = source.field<std::uint16_t>(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT) == SAMPLEFORMAT_IEEEFP;
    if (const auto most = expansion(source.field<std::uint16_t>(TIFFTAG_COMPRESSION, COMPRESSION_NONE)))
        image_check::check_expansion(coded_bytes(source), *most, facts, facts.channels, file);
    if (facts.floats || facts.bits == 32) // as it is read
        facts.bits = facts.floats ? 32 : 16;
    return facts;
}

/// OpenCV's type of one channel as the file stores it; none where it has no such numbers.
std::optional<int> stored_type(int bits, int format) {
    struct Row {
        int bits, format, type;
    };
    constexpr std::array rows{Row{8, SAMPLEFORMAT_UINT, CV_8U},     Row{16, SAMPLEFORMAT_UINT, CV_16U},
                              Row{16, SAMPLEFORMAT_INT, CV_16S},    Row{32, SAMPLEFORMAT_UINT, CV_32S},
                              Row{32, SAMPLEFORMAT_INT, CV_32S},    Row{16, SAMPLEFORMAT_IEEEFP, CV_16F},
                              Row{32, SAMPLEFORMAT_IEEEFP, CV_32F}, Row{64, SAMPLEFORMAT_IEEEFP, CV_64F}};
    const auto* const found =
        std::ranges::find_if(rows, [&](const Row& row) { return row.bits == bits && row.format == format; });
    return found == rows.end() ? std::nullopt : std::optional(found->type);
}

/// The image as its orientation tag says: first row at the top, first column on the left.
cv::Mat upright(const cv::Mat& stored, const TiffSource& source) {
    constexpr int around_x = 0, around_y = 1, around_both = -1;
    const auto orientation = source.field<std::uint16_t>(TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
    if (orientation <= ORIENTATION_TOPLEFT || orientation > ORIENTATION_LEFTBOT)
        return stored;
    cv::Mat image = stored;
    if (orientation >= ORIENTATION_LEFTTOP)
        cv::transpose(stored, image);
    if (orientation == ORIENTATION_TOPRIGHT || orientation == ORIENTATION_RIGHTTOP)
        cv::flip(image, image, around_y);
    if (orientation == ORIENTATION_BOTLEFT || orientation == ORIENTATION_LEFTBOT)
        cv::flip(image, image, around_x);
    if (orientation == ORIENTATION_BOTRIGHT || orientation == ORIENTATION_RIGHTBOT)
        cv::flip(image, image, around_both);
    return image;
}

void read_strips(const TiffSource& source, cv::Mat& image) {
    const auto rows = source.field<std::uint32_t>(TIFFTAG_ROWSPERSTRIP, 0);
    const auto height = static_cast<std::uint32_t>(image.rows);
    std::uint32_t strip = 0;
    for (std::uint32_t y = 0; y < height; ++strip) {
        const std::uint32_t count = std::min(rows == 0 ? height : rows, height - y);
        const auto size = static_cast<tmsize_t>(count * image.step[0]);
        if (TIFFReadEncodedStrip(source.get(), strip, image.ptr(static_cast<int>(y)), size) != size)
            source.fail();
        y += count;
    }
}

void read_tiles(const TiffSource& source, cv::Mat& image) {
    const auto width = static_cast<int>(source.field<std::uint32_t>(TIFFTAG_TILEWIDTH, 0));
    const auto height = static_cast<int>(source.field<std::uint32_t>(TIFFTAG_TILELENGTH, 0));
    const tmsize_t size = TIFFTileSize(source.get());
    if (width <= 0 || height <= 0 || size <= 0 || static_cast<std::uint64_t>(size) / image.elemSize() > most_pixels)
        source.fail();
    cv::Mat tile(height, width, image.type());
    if (tile.total() * tile.elemSize() != static_cast<std::size_t>(size))
        source.fail();
    std::uint32_t index = 0;
    for (int y = 0; y < image.rows; y += height)
        for (int x = 0; x < image.cols; x += width, ++index) {
            if (TIFFReadEncodedTile(source.get(), index, tile.data, size) != size)
                source.fail();
            const cv::Rect seen(0, 0, std::min(width, image.cols - x), std::min(height, image.rows - y));
            tile(seen).copyTo(image(seen + cv::Point(x, y)));
        }
}

} // namespace

ImageFacts tiff_header(std::string_view bytes, const Path& file) { return facts_of(TiffSource(bytes, file), file); }

cv::Mat stored_tiff(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    const TiffSource source(bytes, file);
    const int format = source.field<std::uint16_t>(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT),
              bits = source.field<std::uint16_t>(TIFFTAG_BITSPERSAMPLE, 1);
    const std::optional<int> type = stored_type(bits, format);
    if (facts.channels != 1 || !type)
        refuse(file,
               fmt::format("TIFF of {} bits in sample format {}, expected integers of 8, 16 or 32 bits, or floats "
                           "of 16, 32 or 64",
                           bits, format));
    cv::Mat image(facts.size, *type);
    TIFFIsTiled(source.get()) ? read_tiles(source, image) : read_strips(source, image);
    image = upright(image, source);
    if (facts.floats) {
        image.convertTo(image, CV_32F);
    } else if (*type == CV_16S || *type == CV_32S) { // 16-bit depth all the same; negative ones mark holes
        double least = 0, largest = 0;
        cv::minMaxLoc(image, &least, &largest);
        if (largest > 65535 || (least < 0 && format == SAMPLEFORMAT_UINT))
            refuse(file, fmt::format("TIFF of integers of {} bits holds {}, expected depth of 16 bits, 0 .. 65535",
                                     bits, largest > 65535 ? largest : least + 0x1p32));
        image.convertTo(image, CV_16U);
    }
    return image;
}

cv::Mat3b colour_tiff(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    const TiffSource source(bytes, file);
    char reason[1024] = "";
    if (!TIFFRGBAImageOK(source.get(), reason))
        refuse(file, fmt::format("TIFF that is no colour image: {}", reason));
    cv::Mat image(facts.size, CV_8UC4);
    const int as_stored = source.field<std::uint16_t>(TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
    constexpr int stop_on_error = 1;
    if (!TIFFReadRGBAImageOriented(source.get(), static_cast<std::uint32_t>(image.cols),
                                   static_cast<std::uint32_t>(image.rows), image.ptr<std::uint32_t>(), as_stored,
                                   stop_on_error))
        source.fail();
    cv::Mat bgr;
    cv::cvtColor(image, bgr, cv::COLOR_RGBA2BGR);
    return upright(bgr, source);
}

cv::Mat3w deep_tiff(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    const TiffSource source(bytes, file);
    const auto colours = source.field<std::uint16_t>(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE);
    const bool usual = source.field<std::uint16_t>(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT) == SAMPLEFORMAT_UINT &&
                       source.field<std::uint16_t>(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) == PLANARCONFIG_CONTIG;
    const bool grey = colours == PHOTOMETRIC_MINISBLACK && facts.channels == 1;
    const bool rgb = colours == PHOTOMETRIC_RGB && (facts.channels == 3 || facts.channels == 4);
    if (!usual || !(grey || rgb))
        return {};
    cv::Mat image(facts.size, CV_MAKETYPE(CV_16U, facts.channels));
    TIFFIsTiled(source.get()) ? read_tiles(source, image) : read_strips(source, image);
    cv::cvtColor(image, image,
                 grey                    ? cv::COLOR_GRAY2BGR
                 : image.channels() == 3 ? cv::COLOR_RGB2BGR
                                         : cv::COLOR_RGBA2BGR);
    return upright(image, source);
}

std::string encoded_tiff(const cv::Mat& image) {
    const int depth = image.depth(), channels = image.channels();
    if (image.empty() || (depth != CV_8U && depth != CV_16U && depth != CV_32F) || (channels != 1 && channels != 3))
        throw Error(fmt::format("no TIFF is written of {}x{} pixels of OpenCV's type {}", image.cols, image.rows,
                                image.type()));
    Memory memory;
    {
        const Tiff tiff = opened(memory, "w");
        const auto row_bytes = static_cast<int>(image.elemSize()) * image.cols;
        const auto set = [&](std::uint32_t tag, int value) {
            if (!tiff || !TIFFSetField(tiff.get(), tag, value))
                throw Error(fmt::format("cannot be encoded as TIFF: {}", memory.trouble));
        };
        constexpr int strip_bytes = 1 << 13; // what TIFF 6.0 recommends
        set(TIFFTAG_IMAGEWIDTH, image.cols);
        set(TIFFTAG_IMAGELENGTH, image.rows);
        set(TIFFTAG_BITSPERSAMPLE, static_cast<int>(image.elemSize1()) * 8);
        set(TIFFTAG_COMPRESSION, COMPRESSION_NONE);
        set(TIFFTAG_PHOTOMETRIC, channels == 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK);
        set(TIFFTAG_SAMPLESPERPIXEL, channels);
        set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
        set(TIFFTAG_ROWSPERSTRIP, std::clamp(strip_bytes / row_bytes, 1, image.rows));
        set(TIFFTAG_SAMPLEFORMAT, depth == CV_32F ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
        for (int y = 0; y < image.rows; ++y) {
            cv::Mat row = image.row(y).clone(); // libtiff may change its input
            if (channels == 3)
                cv::cvtColor(row, row, cv::COLOR_BGR2RGB);
            if (TIFFWriteScanline(tiff.get(), row.data, static_cast<std::uint32_t>(y), 0) != 1)
                throw Error(fmt::format("cannot be encoded as TIFF: {}", memory.trouble));
        }
        if (!TIFFWriteDirectory(tiff.get()))
            throw Error(fmt::format("cannot be encoded as TIFF: {}", memory.trouble));
    }
    return std::move(memory.sink);
}

} // namespace scanshade::images
