// Textures of occlusion: every texel of an image gets the visibility of the point of a mesh that it shows, by rays
// against the whole mesh.
#pragma once

#include "ao/base/method.h"
#include "ao/raycast/ray_hemisphere.h"
#include "projection/texels.h"

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

namespace scanshade {

struct TextureAoOptions {
    double radius = 0; ///< in the mesh's unit
    int rays = 0;      ///< of each texel; 0 = 8 to 64, the fewer the smaller texels are beside the radius: then means
                       ///< suffice, at last of every second
    int seed = 0;
};

struct OcclusionTexture {
    cv::Mat1f visibility; ///< 1 where no triangle is near
    int rays = 0;         ///< as cast
    bool half = false;    ///< by every second texel alone; others take what is between
    double overlap = 0;   ///< share of the texels that several parts of the surface use; their values are means
    std::size_t covered = 0;
    Timings timings;
};

/// Makes the images of one mesh.
class TextureAo {
  public:
    /// Keeps references to `points` and `triangles`. All triangles occlude; `reversed` ones show their other side.
    TextureAo(std::span<const Eigen::Vector3d> points, std::span<const std::array<int, 3>> triangles,
              const std::vector<bool>& reversed, TextureAoOptions options);

    /// The image of these triangles, `size` texels wide and high. Neighbours' values are averaged on the surface, over
    /// cuts between charts, too. Texels within `margin` of the covered ones take the value of the nearest. Throws
    /// OutOfMemory before anything is made, and Error where coordinates lie over each other more than four times.
    [[nodiscard]] OcclusionTexture image(std::span<const TextureCorners> corners, std::span<const int> faces, int size,
                                         int margin) const;

  private:
    std::span<const Eigen::Vector3d> points_;
    std::span<const std::array<int, 3>> triangles_;
    const std::vector<bool>& reversed_;
    TextureAoOptions options_;
    RaySurface surface_;
};

/// Gives texels without a value (NaN) that of the nearest with one, if it is at most `margin` texels away.
void fill_margin(cv::Mat1f& values, int margin);

} // namespace scanshade
