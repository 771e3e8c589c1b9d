// The table of image formats, and the questions that it answers.
#include "io/images/format.h"

#include "io/images/png_output.h"
#include "io/images/readers.h"
#include "io/text.h"

#include <algorithm>
#include <cctype>

namespace scanshade {

namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;

template <char... characters>
bool begins_with(std::string_view start) {
    constexpr char signature[] = {characters...};
    return start.starts_with(std::string_view(signature, sizeof...(characters)));
}

/// "P" and one of the kinds, then white space.
template <char... kinds>
bool is_netpbm(std::string_view start) {
    const bool netpbm = start.size() > 2 && start[0] == 'P' && std::isspace(static_cast<unsigned char>(start[2]));
    return netpbm && ((start[1] == kinds) || ...);
}

bool is_tiff(std::string_view start) { return start.starts_with("II*\0"sv) || start.starts_with("MM\0*"sv); }
bool is_webp(std::string_view start) {
    return start.starts_with("RIFF"sv) && start.substr(std::min<std::size_t>(8, start.size())).starts_with("WEBP"sv);
}

constexpr std::size_t short_header = 1 << 16, all = SIZE_MAX;

constexpr ImageFormat formats[] = {
    {.name = "PNG",
     .signature = &begins_with<'\x89', 'P', 'N', 'G', '\r', '\n', '\x1a', '\n'>,
     .extensions = {".png"},
     .header_bytes = short_header,
     .depth = "16-bit integers",
     .header = &images::png_header,
     .read_stored = &images::stored_png,
     .read_colour = &images::colour_png,
     .read_deep_colour = &images::deep_png,
     .written = &encoded_png},
    {.name = "PGM",
     .signature = &is_netpbm<'5'>,
     .extensions = {".pgm"},
     .header_bytes = short_header,
     .depth = "16-bit integers",
     .header = &images::netpbm_header,
     .read_stored = &images::stored_pgm,
     .read_colour = &images::colour_netpbm},
    {.name = "TIFF",
     .signature = &is_tiff,
     .extensions = {".tif", ".tiff"},
     .header_bytes = all, // its directory may lie at the end
     .depth = "16-bit integers, floats",
     .header = &images::tiff_header,
     .read_stored = &images::stored_tiff,
     .read_colour = &images::colour_tiff,
     .read_deep_colour = &images::deep_tiff,
     .written = &images::encoded_tiff},
    {.name = "EXR",
     .signature = &begins_with<'\x76', '\x2f', '\x31', '\x01'>,
     .extensions = {".exr"},
     .header_bytes = all,
     .depth = "floats: its only channel, or the one called Z or depth",
     .header = &images::exr_header,
     .read_stored = &images::stored_exr,
     .written = &images::encoded_exr},
    {.name = "PFM",
     .signature = &is_netpbm<'f', 'F'>,
     .extensions = {".pfm"},
     .header_bytes = short_header,
     .depth = "floats",
     .header = &images::netpbm_header,
     .read_stored = &images::stored_pfm},
    {.name = "PCLZF",
     .signature = &begins_with<'P', 'C', 'L', 'Z', 'F'>,
     .extensions = {".pclzf"},
     .header_bytes = short_header,
     .depth = "16-bit integers; its unit and camera in an XML file beside it",
     .header = &images::pclzf_header,
     .read_stored = &images::stored_pclzf,
     .read_colour = &images::colour_pclzf},
    {.name = "npy",
     .signature = &begins_with<'\x93', 'N', 'U', 'M', 'P', 'Y'>,
     .extensions = {".npy"},
     .header_bytes = short_header,
     .depth = "integers, floats",
     .header = &images::npy_header,
     .read_stored = &images::stored_npy},
    {.name = "COLMAP's depth map",
     .signature = &images::is_colmap_map,
     .extensions = {".geometric.bin", ".photometric.bin"},
     .header_bytes = short_header,
     .depth = "floats in the reconstruction's own unit",
     .unit_is_arbitrary = true,
     .header = &images::colmap_map_header,
     .read_stored = &images::stored_colmap_map},
    {.name = "JPEG",
     .signature = &begins_with<'\xff', '\xd8', '\xff'>,
     .extensions = {".jpg", ".jpeg"},
     .header_bytes = all, // thumbnails and colour profiles come before it
     .no_depth = "JPEG, which is 8-bit and lossy and cannot hold depth",
     .header = &images::jpeg_header,
     .read_colour = &images::colour_jpeg,
     .written = &images::encoded_jpeg},
    {.name = "PPM",
     .signature = &is_netpbm<'6'>,
     .extensions = {".ppm"},
     .header_bytes = short_header,
     .header = &images::netpbm_header,
     .read_colour = &images::colour_netpbm,
     .read_deep_colour = &images::deep_netpbm},
    {.name = "Netpbm", // its other kinds: bits, text and PAM
     .signature = &is_netpbm<'1', '2', '3', '4', '7'>,
     .extensions = {},
     .header_bytes = short_header,
     .no_depth = "a Netpbm kind other than binary grey (P5)",
     .header = &images::netpbm_header,
     .read_colour = &images::colour_netpbm,
     .read_deep_colour = &images::deep_netpbm},
    {.name = "BMP",
     .signature = &begins_with<'B', 'M'>,
     .extensions = {".bmp"},
     .header_bytes = short_header,
     .header = &images::bmp_header,
     .read_colour = &images::colour_bmp},
    {.name = "WebP",
     .signature = &is_webp,
     .extensions = {".webp"},
     .header_bytes = short_header,
     .header = &images::webp_header,
     .read_colour = &images::colour_webp},
};

/// ".geometric.bin"
std::string two_extensions(const fs::path& file) { return lower_extension(file.stem()) + lower_extension(file); }

bool holds_depth(const ImageFormat& format) { return format.read_stored != nullptr; }
bool holds_colour(const ImageFormat& format) { return format.read_colour != nullptr; }

std::vector<std::string_view> names_of_those(bool (*wanted)(const ImageFormat&)) {
    std::vector<std::string_view> names;
    for (const ImageFormat& format : formats)
        if (wanted(format))
            names.push_back(format.name);
    return names;
}

} // namespace

