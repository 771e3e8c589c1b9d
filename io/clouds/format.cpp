// The table of cloud formats, and the questions that it answers.
#include "io/clouds/format.h"

#include "io/clouds/mesh_textures.h"
#include "io/clouds/packed_splats.h"
#include "io/images/format.h"
#include "io/text.h"

#include <algorithm>

namespace scanshade {

namespace {

namespace fs = std::filesystem;

/// Its first line is "ply", however it ends.
bool is_ply(std::string_view start) {
    return start.starts_with("ply") && trimmed(start.substr(0, start.find_first_of("\r\n"))) == "ply" &&
           start.find_first_of("\r\n") != std::string_view::npos;
}
/// PLY whose positions are packed as PlayCanvas does it.
bool is_packed_ply(std::string_view start) {
    return is_ply(start) &&
           start.substr(0, start.find("end_header")).find(" packed_position") != std::string_view::npos;
}
bool is_las(std::string_view start) { return start.starts_with("LASF"); }
/// A LAS file whose point format has the bit of compression.
bool is_laz(std::string_view start) {
    constexpr std::size_t at_point_format = 104;
    return is_las(start) && start.size() > at_point_format && (start[at_point_format] & 0xc0) != 0;
}
bool is_e57(std::string_view start) { return start.starts_with("ASTM-E57"); }

/// PCD's own comment, or the first line of its header behind others.
bool is_pcd(std::string_view start) {
    if (start.starts_with("# .PCD"))
        return true;
    while (start.starts_with('#'))
        start.remove_prefix(std::min(start.find('\n'), start.size() - 1) + 1);
    return start.starts_with("VERSION") || start.starts_with("FIELDS") || start.starts_with("COLUMNS");
}

// Names come before PCD's signature: lists of points may begin with comments and names of columns, too.
constexpr CloudFormat formats[] = {
    {.name = "packed PLY",
     .content = "Gaussian splats of PlayCanvas and SuperSplat; values go to `NAME.ao.ply`",
     .signature = &is_packed_ply,
     .extensions = {".ply"},
     .read = &read_compressed_ply,
     .shaded = &shaded_compressed_ply},
    {.name = "PLY",
     .content = "ascii, both byte orders; meshes, too; Gaussian splats",
     .signature = &is_ply,
     .extensions = {".ply"},
     .read = &read_ply,
     .written = &ply_bytes,
     .shape = &ply_shape,
     .triangles = &ply_triangles,
     .textured = &ply_texture,
     .linked = &with_ply_links,
     .binary_encoding = "binary_little_endian",
     .new_colours = NewColours::bytes},
    {.name = "LAZ",
     .content = "1.0-1.4 compressed, and COPC",
     .signature = &is_laz,
     .extensions = {".laz"},
     .read = &read_las,
     .written = &las_bytes,
     .shape = &las_shape,
     .wide_colours = true,
     .z_up = true},
    {.name = "LAS",
     .content = "1.0-1.4",
     .signature = &is_las,
     .extensions = {".las"},
     .read = &read_las,
     .written = &las_bytes,
     .shape = &las_shape,
     .wide_colours = true,
     .z_up = true},
    {.name = "E57",
     .content = "all scans, each placed by its pose",
     .signature = &is_e57,
     .extensions = {".e57"},
     .written_extension = ".ply", // with all fields
     .read = &read_e57,
     .written = &ply_bytes,
     .binary_encoding = "binary_little_endian",
     .new_colours = NewColours::bytes,
     .z_up = true},
    {.name = "OBJ",
     .content = "meshes, with MTL; points with colours",
     .extensions = {".obj"},
     .written_extension = ".ply", // which has fields
     .read = &read_obj_cloud,
     .written = &ply_bytes,
     .triangles = &ply_triangles,
     .textured = &obj_texture,
     .linked = &with_obj_links,
     .binary_encoding = "binary_little_endian",
     .new_colours = NewColours::bytes},
    {.name = "splat GLB",
     .content = "Gaussian splats (KHR_gaussian_splatting, ellipses) of binary glTF; values are attributes",
     .signature = &is_splat_glb,
     .extensions = {".glb"},
     .read = &read_splat_glb,
     .written = &splat_glb_bytes,
     .shaded = &shaded_splat_glb},
    {.name = "GLB",
     .content = "binary glTF 2.0: meshes and points of its scene, y up; uncompressed",
     .signature = &is_glb,
     .extensions = {".glb"},
     .written_extension = ".ply",
     .read = &read_gltf_cloud,
     .written = &ply_bytes,
     .triangles = &ply_triangles,
     .textured = &gltf_texture,
     .linked = &with_gltf_links,
     .binary_encoding = "binary_little_endian",
     .new_colours = NewColours::bytes},
    {.name = "glTF",
     .content = "the same as JSON",
     .extensions = {".gltf"},
     .written_extension = ".ply",
     .read = &read_gltf_cloud,
     .written = &ply_bytes,
     .triangles = &ply_triangles,
     .textured = &gltf_texture,
     .linked = &with_gltf_links,
     .binary_encoding = "binary_little_endian",
     .new_colours = NewColours::bytes},
    {.name = "XYZ",
     .content = "lines of numbers",
     .extensions = {".xyz"},
     .read = &read_xyz,
     .written = &text_bytes,
     .new_colours = NewColours::bytes,
     .z_up = true},
    {.name = "PTS",
     .content = "lines of numbers",
     .extensions = {".pts"},
     .read = &read_xyz,
     .written = &text_bytes,
     .new_colours = NewColours::bytes,
     .z_up = true},
    {.name = "PTX",
     .content = "organised scans with their poses, posed into one cloud",
     .extensions = {".ptx"},
     .read = &read_ptx,
     .written = &text_bytes,
     .new_colours = NewColours::bytes,
     .z_up = true},
    {.name = "KITTI's .bin",
     .content = "floats x y z intensity; nuScenes' `.pcd.bin` with a ring",
     .extensions = {".bin"},
     .written_extension = ".ply", // with a header
     .read = &read_kitti,
     .written = &ply_bytes,
     .binary_encoding = "binary_little_endian",
     .new_colours = NewColours::bytes,
     .z_up = true},
    {.name = "SPZ",
     .content = "Gaussian splats, versions 2-4; values go to `NAME.ao.ply`",
     .signature = &is_spz,
     .extensions = {".spz"},
     .read = &read_spz,
     .shaded = &shaded_spz},
    {.name = "splat",
     .content = "Gaussian splats of 32 bytes; values go to `NAME.ao.ply`",
     .extensions = {".splat"},
     .read = &read_splat,
     .shaded = &shaded_splat},
    {.name = "PCD",
     .content = "ascii, binary, compressed",
     .signature = &is_pcd,
     .extensions = {".pcd"},
     .read = &read_pcd,
     .written = &pcd_bytes,
     .shape = &pcd_shape,
     .new_colours = NewColours::packed},
    {.name = "text", // S3DIS, Semantic3D, and what programs call .txt, .asc or .csv
     .content = "lines of x y z [intensity] [red green blue] [nx ny nz], or with names; eight or more; CSV, too",
     .signature = &is_text_cloud,
     .extensions = {},
     .written_extension = ".xyz",
     .read = &read_xyz,
     .written = &text_bytes,
     .new_colours = NewColours::bytes,
     .z_up = true},
};

bool named_so(const CloudFormat& format, const fs::path& file) {
    const std::string extension = lower_extension(file);
    return !extension.empty() && std::ranges::find(format.extensions, extension) != format.extensions.end();
}

} // namespace

const CloudFormat* cloud_format(std::string_view bytes, const fs::path& file) {
    const auto found = std::ranges::find_if(formats, [&](const CloudFormat& format) {
        return format.signature ? format.signature(bytes) : named_so(format, file);
    });
    return found == std::end(formats) ? nullptr : found;
}

std::span<const CloudFormat> cloud_formats() { return formats; }

bool has_cloud_extension(const fs::path& file) {
    return std::ranges::any_of(formats, [&](const CloudFormat& format) { return named_so(format, file); });
}

bool is_cloud(std::string_view start, const fs::path& file) {
    return !image_format(start) && (cloud_format(start, file) || has_cloud_extension(file));
}

std::vector<std::string_view> cloud_format_names() {
    std::vector<std::string_view> names;
    for (const CloudFormat& format : formats)
        names.push_back(format.name);
    return names;
}

std::string_view written_extension(const CloudFormat& format) {
    return format.written_extension.empty() ? format.extensions[0] : format.written_extension;
}

std::string plain_laz_name(const std::string& name) {
    constexpr std::string_view copc = ".copc";
    return lower_extension(name) == copc ? name.substr(0, name.size() - copc.size()) + ".plain" : name;
}

std::vector<std::string_view> written_cloud_extensions() {
    std::vector<std::string_view> extensions;
    for (const CloudFormat& format : formats)
        if ((format.written || format.shaded) &&
            std::ranges::find(extensions, written_extension(format)) == extensions.end())
            extensions.push_back(written_extension(format));
    return extensions;
}

} // namespace scanshade
