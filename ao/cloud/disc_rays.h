// Rays from the points of a cloud against the discs that stand for it.
#pragma once

#include "ao/cloud/cloud_surface.h"
#include "ao/cloud/ray_fan.h"
#include "ao/raycast/ray_surface.h"

#include <optional>

namespace scanshade {

/// Keeps a reference to the surface, whose normals may be turned meanwhile: discs have two sides. Safe to use from
/// several threads.
class DiscRays {
  public:
    explicit DiscRays(const CloudSurface& surface);

    /// Share of the rays of a point's own run that meet nothing within `radius`. With `up`, rays that do not point
    /// there are not free.
    [[nodiscard]] float open(std::size_t place, const RayFan& fan, float radius,
                             const std::optional<Eigen::Vector3f>& up) const;
    /// What rays met first.
    struct Looks {
        std::array<float, RayBundle::size> distance; ///< infinite for nothing
        std::array<float, RayBundle::size> facing;   ///< cosine between what was met and the way back; 0 for nothing
    };
    /// A run of eight rays on one side of a point's plane.
    [[nodiscard]] Looks look(std::size_t place, const Eigen::Vector3f& side, const RayFan::Run& run) const;

  private:
    [[nodiscard]] RayBundle bundle_from(std::size_t place, const Eigen::Vector3f& side, float radius) const;

    const CloudSurface& surface_;
    RaySurface discs_;
};

} // namespace scanshade