std::span<const ImageFormat> image_formats() { return formats; }

const ImageFormat* image_format(std::string_view bytes) {
    const auto found =
        std::ranges::find_if(formats, [&](const ImageFormat& format) { return format.signature(bytes); });
    return found == std::end(formats) ? nullptr : found;
}

std::string_view name_of(const ImageFormat* format) { return format ? format->name : "unknown"; }

const ImageFormat* image_format_by_extension(std::string_view extension) {
    const auto found = std::ranges::find_if(formats, [&](const ImageFormat& format) {
        return !extension.empty() && std::ranges::find(format.extensions, extension) != format.extensions.end();
    });
    return found == std::end(formats) ? nullptr : found;
}

bool has_depth_extension(const fs::path& file) {
    const ImageFormat* format = image_format_by_extension(lower_extension(file));
    format = format ? format : image_format_by_extension(two_extensions(file));
    return format && holds_depth(*format);
}
bool has_colour_extension(const fs::path& file) {
    const ImageFormat* format = image_format_by_extension(lower_extension(file));
    return format && holds_colour(*format);
}
std::vector<std::string_view> depth_format_names() { return names_of_those(&holds_depth); }
std::vector<std::string_view> colour_format_names() { return names_of_those(&holds_colour); }

ImageFacts read_image_header(std::string_view bytes, const fs::path& file) {
    if (bytes.empty())
        image_check::refuse(file, "empty file (0 bytes), expected an image");
    const ImageFormat* format = image_format(bytes);
    ImageFacts facts = format ? format->header(bytes, file) : ImageFacts();
    facts.format = format;
    return facts;
}

ImageFacts peek(const fs::path& image) {
    const std::string start = read_bytes(image, short_header);
    const ImageFormat* format = image_format(start);
    return read_image_header(format && format->header_bytes > short_header ? read_bytes(image) : start, image);
}

} // namespace scanshade
