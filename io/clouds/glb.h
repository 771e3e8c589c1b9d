// Clouds and meshes with their values as binary glTF 2.0 (Khronos, ISO/IEC 12113), for web pages and modelling
// programs.
#pragma once

#include "io/clouds/cloud_file.h"

#include <array>
#include <cstddef>
#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// Which of the points' axes points up, if that is known. glTF has y up.
enum class UpAxis { unknown, z, minus_y };

struct GlbScene {
    std::string name = {};
    std::span<const Eigen::Vector3d> points = {};
    std::span<const std::array<int, 3>> triangles = {}; ///< indices of points; empty = a cloud
    std::span<const Eigen::Vector3d> normals = {};      ///< empty = none
    std::span<const cv::Vec3b> colours = {};            ///< BGR as images store them; one per point
    std::vector<AddedField> fields = {};                ///< names as glTF asks: "_AMBIENT_OCCLUSION"; NaN = unknown
    UpAxis up = UpAxis::unknown;
    /// A content of 3D Tiles: about its middle, chunks of whole 8 bytes, and fields declared as metadata
    /// (EXT_structural_metadata), by which viewers style.
    bool tile = false;
};

/// What became of the scene.
struct GlbWritten {
    std::size_t points = 0, triangles = 0;
    std::size_t left_out = 0;           ///< points: of a cloud, those without coordinates or without a value
    std::size_t unknown = 0;            ///< vertices of a mesh without a value, which have -1
    std::size_t triangles_left_out = 0; ///< their corners have no coordinates, or name no point
    bool has_normals = false;           ///< not where one of the points has none
};

/// Writes one node with one primitive. Positions are floats, about an origin that the node's translation holds where
/// they are far away; its rotation turns the known up direction to y. COLOR_0 is linear light in 16 bits; the material
/// is unlit, so that viewers show it as it is. Atomic. Throws Error where the file would have 2^32 bytes or more,
/// OutOfMemory where it does not fit into memory.
GlbWritten write_glb(const std::filesystem::path& file, const GlbScene& scene);

/// Sentences about what is not as in the cloud; none where all is.
[[nodiscard]] std::vector<std::string> describe(const GlbWritten& written, UpAxis up, const std::string& file);

} // namespace scanshade
