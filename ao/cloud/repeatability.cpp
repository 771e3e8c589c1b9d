#include "ao/cloud/repeatability.h"

#include "ao/cloud/surface/leaf_neighbours.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Core>
#include <limits>
#include <tbb/parallel_for.h>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3f;

namespace {

constexpr std::size_t at_once = 16; ///< positions that share a walk through a tree

/// Positions side by side, and the nearest points to them so far.
struct Block {
    using Row = std::array<float, at_once>;
    alignas(32) Row x, y, z, distance2;
    alignas(32) std::array<std::uint32_t, at_once> nearest;
};

/// The compiler turns the inner loop into vector code.
[[gnu::always_inline]] inline void look_at(const NeighbourTree& tree, std::size_t begin, std::size_t end,
                                           Block& block) {
    for (std::size_t i = begin; i < end; ++i) {
        const float x = tree[i].x(), y = tree[i].y(), z = tree[i].z();
        for (std::size_t k = 0; k < at_once; ++k) {
            const float dx = x - block.x[k], dy = y - block.y[k], dz = z - block.z[k];
            const float distance2 = dx * dx + (dy * dy + dz * dz); // as Eigen's squaredNorm() adds
            const bool nearer = distance2 < block.distance2[k];
            block.distance2[k] = nearer ? distance2 : block.distance2[k];
            block.nearest[k] = nearer ? static_cast<std::uint32_t>(i) : block.nearest[k];
        }
    }
}

void look_at_any(const NeighbourTree& tree, std::size_t begin, std::size_t end, Block& block) {
    look_at(tree, begin, end, block);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void look_at_avx2(const NeighbourTree& tree, std::size_t begin, std::size_t end, Block& block) {
    look_at(tree, begin, end, block);
}
#endif

auto* fastest_look_at() {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2"))
        return &look_at_avx2;
#endif
    return &look_at_any;
}

/// The point of the tree nearest to each position; of equal distances the lower index.
void find_nearest(const NeighbourTree& tree, std::span<const Vector3f> positions, std::span<std::uint32_t> nearest) {
    static const auto look_at_here = fastest_look_at();
    if (positions.empty())
        return;
    Nearest single;
    tree.find_near(positions[0], 1, single);
    const Vector3f& nearest_to_first = tree[single.all()[0].point];
    Block block;
    block.distance2.fill(std::numeric_limits<float>::infinity());
    Eigen::AlignedBox3f round;
    float reach2 = 0;
    for (std::size_t k = 0; k < at_once; ++k) {
        const Vector3f& position = positions[std::min(k, positions.size() - 1)];
        block.x[k] = position.x();
        block.y[k] = position.y();
        block.z[k] = position.z();
        round.extend(position);
        reach2 = std::max(reach2, (position - nearest_to_first).squaredNorm());
    }
    constexpr std::size_t most = 256; // points looked at; positions far apart are searched for one by one
    std::size_t looked_at = 0;
    tree.for_each_leaf_near(round, reach2 * (1 + 1e-5F), [&](std::size_t begin, std::size_t end) {
        looked_at += end - begin;
        if (looked_at <= most)
            look_at_here(tree, begin, end, block);
        return looked_at <= most;
    });
    for (std::size_t k = 0; k < positions.size(); ++k) {
        if (looked_at > most)
            tree.find_near(positions[k], 1, single);
        nearest[k] = looked_at > most ? single.all()[0].point : block.nearest[k];
    }
}

} // namespace

double ThinnedCheck::error_per_difference() const { return keep > 0 && keep < 1 ? 1 / (std::sqrt(1 / keep) - 1) : 0; }

ThinnedCheck thinned_check(std::size_t points, double radius_in_spacings) {
    constexpr double enough = 100000;   // points to compute again
    constexpr double fewest = 200;      // points of which a quarter still makes surfaces
    constexpr double dense = 60;        // spacings in the radius: the error is below 0.05 then, with noise, too
    constexpr double still_spanned = 4; // spacings of the thinned cloud in the radius
    const auto all = static_cast<double>(points);
    if (all < fewest || !(radius_in_spacings > 0) || radius_in_spacings > dense)
        return {};
    const double thinner = std::min(all / enough, std::pow(radius_in_spacings / still_spanned, 2));
    return {1 / std::max(4.0, thinner)};
}

CheckedPart::CheckedPart(std::span<const Vector3d> points, std::span<const float> whole, std::span<const float> thinned,
                         const ThinnedCheck& check) {
    constexpr std::size_t surroundings = 12; // kept points
    std::vector<Vector3d> compared;
    std::vector<float> squares;
    for (std::size_t k = 0; k < points.size(); ++k)
        if (const float off = thinned[k] - whole[k]; !std::isnan(off)) {
            compared.push_back(points[k]);
            squares.push_back(off * off);
        }
    if (compared.empty())
        return;
    double sum = 0;
    for (const float square : squares)
        sum += square;
    rms_ = check.error_per_difference() * std::sqrt(sum / static_cast<double>(squares.size()));
    const NeighbourTree& tree = cloud_.emplace(compared).tree;
    const auto scale = static_cast<float>(check.error_per_difference());
    error_.resize(tree.size());
    for_each_neighbourhood(tree, surroundings, [&](std::size_t index, std::span<const Nearest::Neighbour> near) {
        float mean = squares[tree.original(index)];
        for (const Nearest::Neighbour& neighbour : near)
            mean += squares[tree.original(neighbour.point)];
        mean /= static_cast<float>(near.size() + 1);
        error_[index] = scale * std::sqrt(mean);
    });
}

std::vector<float> CheckedPart::errors(std::span<const Vector3d> points, std::span<const float> whole,
                                       std::span<const std::uint32_t> order) const {
    std::vector<float> errors(points.size(), 1.0F);
    if (!cloud_)
        return errors;
    const std::size_t all = order.empty() ? points.size() : order.size();
    tbb::parallel_for(std::size_t(0), (all + at_once - 1) / at_once, [&](std::size_t block) {
        std::array<Vector3f, at_once> positions;
        std::array<std::uint32_t, at_once> index, nearest;
        std::size_t count = 0;
        for (std::size_t k = at_once * block; k < std::min(all, at_once * (block + 1)); ++k) {
            const std::uint32_t i = order.empty() ? static_cast<std::uint32_t>(k) : order[k];
            if (!std::isnan(whole[i])) {
                index[count] = i;
                positions[count++] = (points[i] - cloud_->middle).cast<float>();
            }
        }
        find_nearest(cloud_->tree, std::span(positions.data(), count), nearest);
        for (std::size_t k = 0; k < count; ++k)
            errors[index[k]] = error_[nearest[k]];
    });
    return errors;
}

Repeatability repeatability(std::span<const Vector3d> points, std::span<const float> whole,
                            std::span<const std::uint32_t> kept, std::span<const float> thinned,
                            const ThinnedCheck& check, std::span<const std::uint32_t> order) {
    std::vector<Vector3d> kept_points;
    std::vector<float> kept_whole;
    for (const std::uint32_t i : kept) {
        kept_points.push_back(points[i]);
        kept_whole.push_back(whole[i]);
    }
    const CheckedPart part(kept_points, kept_whole, thinned, check);
    return {part.error(), part.errors(points, whole, order)};
}

} // namespace scanshade
