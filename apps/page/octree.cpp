// A cloud as an octree of chunks.
#include "apps/page/octree.h"

#include "projection/base/hash.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tbb/parallel_for.h>

namespace scanshade::page {
namespace {

constexpr int grid_bits = 7;                ///< of the cells of a node along an axis
constexpr std::size_t most_sampled = 60000; ///< points that a node takes of its grid
constexpr std::size_t most_in_leaf = 100000;
constexpr std::size_t fewest = 10000; ///< left in an octant to be a node; fewer go to the node above
constexpr std::uint8_t in_no_node = 255;

/// 21 bits with two zeros between each.
std::uint64_t spread(std::uint64_t bits) {
    bits = (bits | bits << 32) & 0x001f00000000ffff;
    bits = (bits | bits << 16) & 0x001f0000ff0000ff;
    bits = (bits | bits << 8) & 0x100f00f00f00f00f;
    bits = (bits | bits << 4) & 0x10c30c30c30c30c3;
    return (bits | bits << 2) & 0x1249249249249249;
}

std::uint32_t gathered(std::uint64_t bits) {
    bits &= 0x1249249249249249;
    bits = (bits | bits >> 2) & 0x10c30c30c30c30c3;
    bits = (bits | bits >> 4) & 0x100f00f00f00f00f;
    bits = (bits | bits >> 8) & 0x001f0000ff0000ff;
    bits = (bits | bits >> 16) & 0x001f00000000ffff;
    return static_cast<std::uint32_t>((bits | bits >> 32) & 0x1fffff);
}

/// Fills nodes of one level; those of a level have no place in common, so that threads need no locks.
class Filler {
  public:
    Filler(std::span<const CurvePlace> places, double edge,
           const std::function<double(std::uint32_t, std::uint32_t)>& apart, std::vector<std::uint8_t>& levels)
        : places_(places), edge_(edge), apart_(apart), levels_(levels) {}

    /// Gives the node its points; returns the nodes below, of which `parent` is not known yet.
    [[nodiscard]] std::vector<OctreeNode> fill(OctreeNode& node) const {
        std::vector<OctreeNode> below;
        const auto left = [&](std::size_t first, std::size_t end) {
            return static_cast<std::size_t>(std::count(at(first), at(end), in_no_node));
        };
        const std::size_t all = left(node.first, node.end);
        const bool one_place = node.end > node.first && places_[node.first].curve == places_[node.end - 1].curve;
        if (all <= most_in_leaf || one_place || node.level + grid_bits >= octree_bits) {
            take(node, node.first, node.end);
            measure(node, std::numeric_limits<double>::infinity());
        } else {
            const double cell = take_sample(node);
            for (int octant = 0; octant < 8; ++octant) {
                OctreeNode child = octant_of(node, octant);
                if (left(child.first, child.end) < fewest)
                    take(node, child.first, child.end);
                else
                    below.push_back(child);
            }
            measure(node, 0.8 * cell);
        }
        return below;
    }

  private:
    [[nodiscard]] std::vector<std::uint8_t>::iterator at(std::size_t place) const {
        return levels_.begin() + static_cast<std::ptrdiff_t>(place);
    }
    void take(const OctreeNode& node, std::size_t first, std::size_t end) const {
        std::replace(at(first), at(end), in_no_node, static_cast<std::uint8_t>(node.level));
    }

    /// Calls `use` with each run of places that lie in one cell, whose side is the root's over 2^bits.
    template <class Use>
    void for_each_cell(const OctreeNode& node, int bits, Use&& use) const {
        const int shift = 3 * (octree_bits - bits);
        for (std::size_t first = node.first, end = first; first < node.end; first = end) {
            const std::uint64_t cell = places_[first].curve >> shift;
            while (end < node.end && places_[end].curve >> shift == cell)
                ++end;
            use(first, end);
        }
    }
    [[nodiscard]] bool is_free(std::size_t first, std::size_t end) const {
        return std::all_of(at(first), at(end), [](std::uint8_t level) { return level == in_no_node; });
    }
    /// Returns the side of the cells.
    double take_sample(const OctreeNode& node) const {
        int bits = node.level + grid_bits;
        for (std::size_t cells = most_sampled + 1; cells > most_sampled; --bits) {
            cells = 0;
            for_each_cell(node, bits, [&](std::size_t first, std::size_t end) { cells += is_free(first, end); });
        }
        for_each_cell(node, bits + 1, [&](std::size_t first, std::size_t end) {
            if (!is_free(first, end))
                return;
            std::size_t best = first;
            for (std::size_t i = first + 1; i < end; ++i)
                if (hash(places_[i].index) < hash(places_[best].index))
                    best = i;
            levels_[best] = static_cast<std::uint8_t>(node.level);
        });
        return std::ldexp(edge_, -(bits + 1));
    }

