// Rays from the points of a cloud against the discs that stand for it.
#pragma once

#include "ao/cloud/cloud_surface.h"
#include "ao/cloud/direction_set.h"
#include "ao/raycast/ray_surface.h"

#include <optional>

namespace scanshade {

/// Keeps a reference to the surface. Its normals may be flipped meanwhile: discs have two sides. Safe to use from
/// several threads.
class DiscRays {
  public:
    explicit DiscRays(const CloudSurface& surface);

    /// Share of the rays of a point's own run that hit nothing within `radius`. With `up`, rays below that horizon
    /// count as blocked.
    [[nodiscard]] float open(std::size_t place, const DirectionSet& directions, float radius,
                             const std::optional<Eigen::Vector3f>& up) const;
    /// First hits of eight rays.
    struct Hits {
        std::array<float, RayBundle::size> distance; ///< infinite for nothing
        std::array<float, RayBundle::size> facing;   ///< cosine between the normal hit and the way back; 0 for nothing
        std::array<std::uint32_t, RayBundle::size> place; ///< of the disc hit
        std::array<Eigen::Vector3f, RayBundle::size> direction;
    };
    /// A run of eight rays on one side of a point's plane.
    [[nodiscard]] Hits first_hits(std::size_t place, const Eigen::Vector3f& side, const DirectionSet::Run& run) const;
    /// Whether nothing stands between a point and a position: 1 if it is seen from the side of its normal, -1 from
    /// behind, 0 if it is hidden or seen at less than 6 degrees. Positions are relative to the surface's middle.
    [[nodiscard]] int seen_from(std::size_t place, const Eigen::Vector3f& position) const;

  private:
    [[nodiscard]] RayBundle bundle_from(std::size_t place, const Eigen::Vector3f& side, float radius) const;

    const CloudSurface& surface_;
    RaySurface discs_;
};

} // namespace scanshade
