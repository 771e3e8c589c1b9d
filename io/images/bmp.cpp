// BMP (Microsoft, "Bitmap Storage"): 1, 4 or 8 bits with a palette, plain or in runs; 16, 24 or 32 bits.
#include "io/images/readers.h"

#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>
#include <vector>

namespace scanshade::images {

namespace {

using image_check::little_endian_32;
using image_check::refuse;

enum Compression : std::uint32_t { plain = 0, runs_of_8 = 1, runs_of_4 = 2, bit_fields = 3 };

unsigned byte_at(std::string_view bytes, std::size_t at) { return static_cast<unsigned char>(bytes[at]); }
unsigned little_endian_16(std::string_view bytes, std::size_t at) {
    return byte_at(bytes, at) | byte_at(bytes, at + 1) << 8;
}

struct Bitmap {
    unsigned bits = 0;
    Compression compression = plain;
    bool top_first = false;
    std::vector<cv::Vec3b> palette;
    std::string_view pixels;
};

Bitmap taken_apart(std::string_view bytes, const Path& file) {
    constexpr std::size_t file_header = 14, short_header = 40;
    if (bytes.size() < file_header + short_header)
        refuse(file, fmt::format("BMP ends early: {} bytes", bytes.size()));
    Bitmap bitmap;
    const std::size_t header = little_endian_32(bytes, 14), start = little_endian_32(bytes, 10);
    bitmap.top_first = static_cast<std::int32_t>(little_endian_32(bytes, 22)) < 0;
    bitmap.bits = little_endian_16(bytes, 28);
    bitmap.compression = static_cast<Compression>(little_endian_32(bytes, 30));
    if (start > bytes.size())
        refuse(file, fmt::format("BMP ends early: {} bytes, pixels are said to begin at byte {}", bytes.size(), start));
    bitmap.pixels = bytes.substr(start);
    if (bitmap.bits <= 8) {
        const std::size_t full = std::size_t(1) << bitmap.bits, said = little_endian_32(bytes, 46);
        const std::size_t count = said == 0 ? full : std::min(said, full), at = file_header + header;
        if (at > bytes.size() || 4 * count > bytes.size() - at)
            refuse(file, fmt::format("BMP ends early: {} bytes, no room for a palette of {}", bytes.size(), count));
        bitmap.palette.resize(full, cv::Vec3b(0, 0, 0));
        for (std::size_t i = 0; i < count; ++i)
            for (std::size_t channel = 0; channel < 3; ++channel)
                bitmap.palette[i][static_cast<int>(channel)] = static_cast<uchar>(bytes[at + 4 * i + channel]);
    }
    return bitmap;
}

/// Green of 6 bits where the masks say so, else of 5, as all writers have it.
bool wide_green(std::string_view bytes, const Bitmap& bitmap) {
    constexpr std::size_t green_mask = 58;
    return bitmap.compression == bit_fields && bytes.size() >= green_mask + 4 &&
           little_endian_32(bytes, green_mask) == 0x7e0;
}

cv::Vec3b colour_of(unsigned pixel, bool six_bits_of_green) {
    const auto top = [](unsigned value, unsigned bits) { return static_cast<uchar>(value << (8 - bits)); };
    if (six_bits_of_green)
        return {top(pixel & 31, 5), top(pixel >> 5 & 63, 6), top(pixel >> 11 & 31, 5)};
    return {top(pixel & 31, 5), top(pixel >> 5 & 31, 5), top(pixel >> 10 & 31, 5)};
}

/// The palette's indices from runs: a count and a value, or 0 and: 0 end of the row, 1 end of the image, 2 a jump, a
/// count of values that follow.
cv::Mat1b unpacked(const Bitmap& bitmap, cv::Size size, const Path& file) {
    cv::Mat1b indices(size, uchar(0));
    int x = 0, y = 0;
    const unsigned bits = bitmap.bits;
    const auto put = [&](unsigned value) {
        if (x >= size.width || y >= size.height)
            refuse(file, "BMP is damaged: a run leaves the image");
        indices(y, x++) = static_cast<uchar>(value);
    };
    const auto half = [&](unsigned byte, unsigned i) { return bits == 8 ? byte : i % 2 == 0 ? byte >> 4 : byte & 15; };
    for (std::size_t at = 0;;) {
        const auto next = [&] {
            if (at >= bitmap.pixels.size())
                refuse(file, "BMP ends early: its runs have no end");
            return byte_at(bitmap.pixels, at++);
        };
        const unsigned count = next(), value = next();
        if (count > 0) {
            for (unsigned i = 0; i < count; ++i)
                put(half(value, i));
        } else if (value == 0) {
            x = 0, ++y;
        } else if (value == 1) {
            return indices;
        } else if (value == 2) {
            x += static_cast<int>(next());
            y += static_cast<int>(next());
        } else {
            const std::size_t start = at;
            for (unsigned i = 0, byte = 0; i < value; ++i) {
                if (bits == 8 || i % 2 == 0)
                    byte = next();
                put(half(byte, i));
            }
            at += (at - start) % 2; // words
        }
    }
}

} // namespace

ImageFacts bmp_header(std::string_view bytes, const Path& file) {
    if (bytes.size() < 30)
        refuse(file, fmt::format("BMP ends early: {} bytes", bytes.size()));
    const auto number = [&](std::size_t at) { return static_cast<std::int32_t>(little_endian_32(bytes, at)); };
    if (number(14) < 40)
        refuse(file, fmt::format("BMP header of {} bytes, expected 40 or more", number(14)));
    ImageFacts facts;
    facts.size = image_check::checked_size(static_cast<std::uint64_t>(std::max(number(18), 0)),
                                           static_cast<std::uint64_t>(std::abs(std::int64_t(number(22)))), file);
    facts.bits = 8;
    facts.channels = 3;
    return facts;
}

cv::Mat3b colour_bmp(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    const Bitmap bitmap = taken_apart(bytes, file);
    const unsigned bits = bitmap.bits;
    const bool known = bits == 1 || bits == 4 || bits == 8 || bits == 16 || bits == 24 || bits == 32;
    const bool packed =
        (bits == 8 && bitmap.compression == runs_of_8) || (bits == 4 && bitmap.compression == runs_of_4);
    const bool fields = (bits == 16 || bits == 32) && bitmap.compression == bit_fields;
    if (!known || (bitmap.compression != plain && !packed && !fields))
        refuse(file, fmt::format("BMP of {} bits and compression {}, which is not read", bits,
                                 static_cast<std::uint32_t>(bitmap.compression)));
    const std::size_t row_bytes = (static_cast<std::size_t>(facts.size.width) * bits + 31) / 32 * 4;
    const std::size_t needed = row_bytes * static_cast<std::size_t>(facts.size.height);
    if (!packed && needed > bitmap.pixels.size())
        refuse(file, fmt::format("BMP ends early: {}x{} pixels of {} bits need {} bytes, found {}", facts.size.width,
                                 facts.size.height, bits, needed, bitmap.pixels.size()));
    constexpr std::uint64_t longest_run = 255;
    if (packed)
        image_check::check_expansion(bitmap.pixels.size(), longest_run, facts, 1, file);
    const cv::Mat1b indices = packed ? unpacked(bitmap, facts.size, file) : cv::Mat1b();
    const bool six_bits_of_green = wide_green(bytes, bitmap);
    cv::Mat3b image(facts.size);
    for (int y = 0; y < image.rows; ++y) { // the bottom row comes first
        cv::Vec3b* to = image[bitmap.top_first ? y : image.rows - 1 - y];
        const std::string_view row =
            packed ? "" : bitmap.pixels.substr(static_cast<std::size_t>(y) * row_bytes, row_bytes);
        for (int x = 0; x < image.cols; ++x) {
            const auto i = static_cast<std::size_t>(x);
            if (packed)
                to[x] = bitmap.palette[indices(y, x)];
            else if (bits <= 8)
                to[x] = bitmap.palette[byte_at(row, i * bits / 8) >> (8 - bits - i * bits % 8) & ((1U << bits) - 1)];
            else if (bits == 16)
                to[x] = colour_of(little_endian_16(row, 2 * i), six_bits_of_green);
            else
                for (std::size_t channel = 0; channel < 3; ++channel)
                    to[x][static_cast<int>(channel)] = static_cast<uchar>(row[i * bits / 8 + channel]);
        }
    }
    return image;
}

} // namespace scanshade::images
