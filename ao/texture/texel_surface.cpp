#include "ao/texture/texel_surface.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3f;

TexelSurface::TexelSurface(std::span<const Vector3d> points, std::span<const std::array<int, 3>> triangles,
                           const std::vector<bool>& reversed, std::span<const TextureCorners> corners,
                           std::span<const int> faces, int size)
    : points_(points), triangles_(triangles), corners_(corners), size_(size),
      normals_(triangles.size(), Vector3f::Zero()), steps_(triangles.size(), 0.0F) {
    bool first = true;
    for (const int face : faces) {
        const auto i = static_cast<std::size_t>(face);
        if (!std::ranges::all_of(triangles[i], [&](int corner) {
                return corner >= 0 && points[static_cast<std::size_t>(corner)].allFinite();
            }))
            continue;
        const auto at = [&](std::size_t corner) { return points[static_cast<std::size_t>(triangles[i][corner])]; };
        const Vector3d across = (at(1) - at(0)).cross(at(2) - at(0));
        const double length = across.norm(), texels = area_in_texels(corners[i], size);
        if (!(length > 0) || !(texels > 0))
            continue;
        const double side = !reversed.empty() && reversed[i] ? -1 : 1;
        normals_[i] = (side / length * across).cast<float>();
        steps_[i] = static_cast<float>(std::sqrt(length / 2 / texels));
        if (first)
            middle_ = at(0);
        first = false;
    }
}

Vector3d TexelSurface::point(int face, int x, int y) const {
    const auto i = static_cast<std::size_t>(face);
    const Vector3d weights = weights_at(corners_[i], x, y, size_);
    Vector3d sum = Vector3d::Zero();
    for (std::size_t k = 0; k < 3; ++k)
        sum += weights[static_cast<Eigen::Index>(k)] * points_[static_cast<std::size_t>(triangles_[i][k])];
    return sum;
}

} // namespace scanshade
