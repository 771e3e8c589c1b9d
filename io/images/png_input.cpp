// Grey and RGB PNG files, the most common input. ISA-L unpacks them, in half the time that libpng takes with zlib.
#include "io/images/png_input.h"

#include "io/images/image_check.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <isa-l/igzip_lib.h>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>

namespace scanshade {
namespace {

using image_check::big_endian_32;

constexpr std::size_t signature = 8, chunk_overhead = 12; // length, type, checksum

struct Packed {
    std::string joined;     ///< of several chunks
    std::string_view bytes; ///< of all of them
    bool plain = true;
};

/// The content of the IDAT chunks; not plain where a chunk says what grey values are to become (tRNS).
Packed packed_pixels(std::string_view file) {
    Packed packed;
    for (std::size_t at = signature; at + chunk_overhead <= file.size();) {
        const std::size_t length = big_endian_32(file, at);
        const std::string_view type = file.substr(at + 4, 4), content = file.substr(at + 8, length);
        if (type == "IDAT" && packed.bytes.empty())
            packed.bytes = content;
        else if (type == "IDAT") {
            if (packed.joined.empty())
                packed.joined = packed.bytes;
            packed.bytes = packed.joined += content;
        }
        packed.plain = packed.plain && type != "tRNS";
        at += chunk_overhead + length;
    }
    return packed;
}

/// Unpacks a zlib stream piece by piece: the whole of a large image would take as much memory again.
class Unpacker {
  public:
    explicit Unpacker(std::string_view packed) {
        isal_inflate_init(&state_);
        state_.crc_flag = ISAL_ZLIB;
        state_.next_in = reinterpret_cast<std::uint8_t*>(const_cast<char*>(packed.data())); // is only read
        state_.avail_in = static_cast<std::uint32_t>(packed.size());
    }
    /// Whether there are as many more bytes.
    bool next(std::uint8_t* bytes, std::size_t size) {
        state_.next_out = bytes;
        state_.avail_out = static_cast<std::uint32_t>(size);
        return isal_inflate(&state_) == ISAL_DECOMP_OK && state_.avail_out == 0;
    }
    /// Whether the stream ends here and its checksum is right.
    bool ends() {
        std::uint8_t none = 0;
        state_.next_out = &none;
        state_.avail_out = 1;
        return isal_inflate(&state_) == ISAL_DECOMP_OK && state_.avail_out == 1 &&
               state_.block_state == ISAL_BLOCK_FINISH;
    }

  private:
    inflate_state state_;
};

/// The one of a, b and c that is nearest to a + b - c; the first of equally near ones (section 9.4).
int paeth(int a, int b, int c) {
    const int to_a = std::abs(b - c), to_b = std::abs(a - c), to_c = std::abs(a + b - 2 * c);
    const int nearer = to_b <= to_c ? b : c;
    return to_a <= to_b && to_a <= to_c ? a : nearer;
}

/// Undoes a row's filter (section 9.2). A pixel of zeros precedes `row` and `above`.
template <int pixel>
bool unfilter(int filter, const std::uint8_t* from, const std::uint8_t* above, std::uint8_t* row, int length) {
    const auto each = [&](auto&& prediction) {
        for (int i = 0; i < length; ++i)
            row[i] = static_cast<std::uint8_t>(from[i] + prediction(row[i - pixel], above[i], above[i - pixel]));
    };
    switch (filter) {
    case 0:
        std::memcpy(row, from, static_cast<std::size_t>(length));
        return true;
    case 1:
        each([](int left, int, int) { return left; });
        return true;
    case 2:
        each([](int, int up, int) { return up; });
        return true;
    case 3:
        each([](int left, int up, int) { return (left + up) / 2; });
        return true;
    case 4:
        each(paeth);
        return true;
    default:
        return false;
    }
}

/// A row's pixels from its bytes: red first, high byte first.
template <class Pixel>
void store_row(const std::uint8_t* row, Pixel* to, int width) {
    for (int x = 0; x < width; ++x)
        if constexpr (std::is_same_v<Pixel, cv::Vec3b>)
            to[x] = {row[3 * x + 2], row[3 * x + 1], row[3 * x]};
        else if constexpr (sizeof(Pixel) == 2)
            to[x] = static_cast<Pixel>(row[2 * x] << 8 | row[2 * x + 1]);
        else
            to[x] = row[x];
}

/// The image; empty where the stream is unsound.
template <class Pixel>
cv::Mat image_from(std::string_view packed, cv::Size size) {
    constexpr int pixel = sizeof(Pixel);
    constexpr std::size_t band_bytes = 1 << 20;
    const int length = size.width * pixel;
    const std::size_t with_filter = static_cast<std::size_t>(length) + 1;
    const auto rows_at_once =
        static_cast<int>(std::clamp<std::size_t>(band_bytes / with_filter, 1, static_cast<std::size_t>(size.height)));
    const auto band =
        std::make_unique_for_overwrite<std::uint8_t[]>(static_cast<std::size_t>(rows_at_once) * with_filter);
    Unpacker unpacker(packed);
    const auto two_rows = std::make_unique<std::uint8_t[]>(2 * static_cast<std::size_t>(length + pixel));
    std::uint8_t *above = two_rows.get() + pixel, *row = above + length + pixel;
    cv::Mat_<Pixel> image(size);
    const std::uint8_t* filtered = nullptr;
    for (int y = 0; y < size.height; ++y, filtered += length + 1) {
        if (y % rows_at_once == 0) {
            const auto rows = static_cast<std::size_t>(std::min(rows_at_once, size.height - y));
            if (!unpacker.next(band.get(), rows * with_filter))
                return {};
            filtered = band.get();
        }
        if (!unfilter<pixel>(filtered[0], filtered + 1, above, row, length))
            return {};
        store_row(row, image[y], size.width);
        std::swap(above, row);
    }
    if (!unpacker.ends())
        return {};
    return image;
}

} // namespace

cv::Mat decoded_plain_png(std::string_view bytes) {
    constexpr std::size_t bits_at = 24, colour_at = 25, interlaced_at = 28; // methods between have one value each
    constexpr int grey = 0, rgb = 2;
    const auto bits = static_cast<unsigned char>(bytes[bits_at]), colour = static_cast<unsigned char>(bytes[colour_at]);
    const bool usual_methods = bytes[26] == 0 && bytes[27] == 0 && bytes[interlaced_at] == 0;
    const bool usual_samples = (colour == grey && (bits == 8 || bits == 16)) || (colour == rgb && bits == 8);
    if (!usual_methods || !usual_samples)
        return {};
    const cv::Size size(static_cast<int>(big_endian_32(bytes, 16)), static_cast<int>(big_endian_32(bytes, 20)));
    const Packed packed = packed_pixels(bytes);
    if (!packed.plain || packed.bytes.size() > std::numeric_limits<std::uint32_t>::max())
        return {};
    return colour == rgb ? image_from<cv::Vec3b>(packed.bytes, size)
           : bits == 16  ? image_from<std::uint16_t>(packed.bytes, size)
                         : image_from<std::uint8_t>(packed.bytes, size);
}

} // namespace scanshade
