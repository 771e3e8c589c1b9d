// Patches of a surface: neighbouring points whose planes surely agree on a side.
#pragma once

#include "ao/cloud/sides/signed_graph.h"
#include "ao/cloud/surface/cloud_surface.h"

#include <vector>

namespace scanshade {

/// Points in patches; each point knows whether its normal opposes its patch.
struct Patches {
    std::vector<std::uint32_t> patch; ///< by index in the tree
    std::vector<char> turned;         ///< by index in the tree: against its patch's side
    std::uint32_t count = 0;
    /// What neighbours say of two patches: the sum of their pairs' squared sureness, negative where they oppose.
    std::vector<SignedGraph::Link> links;

    [[nodiscard]] int sign(std::size_t index) const { return turned[index] ? -1 : 1; }
};

/// Joins the surest pairs of neighbours first, while patches are small: so that a wrong pair cannot turn a wall over.
/// Regions of 65,536 points side by side are joined by themselves, then with each other. Works on all cores; the result
/// does not depend on their number.
[[nodiscard]] Patches patches_of(const CloudSurface& surface);

/// The sum of all links between the same two nodes, sorted by them; sums run in the order given.
[[nodiscard]] std::vector<SignedGraph::Link> summed(std::vector<SignedGraph::Link> links);

} // namespace scanshade
