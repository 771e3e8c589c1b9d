// Tiles of a cloud, planned on a sample: what is planned depends neither on the order of the points nor on where they
// are kept.
#include "ao/cloud/tiles.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <bit>
#include <Eigen/Geometry>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

class Cutter {
  public:
    Cutter(std::vector<TilePlan::Node>& nodes, double share, double reach, std::size_t at_once)
        : nodes_(nodes), share_(share), reach_(reach), at_once_(at_once) {}

    std::uint32_t cut(const Points& core, const Points& round) {
        const auto number = static_cast<std::uint32_t>(nodes_.size());
        nodes_.emplace_back();
        constexpr double least = 10000, hardly_fewer = 0.9;
        constexpr std::size_t fewest = 16; // of the sample: fewer tell nothing
        if (in_all(round) <= static_cast<double>(at_once_) || in_all(core) <= least || core.size() < fewest)
            return tile(number, round);
        int axis = 0;
        const double at = middle_of(core, axis);
        const auto those = [&](const Points& of, auto&& holds) {
            Points some;
            std::ranges::copy_if(of, std::back_inserter(some), [&](const Vector3d& p) { return holds(p[axis]); });
            return some;
        };
        Points low = those(core, [&](double along) { return along < at; });
        Points high = those(core, [&](double along) { return !(along < at); });
        if (low.empty() || high.empty()) // all points coincide
            return tile(number, round);
        Points near_low = those(round, [&](double along) { return along < at + reach_; });
        Points near_high = those(round, [&](double along) { return along >= at - reach_; });
        if (static_cast<double>(std::min(near_low.size(), near_high.size())) >
            hardly_fewer * static_cast<double>(round.size())) // all within reach of all
            return tile(number, round);
        const std::uint32_t below = cut(std::exchange(low, {}), std::exchange(near_low, {}));
        const std::uint32_t above = cut(std::exchange(high, {}), std::exchange(near_high, {}));
        nodes_[number] = {axis, at, below, above, 0};
        return number;
    }

    std::uint32_t tiles = 0;
    std::size_t stored = 0, largest = 0; ///< of the sample

  private:
    [[nodiscard]] double in_all(const Points& points) const { return static_cast<double>(points.size()) / share_; }

    std::uint32_t tile(std::uint32_t number, const Points& round) {
        nodes_[number].tile = tiles++;
        stored += round.size();
        largest = std::max(largest, round.size());
        return number;
    }

    /// The median along the longest axis; above the lowest coordinate where most are there.
    [[nodiscard]] static double middle_of(const Points& points, int& axis) {
        Eigen::AlignedBox3d box;
        for (const Vector3d& point : points)
            box.extend(point);
        box.sizes().maxCoeff(&axis);
        std::vector<double> along(points.size());
        std::ranges::transform(points, along.begin(), [&](const Vector3d& point) { return point[axis]; });
        const double middle = ranked(along, along.size() / 2), lowest = box.min()[axis];
        if (middle > lowest)
            return middle;
        double next = box.max()[axis];
        for (const double each : along)
            if (each > lowest)
                next = std::min(next, each);
        return next;
    }

    std::vector<TilePlan::Node>& nodes_;
    double share_, reach_;
    std::size_t at_once_;
};

} // namespace

TilePlan::TilePlan(std::span<const Vector3d> sample, double share, double reach, std::size_t at_once) : reach_(reach) {
    Cutter cutter(nodes_, share, reach, at_once);
    const Points all(sample.begin(), sample.end());
    cutter.cut(all, all);
    tiles_ = cutter.tiles;
    if (!all.empty())
        copies_ = static_cast<double>(cutter.stored) / static_cast<double>(all.size());
    largest_ = static_cast<std::size_t>(static_cast<double>(cutter.largest) / share);
}

std::uint64_t TilePlan::fingerprint() const {
    std::uint64_t all = 0x9e3779b97f4a7c15ULL;
    const auto mix = [&](std::uint64_t value) {
        all = (all ^ value) * 0xff51afd7ed558ccdULL;
        all ^= all >> 32;
    };
    mix(std::bit_cast<std::uint64_t>(reach_));
    for (const Node& node : nodes_) {
        mix(static_cast<std::uint64_t>(node.axis + 1));
        mix(std::bit_cast<std::uint64_t>(node.at));
        mix(std::uint64_t(node.low) << 32 | node.high);
    }
    return all;
}

} // namespace scanshade
