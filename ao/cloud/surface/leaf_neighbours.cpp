// All nearest neighbours: one walk through the tree for each leaf, then distances in vectors and ranks by counting.
#include "ao/cloud/surface/leaf_neighbours.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace scanshade {
namespace {

using Eigen::Vector3f;

constexpr float infinite = std::numeric_limits<float>::infinity();
constexpr std::size_t most_candidates = 1024, most_ranked = 128, lanes = 8;

/// Points that may be neighbours of those of a leaf, ascending by index.
struct Candidates {
    alignas(32) std::array<float, most_candidates + lanes> x, y, z;
    std::array<std::uint32_t, most_candidates + lanes> index;
    std::size_t count = 0;
};

using Neighbours = std::array<Nearest::Neighbour, Nearest::most>;
constexpr std::size_t too_many = std::numeric_limits<std::size_t>::max();

/// The `wanted` candidates nearest to a point within a squared distance that holds as many. Returns how many, or
/// `too_many` where counting ranks would take long. The compiler turns the loops into vector code.
[[gnu::always_inline]] inline std::size_t nearest_of(const Candidates& candidates, const Vector3f& at,
                                                     std::uint32_t self, float reach2, std::size_t wanted,
                                                     Neighbours& found) {
    alignas(32) std::array<float, most_candidates + lanes> distance2;
    const float x = at.x(), y = at.y(), z = at.z();
    const std::size_t count = candidates.count, padded = (count + lanes - 1) / lanes * lanes;
    for (std::size_t j = 0; j < padded; ++j) {
        const float dx = candidates.x[j] - x, dy = candidates.y[j] - y, dz = candidates.z[j] - z;
        distance2[j] = dx * dx + (dy * dy + dz * dz); // the order of additions is that of Eigen's squaredNorm()
    }
    alignas(32) std::array<float, most_candidates + lanes> near;
    std::array<std::uint32_t, most_candidates + 1> index;
    std::size_t within = 0;
    for (std::size_t j = 0; j < count; ++j) {
        near[within] = distance2[j];
        index[within] = candidates.index[j];
        within += static_cast<std::size_t>(distance2[j] <= reach2) & static_cast<std::size_t>(index[within] != self);
    }
    if (within > most_ranked)
        return too_many;
    const std::size_t ranked = (within + lanes - 1) / lanes * lanes;
    for (std::size_t i = within; i < ranked; ++i)
        near[i] = infinite;
    alignas(32) std::array<std::uint32_t, most_ranked> rank;
    for (std::size_t i = 0; i < ranked; i += lanes) {
        alignas(32) std::array<std::uint32_t, lanes> nearer{};
        for (std::size_t j = 0; j < within; ++j)
            for (std::size_t lane = 0; lane < lanes; ++lane)
                nearer[lane] += near[j] < near[i + lane];
        for (std::size_t lane = 0; lane < lanes; ++lane)
            rank[i + lane] = nearer[lane];
    }
    std::uint64_t taken = 0; // equal distances have equal ranks: they take the next free ones in the order of indices
    for (std::size_t i = 0; i < within; ++i) {
        std::uint32_t slot = rank[i];
        while (slot < wanted && (taken >> slot & 1) != 0)
            ++slot;
        if (slot >= wanted)
            continue;
        taken |= std::uint64_t(1) << slot;
        found[slot] = {near[i], index[i]};
    }
    return std::min(within, wanted);
}

std::size_t nearest_of_any(const Candidates& candidates, const Vector3f& at, std::uint32_t self, float reach2,
                           std::size_t wanted, Neighbours& found) {
    return nearest_of(candidates, at, self, reach2, wanted, found);
}

#if defined(__x86_64__)
/// Without fused multiplications, so that all processors find the same distances.
[[gnu::target("avx2")]] std::size_t nearest_of_avx2(const Candidates& candidates, const Vector3f& at,
                                                    std::uint32_t self, float reach2, std::size_t wanted,
                                                    Neighbours& found) {
    return nearest_of(candidates, at, self, reach2, wanted, found);
}
#endif

auto* fastest_nearest_of() {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2"))
        return &nearest_of_avx2;
#endif
    return &nearest_of_any;
}

} // namespace

