// A cloud's points in the order of a k-d tree, and the nearest neighbours of each.
#pragma once

#include "ao/cloud/surface/untouched.h"

#include <array>
#include <cstdint>
#include <Eigen/Geometry>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace scanshade {

/// The nearest points found so far, nearest first, at most as many as were wanted.
class Nearest {
  public:
    static constexpr std::size_t most = 64;
    struct Neighbour {
        float distance2 = 0;
        std::uint32_t point = 0;
    };

    void begin(std::size_t wanted, float reach2);
    void offer(float distance2, std::uint32_t point);
    /// Whether a point at this distance or farther, with index `first` or higher, may be among them. Ties go to the
    /// lower index, so that a search among many equal points can stop early.
    [[nodiscard]] bool may_hold(float distance2, std::size_t first) const {
        return distance2 < reach2_ || (distance2 == reach2_ && (count_ < wanted_ || first < found_[count_ - 1].point));
    }
    [[nodiscard]] std::span<const Neighbour> all() const { return {found_.data(), count_}; }

  private:
    std::array<Neighbour, most> found_;
    std::size_t count_ = 0, wanted_ = 0;
    float reach2_ = 0;
};

/// A balanced k-d tree. Its points are stored in its order, so points with close indices are close in space. Immutable
/// once made; safe to use from several threads.
class NeighbourTree {
  public:
    /// `points` must be finite.
    explicit NeighbourTree(std::span<const Eigen::Vector3f> points);

    [[nodiscard]] std::size_t size() const { return points_.size(); }
    /// Levels of nodes above the leaves. A node of n points has children of n / 2 (rounded down) and the rest.
    [[nodiscard]] int levels() const { return levels_; }
    /// By index in the tree's order, which is what this room calls an index.
    [[nodiscard]] const Eigen::Vector3f& operator[](std::size_t index) const { return points_[index]; }
    /// The index of that point in the cloud given.
    [[nodiscard]] std::uint32_t original(std::size_t index) const { return original_[index]; }

    /// The `wanted` nearest neighbours of a point, without the point itself. `reach2`: a squared distance known to
    /// contain that many; infinite if unknown. Ties go to the lower index.
    void find_round(std::size_t index, std::size_t wanted, Nearest& found,
                    float reach2 = std::numeric_limits<float>::infinity()) const;

    /// The `wanted` points nearest to a position. `reach2` as for find_round().
    void find_near(const Eigen::Vector3f& at, std::size_t wanted, Nearest& found,
                   float reach2 = std::numeric_limits<float>::infinity()) const;

    /// Calls `visit(index)` for every point within `reach` of `at`, in no particular order.
    template <class Visit>
    void for_each_within(const Eigen::Vector3f& at, float reach, Visit&& visit) const;
    /// Walks the nodes from the root down. `enter(diagonal, begin, end, is_leaf)` gets the diagonal of a node's box and
    /// its indices. Where it returns true and the node is no leaf, its halves are walked, too.
    template <class Enter>
    void walk(Enter&& enter) const {
        walk({0, 0, points_.size(), levels_}, enter);
    }

    static constexpr std::size_t leaf = 12; ///< points, at most

    [[nodiscard]] std::size_t leaves() const { return std::size_t(1) << levels_; }
    /// The first point of a leaf, and one behind its last.
    [[nodiscard]] std::pair<std::size_t, std::size_t> leaf_range(std::size_t number) const;
    /// Calls `visit(begin, end)` for the points of every leaf whose box is within a squared distance of a box. In
    /// ascending order, until it returns false.
    template <class Visit>
    void for_each_leaf_near(const Eigen::AlignedBox3f& round, float reach2, Visit&& visit) const;

