// A mesh whose corners have places in images: what io reads of it, and what textures of occlusion are made from.
#pragma once

#include <array>
#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Where a triangle's corners are in an image: u to the right, v down, 1 = the image's width or height, as glTF has it.
/// NaN where the file has no coordinates.
using TextureCorners = std::array<Eigen::Vector2f, 3>;

struct MeshMaterial {
    std::string name;                    ///< as the file has it; may be empty
    std::optional<std::size_t> set = {}; ///< of coordinates, that an occlusion texture uses already
};

struct TexturedMesh {
    std::vector<std::array<int, 3>> triangles;     ///< indices of the cloud's points; -1 names none
    std::vector<std::vector<TextureCorners>> sets; ///< of coordinates; each has one element per triangle
    std::vector<MeshMaterial> materials;
    std::vector<int> material; ///< of each triangle, an index of `materials`
    std::vector<bool>
        reversed;       ///< whether a triangle's recorded normals face against the order of its corners; or empty
    bool tiles = false; ///< whether whole numbers in coordinates may name images (UDIM)
};

} // namespace scanshade
