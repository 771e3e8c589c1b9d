// The table of image formats: names, signatures, extensions, readers and writers. No other code tells formats apart. A
// new format is a row in format.cpp and a file beside it.
#pragma once

#include "io/images/image_check.h"

#include <array>
#include <filesystem>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

struct ImageFormat {
    std::string_view name;                      ///< "PNG"
    bool (*signature)(std::string_view start);  ///< whether a file that begins so is of this format
    std::array<std::string_view, 2> extensions; ///< lower case, with the dot; empty: none
    std::size_t header_bytes;                   ///< the header is in this many first bytes
    std::string_view depth = {};                ///< the numbers that stand for depth, where it holds any
    std::string_view no_depth = {};             ///< why the format cannot hold depth, where its header does not tell
    bool unit_is_arbitrary = false;             ///< its depth is in the unit of a reconstruction from images

    // Each throws Error, which names `file` and what is wrong, for anything that is damaged or cut short.
    ImageFacts (*header)(std::string_view bytes, const std::filesystem::path& file);
    /// One channel of 8- or 16-bit integers or floats, as stored. None: the format holds no such image.
    cv::Mat (*read_stored)(std::string_view bytes, const ImageFacts& facts,
                           const std::filesystem::path& file) = nullptr;
    /// 8-bit BGR, from grey and 16 bits, too. None: the format holds floats.
    cv::Mat3b (*read_colour)(std::string_view bytes, const ImageFacts& facts,
                             const std::filesystem::path& file) = nullptr;
    /// 16-bit BGR of a file whose samples have 16 bits; empty where this one's are not read so. None: 8 bits at most.
    cv::Mat3w (*read_deep_colour)(std::string_view bytes, const ImageFacts& facts,
                                  const std::filesystem::path& file) = nullptr;
    /// The file's bytes. Throws Error for a type of image that the format does not hold. None: not written.
    std::string (*written)(const cv::Mat& image) = nullptr;
};

[[nodiscard]] std::span<const ImageFormat> image_formats();
/// The format by signature, from the first 16 bytes; none where it is unknown.
[[nodiscard]] const ImageFormat* image_format(std::string_view bytes);
/// "PNG", "JPEG" ..., or "unknown".
[[nodiscard]] std::string_view name_of(const ImageFormat* format);
/// The format whose files have this extension (lower case, with the dot); none where it is unknown.
[[nodiscard]] const ImageFormat* image_format_by_extension(std::string_view extension);

/// Whether the name is that of an image that may hold depth, or colour.
[[nodiscard]] bool has_depth_extension(const std::filesystem::path& file);
[[nodiscard]] bool has_colour_extension(const std::filesystem::path& file);
[[nodiscard]] std::vector<std::string_view> depth_format_names();
[[nodiscard]] std::vector<std::string_view> colour_format_names();

/// The facts of the header, from the first header_bytes of the file or more. Throws Error naming `file` for a header
/// that is cut short or absurd.
[[nodiscard]] ImageFacts read_image_header(std::string_view bytes, const std::filesystem::path& file);
/// The same for a file on disk; reads no more than the header.
[[nodiscard]] ImageFacts peek(const std::filesystem::path& image);

} // namespace scanshade