    [[nodiscard]] OctreeNode octant_of(const OctreeNode& node, int octant) const {
        const int shift = 3 * (octree_bits - node.level - 1);
        const auto start = [&](int of) {
            const std::uint64_t curve =
                ((places_[node.first].curve >> shift & ~std::uint64_t(7)) + static_cast<std::uint64_t>(of)) << shift;
            const auto within = places_.subspan(node.first, node.end - node.first);
            return node.first + static_cast<std::size_t>(
                                    std::ranges::lower_bound(within, curve, {}, &CurvePlace::curve) - within.begin());
        };
        return {.first = start(octant), .end = start(octant + 1), .level = node.level + 1, .octant = octant};
    }

    void measure(OctreeNode& node, double most) const {
        constexpr std::size_t most_pairs = 4000;
        std::size_t shown = 0;
        for (std::size_t i = node.first; i < node.end; ++i) {
            shown += levels_[i] != in_no_node;
            node.count += levels_[i] == node.level;
        }
        // By a hash: a point that rounding puts elsewhere changes its own pairs alone, not those behind it.
        const std::size_t every = std::max<std::size_t>(1, shown / most_pairs);
        std::vector<double> distances;
        const CurvePlace* before = nullptr;
        for (std::size_t i = node.first; i < node.end; ++i) {
            if (levels_[i] == in_no_node)
                continue;
            if (before && hash(places_[i].index) % every == 0)
                distances.push_back(apart_(before->index, places_[i].index));
            before = &places_[i];
        }
        if (distances.empty())
            return;
        const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
        std::ranges::nth_element(distances, middle);
        node.spacing = std::min(*middle, most);
    }

    std::span<const CurvePlace> places_;
    double edge_;
    const std::function<double(std::uint32_t, std::uint32_t)>& apart_;
    std::vector<std::uint8_t>& levels_;
};

} // namespace

std::uint64_t curve_of(const std::array<std::uint32_t, 3>& cell) {
    return spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2;
}

std::array<std::uint32_t, 3> cell_of(std::uint64_t curve) {
    return {gathered(curve), gathered(curve >> 1), gathered(curve >> 2)};
}

std::vector<CurvePlace> Octree::own(const OctreeNode& node, std::span<const CurvePlace> places) const {
    std::vector<CurvePlace> all;
    all.reserve(node.count);
    for (std::size_t i = node.first; i < node.end; ++i)
        if (levels[i] == node.level)
            all.push_back(places[i]);
    return all;
}

Octree octree_of(std::span<const CurvePlace> places, double edge,
                 const std::function<double(std::uint32_t, std::uint32_t)>& apart) {
    Octree tree;
    tree.levels.assign(places.size(), in_no_node);
    const Filler filler(places, edge, apart, tree.levels);
    tree.nodes.push_back({.end = places.size()});
    for (std::size_t first = 0, end = 1; first < end; first = end, end = tree.nodes.size()) { // level by level
        std::vector<std::vector<OctreeNode>> below(end - first);
        tbb::parallel_for(first, end, [&](std::size_t i) { below[i - first] = filler.fill(tree.nodes[i]); });
        for (std::size_t i = first; i < end; ++i)
            for (OctreeNode& child : below[i - first]) {
                child.parent = static_cast<std::uint32_t>(i);
                tree.nodes.push_back(child);
            }
    }
    return tree;
}

} // namespace scanshade::page