  private:
    struct Box {
        Eigen::Vector3f low, high;
        [[nodiscard]] float distance2(const Eigen::Vector3f& point) const {
            return (low - point).cwiseMax(point - high).cwiseMax(0).squaredNorm();
        }
        [[nodiscard]] Box joined(const Box& other) const {
            return {low.cwiseMin(other.low), high.cwiseMax(other.high)};
        }
    };
    struct Node {
        std::size_t number, begin, end;
        int levels; ///< above the leaves
        [[nodiscard]] std::size_t middle() const { return begin + (end - begin) / 2; }
        [[nodiscard]] Node left() const { return {2 * number + 1, begin, middle(), levels - 1}; }
        [[nodiscard]] Node right() const { return {2 * number + 2, middle(), end, levels - 1}; }
    };
    template <class Enter>
    void walk(const Node& node, Enter& enter) const;

    struct Placed;
    void find(const Eigen::Vector3f& at, std::size_t but, std::size_t wanted, Nearest& found, float reach2) const;
    template <class BoxOfAll>
    static std::size_t split_axis(std::span<const Placed> points, const BoxOfAll& box_of_all);
    struct Halving;
    struct Subtree {
        std::size_t root;
        int levels, wide; ///< above the leaves; those of them that all cores halve together
    };
    /// Wide levels move the points to `spare`, and back: after the last they must be where they stay.
    void build(std::span<Placed> points, std::span<Placed> spare, const Subtree& at);
    [[nodiscard]] static Box box_of(std::span<const Placed> points);

    Untouched<Eigen::Vector3f> points_;
    Untouched<std::uint32_t> original_;
    Untouched<Box> boxes_; ///< node n has the children 2n + 1 and 2n + 2, which halve its points
    int levels_ = 0;       ///< of nodes above the leaves
};

/// Points relative to a position near them, in single precision.
[[nodiscard]] std::vector<Eigen::Vector3f> local_points(const Eigen::Vector3d& middle,
                                                        std::span<const Eigen::Vector3d> points);

/// A cloud about its middle, so that single precision serves, in the order of its tree.
struct LocalCloud {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero(); ///< of the box round the points
    NeighbourTree tree;

    explicit LocalCloud(std::span<const Eigen::Vector3d> points);
    [[nodiscard]] std::size_t size() const { return tree.size(); }
};

template <class Visit>
void NeighbourTree::for_each_within(const Eigen::Vector3f& at, float reach, Visit&& visit) const {
    const float reach2 = reach * reach;
    std::array<Node, 64> stack;
    std::size_t depth = 0;
    stack[depth++] = {0, 0, points_.size(), levels_};
    while (depth > 0) {
        const Node node = stack[--depth];
        if (boxes_[node.number].distance2(at) > reach2)
            continue;
        if (node.levels > 0) {
            stack[depth++] = node.right();
            stack[depth++] = node.left();
            continue;
        }
        for (std::size_t index = node.begin; index < node.end; ++index)
            if ((points_[index] - at).squaredNorm() <= reach2)
                visit(index);
    }
}

template <class Visit>
void NeighbourTree::for_each_leaf_near(const Eigen::AlignedBox3f& round, float reach2, Visit&& visit) const {
    std::array<Node, 64> stack;
    std::size_t depth = 0;
    stack[depth++] = {0, 0, points_.size(), levels_};
    while (depth > 0) {
        const Node node = stack[--depth];
        const Box& box = boxes_[node.number];
        if ((box.low - round.max()).cwiseMax(round.min() - box.high).cwiseMax(0).squaredNorm() > reach2)
            continue;
        if (node.levels > 0) {
            stack[depth++] = node.right();
            stack[depth++] = node.left();
        } else if (!visit(node.begin, node.end)) {
            return;
        }
    }
}

template <class Enter>
void NeighbourTree::walk(const Node& node, Enter& enter) const {
    const Box& box = boxes_[node.number];
    if (node.begin == node.end || !enter((box.high - box.low).norm(), node.begin, node.end, node.levels == 0) ||
        node.levels == 0)
        return;
    walk(node.left(), enter);
    walk(node.right(), enter);
}

} // namespace scanshade
