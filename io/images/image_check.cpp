// Signatures, sizes and byte counts of JPEG, PGM, PPM and PFM, and the choice among all formats.
#include "io/images/image_check.h"

#include "io/text.h"
#include "projection/error.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>

namespace scanshade {

// OpenCV touches EXR only where this is set when it first looks. Set before main, while there is only one thread; in
// this file because whoever reads or writes images here is linked with it.
[[maybe_unused]] static const bool exr_allowed = ::setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1) == 0;

namespace image_check {

void refuse(const std::filesystem::path& file, const std::string& why) { throw Error(file.string() + ": " + why); }

cv::Size checked_size(std::uint64_t width, std::uint64_t height, const std::filesystem::path& file) {
    // Each side is below 2^32 in every format, so the product cannot overflow.
    constexpr std::uint64_t longest = std::uint64_t(1) << 24;
    if (width == 0 || height == 0)
        refuse(file, fmt::format("image size {}x{}, expected at least 1x1", width, height));
    if (width > longest || height > longest || width * height > most_pixels)
        refuse(file, fmt::format("image size {}x{} is more than 2^28 pixels; not read", width, height));
    return {static_cast<int>(width), static_cast<int>(height)};
}

void check_expansion(std::uint64_t packed, std::uint64_t most, const ImageFacts& facts, int stored_channels,
                     const std::filesystem::path& file) {
    const std::uint64_t needed = std::uint64_t(facts.size.area()) * static_cast<unsigned>(stored_channels) *
                                 static_cast<unsigned>(facts.bits) / 8;
    if (needed / most > packed)
        refuse(file, fmt::format("{} bytes of image data cannot become {}x{} pixels", packed, facts.size.width,
                                 facts.size.height));
}

std::uint32_t big_endian_32(std::string_view bytes, std::size_t offset) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i)
        value = value << 8 | static_cast<unsigned char>(bytes[offset + i]);
    return value;
}

namespace {

// --- JPEG (ITU T.81 annex B) ---

std::uint32_t big_endian_16(std::string_view bytes, std::size_t offset) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[offset]) << 8 |
                                      static_cast<unsigned char>(bytes[offset + 1]));
}

