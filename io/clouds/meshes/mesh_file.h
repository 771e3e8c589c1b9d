// Meshes in files that are no clouds: OBJ with MTL, and glTF 2.0. Each is read whole, and written again with links to
// images of occlusion.
#pragma once

#include "projection/textured_mesh.h"

#include <cstddef>
#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

struct MeshFile {
    std::vector<Eigen::Vector3d> points;
    std::vector<cv::Vec3b> colours; ///< BGR, one per point, or empty
    TexturedMesh mesh;              ///< no triangles: the file has points alone
};

/// Wavefront OBJ (Alias, "Object Files", version 3.0): polygons, fanned from their first corner; points with colours.
/// Free-form surfaces and lines are left out with a warning. Throws Error naming the line.
[[nodiscard]] MeshFile read_obj(std::string_view bytes, const std::filesystem::path& file,
                                std::vector<std::string>& warnings);
/// glTF 2.0 (Khronos, ISO/IEC 12113), binary or as JSON with buffers in files beside it or in data URIs: triangles,
/// strips, fans and points of the default scene, placed by its nodes. Throws Error naming the element.
[[nodiscard]] MeshFile read_gltf(std::string_view bytes, const std::filesystem::path& file,
                                 std::vector<std::string>& warnings);
/// Whether a file begins as binary glTF.
[[nodiscard]] bool is_glb(std::string_view start);

/// An image of occlusion, and the material that gets it.
struct OcclusionLink {
    std::size_t material = 0; ///< index of TexturedMesh::materials
    std::size_t set = 0;      ///< of coordinates
    std::string image;        ///< the file's name, beside the mesh; for UDIM with <UDIM> in place of the number
    std::string png = {};     ///< its bytes, for files that hold their images
};

/// Files to write beside each other, by their names. The mesh is the first.
struct LinkedFiles {
    struct File {
        std::filesystem::path name; ///< relative
        std::string bytes;
    };
    std::vector<File> files;
    std::vector<std::filesystem::path> copies; ///< names of files that the mesh needs, relative to its folder
    std::vector<std::string> notes;            ///< sentences: what is not linked, and why
};

/// The OBJ as it is, and its MTL with a line `map_Ka IMAGE` in each of the materials. `name`: of the written mesh,
/// without extension; the MTL gets it, and the OBJ its name, where that is another one.
[[nodiscard]] LinkedFiles linked_obj(std::string_view bytes, const std::filesystem::path& file, const std::string& name,
                                     const TexturedMesh& mesh, std::span<const OcclusionLink> links);
/// The glTF with an occlusionTexture in each of the materials, images inside (binary) or beside it; other elements and
/// bytes of buffers as they were. Throws Error where a material has one and `replace` is false.
[[nodiscard]] LinkedFiles linked_gltf(std::string_view bytes, const std::filesystem::path& file,
                                      const std::string& name, const TexturedMesh& mesh,
                                      std::span<const OcclusionLink> links, bool replace);

/// Whether the normals recorded at a triangle's corners face against the order of these.
[[nodiscard]] bool is_reversed(const std::array<Eigen::Vector3d, 3>& corners, const Eigen::Vector3d& normals);

/// A path in a file's text that stays within the folder of the file; none for others.
[[nodiscard]] std::optional<std::filesystem::path> path_within(std::string_view text);

} // namespace scanshade
