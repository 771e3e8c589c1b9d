// Meshes whose files can show textures: their coordinates, and the files again with links to images.
#pragma once

#include "io/clouds/cloud_file.h"
#include "io/clouds/meshes/mesh_file.h"

namespace scanshade {

/// The mesh of a cloud with its texture coordinates. Triangles are those of triangles_of(). Throws Error naming `file`
/// where there are no faces, or no coordinates.
[[nodiscard]] TexturedMesh textured_mesh(const Cloud& cloud, const std::filesystem::path& file);

/// The cloud's file again, `name` without extension, with links to images, as its format can have them (linked_obj(),
/// linked_gltf()); a PLY as it is.
[[nodiscard]] LinkedFiles linked_mesh(const Cloud& cloud, const std::filesystem::path& file, const std::string& name,
                                      const TexturedMesh& mesh, std::span<const OcclusionLink> links, bool replace);

/// Whether the format's files hold their images as PNG of 8 bits.
[[nodiscard]] bool holds_images(const Cloud& cloud);

// Of the formats.
[[nodiscard]] TexturedMesh ply_texture(const CloudRecords& records, const std::filesystem::path& file);
[[nodiscard]] TexturedMesh obj_texture(const CloudRecords& records, const std::filesystem::path& file);
[[nodiscard]] TexturedMesh gltf_texture(const CloudRecords& records, const std::filesystem::path& file);

/// What a format makes of links.
struct LinkRequest {
    const CloudRecords& records;
    const std::filesystem::path& file;
    const std::string& name;
    const TexturedMesh& mesh;
    std::span<const OcclusionLink> links;
    bool replace;
};
[[nodiscard]] LinkedFiles with_ply_links(const LinkRequest& asked);
[[nodiscard]] LinkedFiles with_obj_links(const LinkRequest& asked);
[[nodiscard]] LinkedFiles with_gltf_links(const LinkRequest& asked);

} // namespace scanshade
