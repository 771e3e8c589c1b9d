// The tiles of a cloud too large for the memory: boxes that hold about equally many points.
#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <span>
#include <vector>

namespace scanshade {

/// A k-d tree of tiles. Every point is in the core of one tile, and in the rims of all tiles within reach of it.
class TilePlan {
  public:
    TilePlan() = default;
    /// Halves space along the longest axis of a sample of the points. It stops where a part with all points within
    /// `reach` of it (in the points' unit) has at most `at_once` points. `share`: that of all points in the sample. A
    /// tile exceeds `at_once` where halving does not help: nearly all points are within reach of all, or coincide.
    TilePlan(std::span<const Eigen::Vector3d> sample, double share, double reach, std::size_t at_once);

    [[nodiscard]] std::size_t size() const { return tiles_; }
    /// Points in all tiles with their rims / points, as far as the sample tells.
    [[nodiscard]] double copies() const { return copies_; }
    /// The most points of a tile with its rim, as far as the sample tells.
    [[nodiscard]] std::size_t largest() const { return largest_; }
    [[nodiscard]] double reach() const { return reach_; }

    /// Calls visit(tile, whether the point is in its core) for the tiles that need a point. It must be finite.
    template <class Visit>
    void for_each_tile(const Eigen::Vector3d& point, Visit&& visit) const {
        if (!nodes_.empty())
            walk(0, point, true, visit);
    }
    /// The number of the plan: equal plans have equal ones.
    [[nodiscard]] std::uint64_t fingerprint() const;

    /// An inner node has children; a leaf is a tile.
    struct Node {
        int axis = -1; ///< -1 = a tile
        double at = 0; ///< points below it go low
        std::uint32_t low = 0, high = 0;
        std::uint32_t tile = 0;
    };

  private:
    template <class Visit>
    void walk(std::uint32_t number, const Eigen::Vector3d& point, bool core, Visit& visit) const {
        const Node& node = nodes_[number];
        if (node.axis < 0) {
            visit(node.tile, core);
            return;
        }
        const double along = point[node.axis];
        if (along < node.at + reach_)
            walk(node.low, point, core && along < node.at, visit);
        if (along >= node.at - reach_)
            walk(node.high, point, core && !(along < node.at), visit);
    }

    std::vector<Node> nodes_;
    std::size_t tiles_ = 0, largest_ = 0;
    double reach_ = 0, copies_ = 1;
};

} // namespace scanshade