bool is_frame_header(unsigned marker) { // SOF0 .. SOF15 without DHT, JPG and DAC
    return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

/// The next marker at or after `at` inside coded data: 0xff followed by neither a stuffed 0 nor a restart.
std::size_t after_scan(std::string_view bytes, std::size_t at) {
    for (at = bytes.find('\xff', at); at != std::string_view::npos; at = bytes.find('\xff', at + 1)) {
        if (at + 1 >= bytes.size())
            return std::string_view::npos;
        const auto next = static_cast<unsigned char>(bytes[at + 1]);
        if (next != 0 && next != 0xff && (next < 0xd0 || next > 0xd7))
            return at;
    }
    return std::string_view::npos;
}

/// Walks the markers. With `whole`, up to the end-of-image marker, which a cut file lacks; else up to the size.
ImageFacts jpeg_facts(std::string_view bytes, const std::filesystem::path& file, bool whole) {
    ImageFacts facts;
    facts.format = ImageFormat::jpeg;
    bool huffman = false;
    const auto ends_early = [&] {
        refuse(file, fmt::format("JPEG ends early: {} bytes and no end-of-image marker", bytes.size()));
    };
    for (std::size_t at = 2;;) {
        while (at + 1 < bytes.size() && bytes[at] == '\xff' && bytes[at + 1] == '\xff')
            ++at; // fill bytes
        if (at + 1 >= bytes.size())
            ends_early();
        if (bytes[at] != '\xff')
            refuse(file, fmt::format("JPEG is damaged at byte {}: a marker was expected", at));
        const unsigned marker = static_cast<unsigned char>(bytes[at + 1]);
        if (marker == 0xd9)
            break; // end of image
        if (marker == 0x01 || (marker >= 0xd0 && marker <= 0xd7)) {
            at += 2;
            continue;
        }
        if (at + 4 > bytes.size())
            ends_early();
        const std::size_t length = big_endian_16(bytes, at + 2);
        if (length < 2)
            refuse(file, fmt::format("JPEG is damaged at byte {}: segment length {}", at, length));
        if (is_frame_header(marker)) {
            if (at + 10 > bytes.size() || length < 8)
                ends_early();
            facts.bits = static_cast<unsigned char>(bytes[at + 4]);
            facts.size = checked_size(big_endian_16(bytes, at + 7), big_endian_16(bytes, at + 5), file);
            facts.channels = static_cast<unsigned char>(bytes[at + 9]);
            huffman = marker < 0xc9; // SOF9 and on: arithmetic coding, which knows no such limit
            if (!whole)
                return facts;
        }
        at += 2 + length;
        if (marker == 0xda)
            at = after_scan(bytes, std::min(at, bytes.size())); // start of scan
        if (at == std::string_view::npos || at >= bytes.size())
            ends_early();
    }
    if (facts.size.empty())
        refuse(file, "JPEG without a frame header");
    if (huffman) // every block of 8x8 pixels takes a bit at least
        check_expansion(bytes.size(), 512, facts, 1, file);
    return facts;
}

// --- Netpbm and PFM ---

/// One word of a Netpbm header; '#' starts a comment. Moves `at` behind the word.
std::string_view header_word(std::string_view bytes, std::size_t& at) {
    while (at < bytes.size() && (std::isspace(static_cast<unsigned char>(bytes[at])) || bytes[at] == '#'))
        at = bytes[at] == '#' ? std::min(bytes.find('\n', at), bytes.size()) : at + 1;
    const std::size_t start = at;
    while (at < bytes.size() && !std::isspace(static_cast<unsigned char>(bytes[at])))
        ++at;
    return bytes.substr(start, at - start);
}

std::uint64_t header_number(std::string_view bytes, std::size_t& at, const std::filesystem::path& file,
                            std::string_view what) {
    const auto word = header_word(bytes, at);
    const auto value = whole_number(word);
    if (!value || *value > UINT32_MAX)
        refuse(file, fmt::format("header's {} is {}, expected a whole number", what, in_quotes(word)));
    return *value;
}

/// BITMAPINFOHEADER and what came after it; a negative height stores the top row first.
ImageFacts bmp_header(std::string_view bytes, const std::filesystem::path& file) {
    if (bytes.size() < 30)
        refuse(file, fmt::format("BMP ends early: {} bytes", bytes.size()));
    const auto little_endian_32 = [&](std::size_t at) {
        return static_cast<std::int32_t>(__builtin_bswap32(big_endian_32(bytes, at)));
    };
    if (little_endian_32(14) < 40)
        refuse(file, fmt::format("BMP header of {} bytes, expected 40 or more", little_endian_32(14)));
    ImageFacts facts;
    facts.format = ImageFormat::bmp;
    facts.size = checked_size(static_cast<std::uint64_t>(std::max(little_endian_32(18), 0)),
                              static_cast<std::uint64_t>(std::abs(std::int64_t(little_endian_32(22)))), file);
    facts.bits = 8;
    facts.channels = 3;
    return facts;
}

ImageFacts netpbm_header(std::string_view bytes, const std::filesystem::path& file, ImageFormat format) {
    ImageFacts facts;
    facts.format = format;
    std::size_t at = 2;
    const auto width = header_number(bytes, at, file, "width");
    const auto height = header_number(bytes, at, file, "height");
    facts.size = checked_size(width, height, file);
    if (format == ImageFormat::pfm) {
        const auto word = header_word(bytes, at);
        const auto scale = number(word);
        if (!scale || !std::isfinite(*scale) || *scale == 0)
            refuse(file, fmt::format("PFM scale is {}, expected a number other than 0", in_quotes(word)));
        facts.big_endian = *scale > 0; // its size is a hint of units (Debevec's PFM description) and has no effect
        facts.floats = true;
        facts.bits = 32;
        facts.channels = bytes[1] == 'F' ? 3 : 1;
    } else {
        const auto maxval = header_number(bytes, at, file, "maxval");
        if (maxval == 0 || maxval > 65535)
            refuse(file, fmt::format("maxval {} in the header, expected 1 .. 65535", maxval));
        facts.bits = maxval > 255 ? 16 : 8;
        facts.channels = format == ImageFormat::ppm ? 3 : 1;
    }
    facts.pixels_at = at + 1; // exactly one white space follows
    return facts;
}

void check_sample_count(std::string_view bytes, const std::filesystem::path& file, const ImageFacts& facts) {
    const std::uint64_t expected = std::uint64_t(facts.size.area()) * static_cast<unsigned>(facts.channels) *
                                   static_cast<unsigned>(facts.bits / 8);
    const std::uint64_t found = bytes.size() - std::min(bytes.size(), facts.pixels_at);
    if (found != expected)
        refuse(file, fmt::format("{}x{} at {} bits needs {} bytes of samples, found {}", facts.size.width,
                                 facts.size.height, facts.bits, expected, found));
}

bool is_netpbm(ImageFormat format) {
    return format == ImageFormat::pgm || format == ImageFormat::ppm || format == ImageFormat::pfm;
}

} // namespace
} // namespace image_check

