// k-d tree: median splits along the widest axis; the search opens the nearer half first.
#include "ao/cloud/surface/neighbours.h"

#include <algorithm>
#include <bit>
#include <Eigen/Geometry>
#include <memory>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>
#include <utility>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3f;

void Nearest::begin(std::size_t wanted, float reach2) {
    count_ = 0;
    wanted_ = std::min(wanted, most);
    reach2_ = reach2;
}

void Nearest::offer(float distance2, std::uint32_t point) {
    if (distance2 > reach2_)
        return;
    const auto before = [](const Neighbour& a, const Neighbour& b) {
        return a.distance2 != b.distance2 ? a.distance2 < b.distance2 : a.point < b.point;
    };
    const Neighbour offered{distance2, point};
    std::size_t at = count_;
    if (count_ == wanted_) {
        if (!before(offered, found_[count_ - 1]))
            return;
        at = count_ - 1;
    } else {
        ++count_;
    }
    for (; at > 0 && before(offered, found_[at - 1]); --at)
        found_[at] = found_[at - 1];
    found_[at] = offered;
    if (count_ == wanted_)
        reach2_ = found_[count_ - 1].distance2;
}

/// A point, and its index in the cloud given.
struct alignas(16) NeighbourTree::Placed {
    std::array<float, 3> at; // not a Vector3f, whose copies are not those of plain bytes
    std::uint32_t index;

    [[nodiscard]] Vector3f point() const { return {at[0], at[1], at[2]}; }
};

/// Points in the order along an axis; those side by side in the order given.
struct NeighbourTree::Halving {
    std::size_t axis;

    /// Ascending in that order, and different for any two points. The bits of floats of one sign are in the order of
    /// their values.
    [[nodiscard]] std::uint64_t key(const Placed& point) const {
        const auto bits = std::bit_cast<std::uint32_t>(point.at[axis] + 0.0F); // no -0
        const std::uint32_t ordered = bits ^ ((bits >> 31) != 0 ? 0xffffffffU : 0x80000000U);
        return std::uint64_t(ordered) << 32 | point.index;
    }
    /// Keys of points evenly chosen, ascending.
    template <std::size_t count>
    [[nodiscard]] std::array<std::uint64_t, count> sample(std::span<const Placed> points) const {
        std::array<std::uint64_t, count> keys;
        for (std::size_t i = 0; i < count; ++i)
            keys[i] = key(points[(2 * i + 1) * points.size() / (2 * count)]);
        std::sort(keys.begin(), keys.end());
        return keys;
    }
    /// About that of the point that is at `place` of all. Not the greatest: some must stay behind it.
    template <std::size_t sampled>
    [[nodiscard]] std::uint64_t quantile(std::span<const Placed> points, std::size_t place) const {
        return sample<sampled>(points)[std::min(place * sampled / points.size(), sampled - 2)];
    }
    /// Moves the points whose keys are at most `last` to the front, and returns their number. Which points these are is
    /// a coin flip for the processor, so nothing branches on it.
    std::size_t move_to_front(std::span<Placed> points, std::uint64_t last) const {
        std::size_t front = 0;
        for (Placed& each : points) {
            const Placed point = each;
            each = points[front];
            points[front] = point;
            front += key(point) <= last ? 1 : 0;
        }
        return front;
    }
    /// So that none before `middle` comes after it. Selection with a sample's quantile as the pivot (Floyd and Rivest
    /// 1975, Algorithm 489).
    void in_place(std::span<Placed> points, std::size_t middle) const {
        constexpr std::size_t few = 16, many = 512;
        constexpr int enough_turns = 24; // in an order made to mislead the samples
        for (int turn = 0; turn < enough_turns && points.size() > few; ++turn) {
            const std::uint64_t pivot =
                points.size() > many ? quantile<32>(points, middle) : quantile<5>(points, middle);
            const std::size_t front = move_to_front(points, pivot);
            points = middle < front ? points.first(front) : points.subspan(front);
            middle -= middle < front ? 0 : front;
        }
        std::nth_element(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(middle), points.end(),
                         [this](const Placed& a, const Placed& b) { return key(a) < key(b); });
    }
    /// The same into another place, for the middle of all, on all cores: a sample tells between which two points the
    /// middle lies, and only what is between them needs to be looked at again.
    void copy(std::span<const Placed> from, std::span<Placed> to) const {
        constexpr std::size_t sampled = 4096, off = 96, at_once = 1 << 15; // off: three sigma of the middle's place
        const auto keys = std::make_unique<std::array<std::uint64_t, sampled>>(sample<sampled>(from));
        const std::uint64_t low = (*keys)[sampled / 2 - off], high = (*keys)[sampled / 2 + off];
        constexpr std::size_t between = 1, parts = 3; // below, between, above
        const std::size_t blocks = (from.size() + at_once - 1) / at_once;
        std::vector<std::array<std::size_t, parts>> next(blocks, {0, 0, 0});
        const auto for_each = [&](std::size_t block, auto&& visit) {
            auto places = next[block];
            for (const Placed& point :
                 from.subspan(block * at_once, std::min(at_once, from.size() - block * at_once))) {
                const std::uint64_t own = key(point);
                visit(point, places[std::size_t(own >= low) + std::size_t(own > high)]++);
            }
            return places;
        };
        tbb::parallel_for(std::size_t(0), blocks,
                          [&](std::size_t block) { next[block] = for_each(block, [](const Placed&, std::size_t) {}); });
        std::array<std::size_t, parts + 1> starts{};
        for (std::size_t part = 0, before = 0; part < parts; ++part) {
            for (auto& block : next)
                before += std::exchange(block[part], before);
            starts[part + 1] = before;
        }
        tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
            (void)for_each(block, [&](const Placed& point, std::size_t place) { to[place] = point; });
        });
        const std::size_t middle = from.size() / 2;
        const bool bracketed = starts[between] <= middle && middle < starts[between + 1];
        const std::size_t first = bracketed ? starts[between] : 0, end = bracketed ? starts[between + 1] : to.size();
        in_place(to.subspan(first, end - first), middle - first);
    }
};

