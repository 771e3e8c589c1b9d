// Rays from the points of a cloud against the discs that stand for it.
#pragma once

#include "ao/cloud/surface/cloud_surface.h"
#include "ao/cloud/surface/direction_set.h"
#include "ao/cloud/surface/disc_tree.h"

#include <array>
#include <optional>
#include <span>

namespace scanshade {

/// Keeps a reference to the surface. Its normals may be flipped meanwhile: discs have two sides. Safe to use from
/// several threads.
class DiscRays {
  public:
    explicit DiscRays(const CloudSurface& surface, std::span<const SoftDisc> soft = {})
        : surface_(surface), discs_(surface, soft) {}

    /// For points of one leaf of the surface's tree: the share of the rays of a point's own run that hit nothing within
    /// `radius`; of soft discs, the mean share of light. With `up`, rays below that horizon count as blocked. Only for
    /// points that have a normal and a 1 in `asked`; the other values stay.
    void open(std::size_t leaf, const DirectionSet& directions, float radius, const std::optional<Eigen::Vector3f>& up,
              std::span<const char> asked, std::span<float> values) const;

    static constexpr std::size_t together = 8;
    /// First hits of eight rays.
    struct Hits {
        std::array<float, together> distance;      ///< infinite for nothing
        std::array<float, together> facing;        ///< cosine between the normal hit and the way back; 0 for nothing
        std::array<std::uint32_t, together> index; ///< of the disc hit
        std::array<Eigen::Vector3f, together> direction;
    };
    /// A run of eight rays on one side of a point's plane.
    [[nodiscard]] Hits first_hits(std::size_t index, const Eigen::Vector3f& side, const DirectionSet::Run& run) const;
    /// Whether nothing, or soft discs that let half of the light through, stand between a point and a position, which
    /// is relative to the surface's middle. 1: it is seen from the side of its normal. -1: from behind. 0: it is
    /// hidden, or seen at less than 6 degrees.
    [[nodiscard]] int seen_from(std::size_t index, const Eigen::Vector3f& position) const;

  private:
    [[nodiscard]] DiscRay ray_from(std::size_t index, const Eigen::Vector3f& side, float radius) const;

    const CloudSurface& surface_;
    DiscTree discs_;
};

} // namespace scanshade
