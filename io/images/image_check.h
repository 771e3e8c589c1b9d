// What an image file's container says, checked before anything is decoded: decoders hand out half images without a
// word.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string_view>

namespace scanshade {

enum class ImageFormat { unknown, png, jpeg, pgm, ppm, other_netpbm, pfm, tiff, exr, bmp, webp, pclzf };

/// Facts from the header. Fields a format does not fix are left at 0.
struct ImageFacts {
    ImageFormat format = ImageFormat::unknown;
    cv::Size size;
    int bits = 0; ///< per sample
    int channels = 0;
    bool floats = false;
    bool big_endian = false;   ///< PFM
    std::size_t pixels_at = 0; ///< PGM, PPM, PFM and PCLZF: where the samples start
};

/// More pixels than this are refused before anything is allocated.
constexpr std::uint64_t most_pixels = std::uint64_t(1) << 28;

/// The format by signature.
[[nodiscard]] ImageFormat image_format(std::string_view bytes);
/// "PNG", "JPEG", ...
[[nodiscard]] std::string_view format_name(ImageFormat format);

/// Header only: works on the first few hundred bytes of PNG, JPEG (up to its size), PGM, PPM, PFM and PCLZF; TIFF and
/// EXR need the whole file. Throws Error naming `file` for a header that is cut short or absurd.
[[nodiscard]] ImageFacts read_image_header(std::string_view bytes, const std::filesystem::path& file);

/// Header and container: every chunk, checksum, strip and byte count. Throws Error naming `file` and the byte offset.
[[nodiscard]] ImageFacts check_image(std::string_view bytes, const std::filesystem::path& file);

namespace image_check { // one pair per format; check_image() chooses
[[nodiscard]] ImageFacts png_header(std::string_view bytes, const std::filesystem::path& file);
void check_png_chunks(std::string_view bytes, const std::filesystem::path& file, const ImageFacts& facts);
[[nodiscard]] ImageFacts tiff_facts(std::string_view bytes, const std::filesystem::path& file);
[[nodiscard]] ImageFacts exr_facts(std::string_view bytes, const std::filesystem::path& file);
[[nodiscard]] ImageFacts pclzf_header(std::string_view bytes, const std::filesystem::path& file);
void check_pclzf_block(std::string_view bytes, const std::filesystem::path& file, const ImageFacts& facts);

/// The image size, or Error when a side is 0 or there are more than most_pixels.
[[nodiscard]] cv::Size checked_size(std::uint64_t width, std::uint64_t height, const std::filesystem::path& file);
/// Error where `packed` bytes of coded data cannot become an image of that size, for no code makes more than `most`
/// bytes of one: a small file cannot ask for much memory.
void check_expansion(std::uint64_t packed, std::uint64_t most, const ImageFacts& facts, int stored_channels,
                     const std::filesystem::path& file);
[[nodiscard]] std::uint32_t big_endian_32(std::string_view bytes, std::size_t offset);
[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& why);
} // namespace image_check

} // namespace scanshade