NeighbourTree::NeighbourTree(std::span<const Vector3f> points) {
    // Levels whose nodes are halved by all cores. Their number may not depend on that of the cores: neither does the
    // order of the points then.
    constexpr std::size_t worth_all_cores = 1 << 16;
    constexpr int most_wide = 6;
    int wide = 0;
    while (wide < most_wide && (points.size() >> wide) >= worth_all_cores)
        ++wide;
    Untouched<Placed> placed(points.size()), spare(wide > 0 ? points.size() : 0);
    Untouched<Placed>& first = wide % 2 == 0 ? placed : spare; // every wide level moves the points to the other
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        first[i] = {{points[i].x(), points[i].y(), points[i].z()}, static_cast<std::uint32_t>(i)};
    });
    while ((points.size() >> levels_) >= leaf)
        ++levels_;
    boxes_.resize((std::size_t(2) << levels_) - 1);
    build(first, wide % 2 == 0 ? spare : placed, {0, levels_, wide});
    spare = {};
    points_.resize(points.size());
    original_.resize(points.size());
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        points_[i] = placed[i].point();
        original_[i] = placed[i].index;
    });
}

/// The axis along which most points are far apart; in large nodes between the eighth and the seventh eighth of a
/// sample, since strays widen a box along all axes. A wall halved along its noise would make two layers. `box_of_all`
/// is called where the box must be known.
template <class BoxOfAll>
std::size_t NeighbourTree::split_axis(std::span<const Placed> points, const BoxOfAll& box_of_all) {
    constexpr std::size_t sampled = 32, large = 8 * sampled;
    Vector3f width = Vector3f::Zero();
    for (std::size_t axis = 0; axis < 3 && points.size() > large; ++axis) {
        std::array<float, sampled> along;
        for (std::size_t i = 0; i < sampled; ++i)
            along[i] = points[(2 * i + 1) * points.size() / (2 * sampled)].at[axis];
        std::sort(along.begin(), along.end());
        width[static_cast<Eigen::Index>(axis)] = along[sampled - sampled / 8] - along[sampled / 8];
    }
    if (!(width.maxCoeff() > 0)) {
        const Box box = box_of_all();
        width = box.high - box.low;
    }
    Eigen::Index axis = 0;
    width.maxCoeff(&axis);
    return static_cast<std::size_t>(axis);
}

NeighbourTree::Box NeighbourTree::box_of(std::span<const Placed> points) {
    const auto infinite = Vector3f::Constant(std::numeric_limits<float>::infinity());
    Box box{infinite, -infinite};
    for (const Placed& point : points)
        box = box.joined({point.point(), point.point()});
    return box;
}

