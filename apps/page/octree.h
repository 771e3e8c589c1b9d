// A cloud as an octree of chunks: each point is in one node, and a node with those above it is an even sample of its
// box.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

namespace scanshade::page {

inline constexpr int octree_bits = 21; ///< of a place along an axis of the root's cube

/// A point's place on the Z-order curve (Morton 1966) of the root's cube, x lowest, and the point's index.
struct CurvePlace {
    std::uint64_t curve = 0;
    std::uint32_t index = 0;

    auto operator<=>(const CurvePlace&) const = default; // NOLINT(modernize-use-nullptr)
};

/// `cell`: 0 .. 2^21 - 1 along each axis.
[[nodiscard]] std::uint64_t curve_of(const std::array<std::uint32_t, 3>& cell);
[[nodiscard]] std::array<std::uint32_t, 3> cell_of(std::uint64_t curve);

struct OctreeNode {
    std::size_t first = 0, end = 0; ///< places in its box
    std::uint32_t parent = 0;       ///< number of the node above; the root's own
    int level = 0;                  ///< its box has the root's edge / 2^level
    int octant = 0;                 ///< in its parent: 1 = upper half of x, 2 = of y, 4 = of z
    std::size_t count = 0;          ///< its own points
    /// Median distance of neighbours on the curve, with the points above it; of a sample at most 0.8 of its cells'
    /// side, as of as many random points.
    double spacing = 0;
};

struct Octree {
    std::vector<OctreeNode> nodes;    ///< breadth first
    std::vector<std::uint8_t> levels; ///< of each place: the level of the node that has it

    [[nodiscard]] int deepest() const { return nodes.empty() ? 0 : nodes.back().level; }
    /// Indices of the node's own points, along the curve.
    [[nodiscard]] std::vector<CurvePlace> own(const OctreeNode& node, std::span<const CurvePlace> places) const;
};

/// The octree of places along the curve. As in Potree (Schuetz 2016) a node takes at most one point of each cell of a
/// grid in its box, where no node above has one; here a random one. The grid is 128 cells wide, coarser where those are
/// too many. A box with few points left is a leaf. `edge`: of the root's cube. `apart(a, b)`: the distance of two
/// points in the same unit; called from several threads.
[[nodiscard]] Octree octree_of(std::span<const CurvePlace> places, double edge,
                               const std::function<double(std::uint32_t, std::uint32_t)>& apart);

} // namespace scanshade::page
