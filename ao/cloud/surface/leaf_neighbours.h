// The nearest neighbours of all points of a cloud: points of one leaf of the tree share a search.
#pragma once

#include "ao/cloud/surface/neighbours.h"

#include <memory>
#include <span>
#include <tbb/parallel_for.h>

namespace scanshade {

/// Finds what NeighbourTree::find_round() finds, in a quarter of the time. Distances are computed for all points of a
/// leaf against one list of candidates. One thread at a time.
class LeafNeighbours {
  public:
    /// `wanted`: at most Nearest::most.
    LeafNeighbours(const NeighbourTree& tree, std::size_t wanted);
    ~LeafNeighbours();

    /// Searches round the points of a leaf. Consecutive leaves are quickest: the last search limits the next.
    void search(std::size_t leaf);
    /// The first point of the leaf searched last, and one behind its last.
    [[nodiscard]] std::size_t begin() const { return begin_; }
    [[nodiscard]] std::size_t end() const { return end_; }
    /// The neighbours of the point `index` of that leaf, nearest first; ties go to the lower index.
    [[nodiscard]] std::span<const Nearest::Neighbour> round(std::size_t index) const;

  private:
    struct Scratch;
    [[nodiscard]] bool gather();
    void search_alone(std::size_t index);

    const NeighbourTree& tree_;
    std::size_t wanted_, begin_ = 0, end_ = 0;
    float reach_; ///< a guess of how far away the last neighbour is at most; infinite where nothing tells
    std::unique_ptr<Scratch> scratch_;
};

/// Calls `visit(index, neighbours)` for every point of the tree, in parallel. `neighbours` holds for that call only.
template <class Visit>
void for_each_neighbourhood(const NeighbourTree& tree, std::size_t wanted, Visit&& visit) {
    constexpr std::size_t leaves_at_once = 64;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, tree.leaves(), leaves_at_once), [&](const auto& range) {
        LeafNeighbours neighbours(tree, wanted);
        for (std::size_t leaf = range.begin(); leaf < range.end(); ++leaf) {
            neighbours.search(leaf);
            for (std::size_t i = neighbours.begin(); i < neighbours.end(); ++i)
                visit(i, neighbours.round(i));
        }
    });
}

} // namespace scanshade
