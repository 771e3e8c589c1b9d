// Colour, depth and AO images on disk; the only place that knows their formats and stored units.
#pragma once

#include "io/images/image_check.h"

#include <array>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>

namespace scanshade {

/// How stored depth numbers become metres. `origin` says where this comes from, even if it is assumed.
struct DepthEncoding {
    enum class Kind {
        linear,        ///< metres = value / units_per_metre; 0 and 65535 (integers), NaN, inf and <= 0 (floats) = hole
        sun_rotated,   ///< SUN RGB-D: 16-bit value rotated right by 3 bits is millimetres
        nyu_disparity, ///< NYUv2 raw: bytes swapped, Kinect disparity d; metres = 351.3 / (1092.5 - d); 2047 = hole
    };
    Kind kind = Kind::linear;
    double units_per_metre = 1000;
    std::string name;     ///< "mm", "tum", "sun", "nyu", "m" or the number
    std::string origin;   ///< "TUM layout", "--depth-scale", "assumed: 16-bit integers are millimetres" ...
    bool stated = true;   ///< by the user or a file; otherwise it is what the layout's recordings usually have
    bool by_hand = false; ///< by the user, who may be wrong where a file is not
    /// Nothing says how long a unit is, as in a reconstruction from images. Then the walk's lengths are no metres, but
    /// parts of the scene: see Capture::unit.
    bool arbitrary = false;
};

/// Of stored numbers in an arbitrary unit, of which so many are one of the walk's lengths.
[[nodiscard]] DepthEncoding arbitrary_encoding(const std::string& origin, double units_per_length = 1);

/// "mm" (1000), "tum" (5000), "sun", "nyu", "m" (1, float files), or a positive number of units per metre.
/// Throws Misuse listing these.
[[nodiscard]] DepthEncoding depth_encoding(const std::string& text, const std::string& origin);

/// The numbers as stored, one channel: CV_16U (PNG, PGM, TIFF, PCLZF) or CV_32F metres (TIFF, EXR, PFM).
/// The format is told by the file's signature, not its name. Throws Error naming the file and what was expected for:
/// missing or empty file, truncation (with byte counts or offset), checksum errors, 8-bit depth, colour images, JPEG,
/// more than 2^28 pixels (before allocating), PGM size or maxval that do not fit the bytes.
[[nodiscard]] cv::Mat read_stored_depth(const std::filesystem::path& file);

/// The same of an image's bytes, from wherever they are; `name` stands for the file in messages.
[[nodiscard]] cv::Mat stored_depth_in(const std::string& bytes, const std::filesystem::path& name);

/// Stored numbers -> metres, 0 = hole. Throws Error when the encoding needs integers and the file holds floats, or the
/// reverse.
[[nodiscard]] cv::Mat1f depth_in_metres(const cv::Mat& stored, const DepthEncoding& encoding);

/// 8-bit BGR; 16-bit and grey are converted. Throws Error naming the file when it is missing, damaged or truncated.
[[nodiscard]] cv::Mat3b read_colour(const std::filesystem::path& file);

/// The same of an image's bytes.
[[nodiscard]] cv::Mat3b colour_in(const std::string& bytes, const std::filesystem::path& name);

/// A colour image, and the same with 16 bits where its file has them.
struct StoredColour {
    cv::Mat3b colour;
    cv::Mat3w deep; ///< BGR; empty where the samples have 8 bits
};
/// As read_colour() and colour_in().
[[nodiscard]] StoredColour read_stored_colour(const std::filesystem::path& file);
[[nodiscard]] StoredColour stored_colour_in(const std::string& bytes, const std::filesystem::path& name);

enum class AoFormat { png16, png8, tiff, exr };
struct AoFormatRow {
    const char* name; ///< of --format
    AoFormat format;
    int depth; ///< OpenCV's, of the samples
    std::string_view extension;
    std::string_view content; ///< the numbers that stand for visibility
};
inline constexpr std::array ao_formats = {
    AoFormatRow{"png16", AoFormat::png16, CV_16U, ".png", "16-bit integers, 0 = no surface"},
    AoFormatRow{"png8", AoFormat::png8, CV_8U, ".png", "8-bit integers, 0 = no surface"},
    AoFormatRow{"tiff", AoFormat::tiff, CV_32F, ".tiff", "floats, NaN = no surface"},
    AoFormatRow{"exr", AoFormat::exr, CV_32F, ".exr", "floats, NaN = no surface"},
};
[[nodiscard]] constexpr bool is_float(AoFormat format) { return format == AoFormat::tiff || format == AoFormat::exr; }
/// Throws Misuse listing the names.
[[nodiscard]] AoFormat ao_format(const std::string& name);
/// ".png", ".tiff" or ".exr".
[[nodiscard]] std::string extension(AoFormat format);
/// Whether an image with these facts is in one of those formats, and the name that of a file in one of them.
[[nodiscard]] bool is_ao_map(const ImageFacts& facts);
[[nodiscard]] bool has_ao_extension(const std::filesystem::path& file);

/// Writes visibility. Integers: 0 = no surface, 1 .. max = visibility 0 .. 1 (so 1 + round(v (max - 1))); floats keep
/// NaN. Atomic; fast compression.
void write_ao(const std::filesystem::path& file, const cv::Mat1f& visibility, AoFormat format);
/// The integers of png16 or png8.
[[nodiscard]] cv::Mat ao_integers(const cv::Mat1f& visibility, AoFormat format);
/// The same where they are integers already, 8 or 16 bits: a PNG.
void write_ao_integers(const std::filesystem::path& file, const cv::Mat& integers);
/// The reverse of write_ao (format told by signature and bit depth): NaN = no surface.
[[nodiscard]] cv::Mat1f read_ao(const std::filesystem::path& file);

/// Linear light, blue first, 1 = white. Integers hold it with sRGB's curve, 0 .. 1; floats as it is, in Rec. 709
/// primaries, which are sRGB's. Atomic.
void write_light(const std::filesystem::path& file, const cv::Mat3f& light, AoFormat format);

/// 8-bit BGR picture in the format that the extension names, if that is one that is written. Atomic.
void write_picture(const std::filesystem::path& file, const cv::Mat3b& picture);
/// 16-bit integer depth as PNG (value = round(metres * units_per_metre), 0 = hole). Atomic.
void write_depth_png(const std::filesystem::path& file, const cv::Mat1f& depth_m, double units_per_metre);
/// 32-bit float image of one or three channels (OpenCV's order: stored last one first) as TIFF. Atomic.
void write_float_tiff(const std::filesystem::path& file, const cv::Mat& image);

} // namespace scanshade
