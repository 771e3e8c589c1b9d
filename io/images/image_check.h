// The facts of an image file's header, and the checks that every reader makes before it decodes anything.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string_view>

namespace scanshade {

struct ImageFormat;

/// Facts from the header.
struct ImageFacts {
    const ImageFormat* format = nullptr; ///< none: unknown, and the other fields mean nothing
    cv::Size size;
    int bits = 0; ///< per sample
    int channels = 0;
    bool floats = false;
};

/// More pixels than this are refused before anything is allocated.
constexpr std::uint64_t most_pixels = std::uint64_t(1) << 28;

namespace image_check {
/// The image size, or Error when a side is 0 or there are more than most_pixels.
[[nodiscard]] cv::Size checked_size(std::uint64_t width, std::uint64_t height, const std::filesystem::path& file);
/// Throws Error if `packed` coded bytes are too few for an image of that size, when one byte becomes at most `most`.
/// So a small file cannot claim much memory. Throws OutOfMemory where an image of that size does not fit.
void check_expansion(std::uint64_t packed, std::uint64_t most, const ImageFacts& facts, int stored_channels,
                     const std::filesystem::path& file);
[[nodiscard]] std::uint32_t big_endian_32(std::string_view bytes, std::size_t offset);
[[nodiscard]] std::uint32_t little_endian_32(std::string_view bytes, std::size_t offset);
[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& why);
} // namespace image_check

} // namespace scanshade