struct LeafNeighbours::Scratch {
    Candidates candidates;
    std::array<Neighbours, NeighbourTree::leaf> found;
    std::array<std::size_t, NeighbourTree::leaf> counts;
    Nearest nearest;
};

LeafNeighbours::LeafNeighbours(const NeighbourTree& tree, std::size_t wanted)
    : tree_(tree), wanted_(std::min(wanted, Nearest::most)), reach_(infinite),
      scratch_(std::make_unique_for_overwrite<Scratch>()) {}
LeafNeighbours::~LeafNeighbours() = default;

std::span<const Nearest::Neighbour> LeafNeighbours::round(std::size_t index) const {
    return {scratch_->found[index - begin_].data(), scratch_->counts[index - begin_]};
}

void LeafNeighbours::search(std::size_t leaf) {
    static const auto nearest_of_here = fastest_nearest_of();
    std::tie(begin_, end_) = tree_.leaf_range(leaf);
    if (begin_ == end_)
        return;
    const bool gathered = gather();
    float sum = 0;
    for (std::size_t i = begin_; i < end_; ++i) {
        const std::size_t k = i - begin_;
        std::size_t& count = scratch_->counts[k];
        count = gathered ? nearest_of_here(scratch_->candidates, tree_[i], static_cast<std::uint32_t>(i),
                                           reach_ * reach_, wanted_, scratch_->found[k])
                         : 0;
        if (count != wanted_)
            search_alone(i);
        sum += count == wanted_ && count > 0 ? std::sqrt(scratch_->found[k][count - 1].distance2) : infinite;
    }
    constexpr float wider = 1.3F; // so that few points find too few
    reach_ = wider * sum / static_cast<float>(end_ - begin_);
}

/// The candidates for all points of the leaf. Fails where they are too many, or where nothing tells how far to look.
bool LeafNeighbours::gather() {
    Candidates& candidates = scratch_->candidates;
    candidates.count = 0;
    if (!(reach_ < infinite))
        return false;
    Eigen::AlignedBox3f round;
    for (std::size_t i = begin_; i < end_; ++i)
        round.extend(tree_[i]);
    bool fits = true;
    tree_.for_each_leaf_near(round, reach_ * reach_, [&](std::size_t begin, std::size_t end) {
        fits = candidates.count + (end - begin) <= most_candidates;
        if (!fits)
            return false;
        for (std::size_t i = begin; i < end; ++i) {
            const Vector3f& point = tree_[i];
            candidates.x[candidates.count] = point.x();
            candidates.y[candidates.count] = point.y();
            candidates.z[candidates.count] = point.z();
            candidates.index[candidates.count++] = static_cast<std::uint32_t>(i);
        }
        return true;
    });
    for (std::size_t j = candidates.count; j < candidates.count + lanes; ++j) // the last vector is computed whole
        candidates.x[j] = candidates.y[j] = candidates.z[j] = 0;
    return fits;
}

void LeafNeighbours::search_alone(std::size_t index) {
    const std::size_t k = index - begin_;
    float reach = infinite;
    if (k > 0 && scratch_->counts[k - 1] == wanted_ && wanted_ > 0) {
        constexpr float rounding = 1 + 1e-5F;
        reach = (std::sqrt(scratch_->found[k - 1][wanted_ - 1].distance2) + (tree_[index] - tree_[index - 1]).norm()) *
                rounding;
    }
    tree_.find_round(index, wanted_, scratch_->nearest, reach * reach);
    const auto all = scratch_->nearest.all();
    std::ranges::copy(all, scratch_->found[k].begin());
    scratch_->counts[k] = all.size();
}

} // namespace scanshade
