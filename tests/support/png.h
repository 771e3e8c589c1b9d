// PNG files put together by hand, sound or not.
#pragma once

#include <cstdint>
#include <string>
#include <zlib.h>

namespace scanshade::tests {

inline std::string big_endian(std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8)
        bytes += static_cast<char>(value >> shift);
    return bytes;
}

inline std::string png_chunk(const std::string& type, const std::string& data) {
    const std::string covered = type + data;
    const auto sum = crc32(0, reinterpret_cast<const Bytef*>(covered.data()), static_cast<uInt>(covered.size()));
    return big_endian(static_cast<std::uint32_t>(data.size())) + covered + big_endian(static_cast<std::uint32_t>(sum));
}

inline std::string compressed(const std::string& raw) {
    uLongf length = compressBound(static_cast<uLong>(raw.size()));
    std::string packed(length, '\0');
    compress(reinterpret_cast<Bytef*>(packed.data()), &length, reinterpret_cast<const Bytef*>(raw.data()),
             static_cast<uLong>(raw.size()));
    packed.resize(length);
    return packed;
}

/// A PNG of sound chunks. `rows` rows of 8 grey 16-bit pixels follow, whatever the header says.
inline std::string png(std::uint32_t width, std::uint32_t height, int bits, int colour_type, int rows) {
    const std::string header = big_endian(width) + big_endian(height) + static_cast<char>(bits) +
                               static_cast<char>(colour_type) + std::string(3, '\0');
    const std::string raw(static_cast<std::size_t>(rows) * 17, '\x01'); // filter 1, then samples
    return std::string("\x89PNG\r\n\x1a\n") + png_chunk("IHDR", header) + png_chunk("IDAT", compressed(raw)) +
           png_chunk("IEND", "");
}

} // namespace scanshade::tests
