// Meshes of other formats as clouds: the records of a PLY with faces, which is also what is written of them.
#include "io/clouds/cloud_records.h"
#include "io/clouds/format.h"
#include "io/clouds/mesh_textures.h"
#include "projection/base/error.h"

#include <array>
#include <bit>
#include <cstdint>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

template <class Number>
void append_bits(std::string& bytes, Number value) {
    const auto raw = std::bit_cast<std::array<char, sizeof(Number)>>(value);
    bytes.append(raw.data(), raw.size());
}

/// `bytes` stay beside the records: textures are made of them.
CloudRecords records_of(const MeshFile& mesh, const char* format, std::string_view bytes) {
    CloudRecords records;
    const bool coloured = !mesh.colours.empty();
    for (const char* name : {"x", "y", "z"})
        records.fields.push_back({name, Scalar::float64, 1, std::nullopt, 0});
    for (const char* name : {"red", "green", "blue"})
        if (coloured)
            records.fields.push_back({name, Scalar::uint8, 1, std::nullopt, 0});
    records.header = fmt::format("ply\nformat binary_little_endian 1.0\ncomment from {}\nelement vertex {}\n", format,
                                 mesh.points.size());
    for (CloudField& field : records.fields) {
        field.offset = records.stride;
        records.stride += field.bytes();
        records.header += fmt::format("property {} {}\n", field.type == Scalar::uint8 ? "uchar" : "double", field.name);
    }
    if (!mesh.mesh.triangles.empty())
        records.header +=
            fmt::format("element face {}\nproperty list uchar int vertex_indices\n", mesh.mesh.triangles.size());
    records.header += "end_header\n";
    records.point_count = mesh.points.size();
    records.grid = {static_cast<int>(mesh.points.size()), 1};
    records.points.reserve(records.stride * mesh.points.size());
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        for (const double coordinate : mesh.points[i])
            append_bits(records.points, coordinate);
        for (const int channel : {2, 1, 0})
            if (coloured)
                append_bits(records.points, mesh.colours[i][channel]);
    }
    for (const std::array<int, 3>& triangle : mesh.mesh.triangles) {
        append_bits(records.after, std::uint8_t(3));
        for (const int corner : triangle)
            append_bits(records.after, corner);
    }
    records.packed = bytes;
    return records;
}

} // namespace

CloudRecords read_obj_cloud(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    return records_of(read_obj(bytes, file, warnings), "OBJ", bytes);
}

CloudRecords read_gltf_cloud(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    return records_of(read_gltf(bytes, file, warnings), "glTF, y up", bytes);
}

TexturedMesh obj_texture(const CloudRecords& records, const fs::path& file) {
    std::vector<std::string> heard; // when the file was read as a cloud
    return read_obj(records.packed, file, heard).mesh;
}

TexturedMesh gltf_texture(const CloudRecords& records, const fs::path& file) {
    std::vector<std::string> heard;
    return read_gltf(records.packed, file, heard).mesh;
}

LinkedFiles with_obj_links(const LinkRequest& asked) {
    return linked_obj(asked.records.packed, asked.file, asked.name, asked.mesh, asked.links);
}

LinkedFiles with_gltf_links(const LinkRequest& asked) {
    return linked_gltf(asked.records.packed, asked.file, asked.name, asked.mesh, asked.links, asked.replace);
}

TexturedMesh textured_mesh(const Cloud& cloud, const fs::path& file) {
    TexturedMesh mesh;
    if (cloud.records && cloud.records->format->textured)
        mesh = cloud.records->format->textured(*cloud.records, file);
    if (mesh.triangles.empty())
        throw Error(file.string() + ": no mesh, so no texture; expected faces");
    if (mesh.sets.empty())
        throw Error(file.string() +
                    ": the mesh has no texture coordinates, so no texture; unwrap it, or use the values "
                    "of its vertices (--write cloud)");
    return mesh;
}

LinkedFiles linked_mesh(const Cloud& cloud, const fs::path& file, const std::string& name, const TexturedMesh& mesh,
                        std::span<const OcclusionLink> links, bool replace) {
    return cloud.records->format->linked({*cloud.records, file, name, mesh, links, replace});
}

bool holds_images(const Cloud& cloud) { return cloud.records && is_glb(cloud.records->packed); }

} // namespace scanshade
