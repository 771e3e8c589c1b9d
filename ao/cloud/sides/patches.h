// Patches of a surface: neighbouring points whose planes surely agree on a side.
#pragma once

#include "ao/cloud/sides/signed_graph.h"
#include "ao/cloud/surface/cloud_surface.h"

#include <array>
#include <vector>

namespace scanshade {

/// Pairs of neighbours, the surest ones first, whose planes are less than 75 degrees apart. Sure pairs have parallel
/// planes, each point within the plane of the other.
class SurePairs {
  public:
    using Pair = std::array<std::uint32_t, 2>;

    explicit SurePairs(const CloudSurface& surface);
    [[nodiscard]] const std::vector<Pair>& all() const { return pairs_; }
    /// How sure all pairs from this one on are at most, 0 .. 1.
    [[nodiscard]] float sureness(std::size_t pair) const;

  private:
    std::vector<Pair> pairs_;
    std::vector<std::size_t> starts_; ///< of the classes of equal sureness
};

/// Points in patches; each point knows whether its normal opposes its patch.
struct Patches {
    std::vector<std::uint32_t> patch; ///< by index in the tree
    std::vector<char> turned;         ///< by index in the tree: against its patch's side
    std::uint32_t count = 0;

    [[nodiscard]] int sign(std::size_t index) const { return turned[index] ? -1 : 1; }
};

/// Joins the surest pairs first, while patches are small: so that a wrong pair cannot turn a wall over.
[[nodiscard]] Patches patches_of(const CloudSurface& surface, const SurePairs& pairs);

/// What neighbours say of two patches: the sum of their pairs' squared sureness, negative where they oppose.
[[nodiscard]] std::vector<SignedGraph::Link> surface_links(const CloudSurface& surface, const SurePairs& pairs,
                                                           const Patches& patches);

/// The sum of all links between the same two nodes, sorted by them; sums run in the order given.
[[nodiscard]] std::vector<SignedGraph::Link> summed(std::vector<SignedGraph::Link> links);

} // namespace scanshade
