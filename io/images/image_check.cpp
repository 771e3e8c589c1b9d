// The checks that every image format's reader makes of its header.
#include "io/images/image_check.h"

#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <fmt/format.h>

namespace scanshade::image_check {

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
    require_memory(needed,
                   fmt::format("{}: an image of {}x{} pixels", file.string(), facts.size.width, facts.size.height));
}

std::uint32_t big_endian_32(std::string_view bytes, std::size_t offset) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i)
        value = value << 8 | static_cast<unsigned char>(bytes[offset + i]);
    return value;
}

std::uint32_t little_endian_32(std::string_view bytes, std::size_t offset) {
    return __builtin_bswap32(big_endian_32(bytes, offset));
}

} // namespace scanshade::image_check