ImageFormat image_format(std::string_view bytes) {
    using namespace std::string_view_literals;
    if (bytes.starts_with("\x89PNG\r\n\x1a\n"sv))
        return ImageFormat::png;
    if (bytes.starts_with("\xff\xd8\xff"sv))
        return ImageFormat::jpeg;
    if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv))
        return ImageFormat::tiff;
    if (bytes.starts_with("\x76\x2f\x31\x01"sv))
        return ImageFormat::exr;
    if (bytes.starts_with("BM"sv))
        return ImageFormat::bmp;
    if (bytes.starts_with("RIFF"sv) && bytes.substr(std::min<std::size_t>(8, bytes.size())).starts_with("WEBP"sv))
        return ImageFormat::webp; // of 2^14 pixels a side at most
    if (bytes.starts_with("PCLZF"sv))
        return ImageFormat::pclzf;
    const bool netpbm = bytes.size() > 2 && bytes[0] == 'P' && std::isspace(static_cast<unsigned char>(bytes[2]));
    if (!netpbm)
        return ImageFormat::unknown;
    switch (bytes[1]) {
    case '5':
        return ImageFormat::pgm;
    case '6':
        return ImageFormat::ppm;
    case 'f':
    case 'F':
        return ImageFormat::pfm;
    default:
        return bytes[1] >= '1' && bytes[1] <= '7' ? ImageFormat::other_netpbm : ImageFormat::unknown;
    }
}

std::string_view format_name(ImageFormat format) {
    switch (format) {
    case ImageFormat::png:
        return "PNG";
    case ImageFormat::jpeg:
        return "JPEG";
    case ImageFormat::pgm:
        return "PGM";
    case ImageFormat::ppm:
        return "PPM";
    case ImageFormat::other_netpbm:
        return "Netpbm";
    case ImageFormat::pfm:
        return "PFM";
    case ImageFormat::tiff:
        return "TIFF";
    case ImageFormat::exr:
        return "EXR";
    case ImageFormat::bmp:
        return "BMP";
    case ImageFormat::webp:
        return "WebP";
    case ImageFormat::pclzf:
        return "PCLZF";
    case ImageFormat::unknown:
        break;
    }
    return "unknown";
}

ImageFacts read_image_header(std::string_view bytes, const std::filesystem::path& file) {
    const ImageFormat format = image_format(bytes);
    if (bytes.empty())
        image_check::refuse(file, "empty file (0 bytes), expected an image");
    if (format == ImageFormat::png)
        return image_check::png_header(bytes, file);
    if (format == ImageFormat::jpeg)
        return image_check::jpeg_facts(bytes, file, false);
    if (format == ImageFormat::tiff)
        return image_check::tiff_facts(bytes, file);
    if (format == ImageFormat::exr)
        return image_check::exr_facts(bytes, file);
    if (format == ImageFormat::bmp)
        return image_check::bmp_header(bytes, file);
    if (format == ImageFormat::pclzf)
        return image_check::pclzf_header(bytes, file);
    if (image_check::is_netpbm(format))
        return image_check::netpbm_header(bytes, file, format);
    ImageFacts facts;
    facts.format = format;
    return facts;
}

ImageFacts check_image(std::string_view bytes, const std::filesystem::path& file) {
    if (image_format(bytes) == ImageFormat::jpeg)
        return image_check::jpeg_facts(bytes, file, true);
    const ImageFacts facts = read_image_header(bytes, file);
    if (facts.format == ImageFormat::png)
        image_check::check_png_chunks(bytes, file, facts);
    if (image_check::is_netpbm(facts.format))
        image_check::check_sample_count(bytes, file, facts);
    if (facts.format == ImageFormat::pclzf)
        image_check::check_pclzf_block(bytes, file, facts);
    return facts;
}

} // namespace scanshade
