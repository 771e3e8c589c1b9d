// Tiles of a cloud. Their points keep the order of the file: any other order takes several times as long.
#include "ao/cloud/tiles.h"

#include "projection/base/hash.h"
#include "projection/base/indices_where.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <Eigen/Geometry>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Vector3d;

class Cutter {
  public:
    Cutter(std::span<const Vector3d> points, double reach, std::size_t at_once,
           const std::function<void(const Indices&, const Indices&)>& tile)
        : points_(points), reach_(reach), at_once_(at_once), tile_(tile) {}

    void cut(const Indices& core, const Indices& round) {
        constexpr std::size_t least = 10000;
        if (round.size() <= at_once_ || core.size() <= least)
            return tile_(core, round);
        auto [low, high] = halves(core);
        if (high.empty()) // all points coincide
            return tile_(core, round);
        Indices near_low = within_reach(low, round), near_high = within_reach(high, round);
        constexpr double hardly_fewer = 0.9;
        if (static_cast<double>(std::min(near_low.size(), near_high.size())) >
            hardly_fewer * static_cast<double>(round.size())) // all within reach of all
            return tile_(core, round);
        cut(low, near_low);
        low = near_low = {};
        cut(high, near_high);
    }

  private:
    /// The second is empty where all points coincide.
    [[nodiscard]] std::pair<Indices, Indices> halves(const Indices& core) const {
        const Eigen::AlignedBox3d all = box_of(core);
        int axis = 0;
        all.sizes().maxCoeff(&axis);
        const double middle = middle_of(core, axis);
        const auto those_that = [&](auto&& holds) {
            return indices_where(core, [&](std::uint32_t i) { return holds(points_[i][axis]); });
        };
        Indices low = those_that([&](double at) { return at < middle; });
        if (!low.empty())
            return {std::move(low), those_that([&](double at) { return !(at < middle); })};
        // Most of them are at the lowest coordinate.
        return {those_that([&](double at) { return at <= middle; }),
                those_that([&](double at) { return at > middle; })};
    }

    /// The points of `round` in the box of `core` widened by the reach.
    [[nodiscard]] Indices within_reach(const Indices& core, const Indices& round) const {
        Eigen::AlignedBox3d box = box_of(core);
        box.min().array() -= reach_;
        box.max().array() += reach_;
        return indices_where(round, [&](std::uint32_t i) { return box.contains(points_[i]); });
    }

    [[nodiscard]] Eigen::AlignedBox3d box_of(const Indices& indices) const {
        using Box = Eigen::AlignedBox3d;
        return tbb::parallel_reduce(
            tbb::blocked_range<std::size_t>(0, indices.size()), Box(),
            [&](const auto& range, Box box) {
                for (std::size_t k = range.begin(); k < range.end(); ++k)
                    box.extend(points_[indices[k]]);
                return box;
            },
            [](const Box& a, const Box& b) { return a.merged(b); });
    }

    /// The median coordinate of a sample, chosen by a hash so that recording order has no influence.
    [[nodiscard]] double middle_of(const Indices& indices, int axis) const {
        constexpr double enough = 60000;
        const auto chosen =
            static_cast<std::uint64_t>(std::min(1.0, enough / static_cast<double>(indices.size())) * 0x1p32);
        std::vector<double> along;
        for (const std::uint32_t i : indices_where(indices, [&](std::uint32_t point) { return hash(point) < chosen; }))
            along.push_back(points_[i][axis]);
        if (along.empty())
            return points_[indices.front()][axis];
        return median(std::move(along));
    }

    std::span<const Vector3d> points_;
    double reach_;
    std::size_t at_once_;
    const std::function<void(const Indices&, const Indices&)>& tile_;
};

} // namespace

void cut_into_tiles(std::span<const Vector3d> points, const Indices& core, double reach, std::size_t at_once,
                    const std::function<void(const Indices&, const Indices&)>& tile) {
    Cutter(points, reach, at_once, tile).cut(core, core);
}

} // namespace scanshade
