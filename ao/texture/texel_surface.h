// The surface of a mesh as the texels of an image show it.
#pragma once

#include "projection/texels.h"

#include <array>
#include <Eigen/Core>
#include <span>
#include <vector>

namespace scanshade {

/// Keeps references to all that it is made of.
class TexelSurface {
  public:
    TexelSurface(std::span<const Eigen::Vector3d> points, std::span<const std::array<int, 3>> triangles,
                 const std::vector<bool>& reversed, std::span<const TextureCorners> corners, std::span<const int> faces,
                 int size);

    /// Whether a triangle has area in space, so that texels can show it.
    [[nodiscard]] bool is_shown(int face) const { return step(face) > 0; }
    /// The point of a triangle that a texel shows (weights_at()).
    [[nodiscard]] Eigen::Vector3d point(int face, int x, int y) const;
    /// The same about the middle of the mesh, where single precision is fine enough.
    [[nodiscard]] Eigen::Vector3f local(int face, int x, int y) const {
        return (point(face, x, y) - middle_).cast<float>();
    }
    /// Unit, on the side of the recorded normals; zero where a triangle has none.
    [[nodiscard]] const Eigen::Vector3f& normal(int face) const { return normals_[static_cast<std::size_t>(face)]; }
    /// Between neighbouring texels of a triangle, in the mesh's unit; 0 where it shows nothing.
    [[nodiscard]] float step(int face) const { return steps_[static_cast<std::size_t>(face)]; }
    [[nodiscard]] int size() const { return size_; }

  private:
    std::span<const Eigen::Vector3d> points_;
    std::span<const std::array<int, 3>> triangles_;
    std::span<const TextureCorners> corners_;
    int size_;
    Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
    std::vector<Eigen::Vector3f> normals_; ///< of all triangles; zero for those that are not in the image
    std::vector<float> steps_;
};

} // namespace scanshade