void NeighbourTree::build(std::span<Placed> points, std::span<Placed> spare, const Subtree& at) {
    Box& box = boxes_[at.root];
    if (at.levels == 0) {
        box = box_of(points);
        return;
    }
    const Halving halving{split_axis(points, [&] { return box_of(points); })};
    if (at.wide > 0) {
        halving.copy(points, spare);
        std::swap(points, spare);
    } else {
        halving.in_place(points, points.size() / 2);
    }
    const std::size_t half = points.size() / 2;
    const auto half_of = [&](std::span<Placed> all, std::size_t side) {
        return all.empty() ? all : side == 0 ? all.first(half) : all.subspan(half);
    };
    const auto build_half = [&](std::size_t side) {
        build(half_of(points, side), half_of(spare, side),
              {2 * at.root + 1 + side, at.levels - 1, std::max(at.wide - 1, 0)});
    };
    constexpr std::size_t worth_a_task = 4096;
    if (points.size() > worth_a_task) {
        tbb::parallel_invoke([&] { build_half(0); }, [&] { build_half(1); });
    } else {
        build_half(0);
        build_half(1);
    }
    box = boxes_[2 * at.root + 1].joined(boxes_[2 * at.root + 2]);
}

std::pair<std::size_t, std::size_t> NeighbourTree::leaf_range(std::size_t number) const {
    Node node{0, 0, points_.size(), levels_};
    for (int level = levels_ - 1; level >= 0; --level)
        node = (number >> level & 1) != 0 ? node.right() : node.left();
    return {node.begin, node.end};
}

void NeighbourTree::find_round(std::size_t index, std::size_t wanted, Nearest& found, float reach2) const {
    find(points_[index], index, wanted, found, reach2);
}

void NeighbourTree::find_near(const Vector3f& at, std::size_t wanted, Nearest& found, float reach2) const {
    find(at, size(), wanted, found, reach2);
}

void NeighbourTree::find(const Vector3f& at, std::size_t but, std::size_t wanted, Nearest& found, float reach2) const {
    found.begin(wanted, reach2);
    struct Visit {
        std::size_t node, begin, end;
        int levels;
        float distance2;
    };
    std::array<Visit, 64> stack;
    std::size_t depth = 0;
    stack[depth++] = {0, 0, points_.size(), levels_, 0};
    while (depth > 0) {
        Visit visit = stack[--depth];
        if (!found.may_hold(visit.distance2, visit.begin))
            continue;
        while (visit.levels > 0) { // down to the nearer leaf; the other halves wait
            const std::size_t middle = visit.begin + (visit.end - visit.begin) / 2;
            Visit left{2 * visit.node + 1, visit.begin, middle, visit.levels - 1, 0};
            Visit right{2 * visit.node + 2, middle, visit.end, visit.levels - 1, 0};
            left.distance2 = boxes_[left.node].distance2(at);
            right.distance2 = boxes_[right.node].distance2(at);
            const bool left_first = left.distance2 <= right.distance2;
            const Visit& later = left_first ? right : left;
            if (found.may_hold(later.distance2, later.begin))
                stack[depth++] = later;
            visit = left_first ? left : right;
        }
        if (!found.may_hold(visit.distance2, visit.begin))
            continue;
        for (std::size_t other = visit.begin; other < visit.end; ++other)
            if (other != but)
                found.offer((points_[other] - at).squaredNorm(), static_cast<std::uint32_t>(other));
    }
}

namespace {

Vector3d middle_of(std::span<const Vector3d> points) {
    using Box = Eigen::AlignedBox3d;
    const Box box = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, points.size()), Box(),
        [&](const auto& range, Box part) {
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                part.extend(points[i]);
            return part;
        },
        [](const Box& a, const Box& b) { return a.merged(b); });
    return points.empty() ? Vector3d(Vector3d::Zero()) : Vector3d(box.center());
}

} // namespace

std::vector<Vector3f> local_points(const Vector3d& middle, std::span<const Vector3d> points) {
    std::vector<Vector3f> local(points.size());
    tbb::parallel_for(std::size_t(0), points.size(),
                      [&](std::size_t i) { local[i] = (points[i] - middle).cast<float>(); });
    return local;
}

LocalCloud::LocalCloud(std::span<const Vector3d> points)
    : middle(middle_of(points)), tree(local_points(middle, points)) {}

} // namespace scanshade
