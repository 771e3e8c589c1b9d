// k-d tree: median splits along the widest axis; the search opens the nearer half first.
#include "ao/cloud/surface/neighbours.h"

#include <algorithm>
#include <Eigen/Geometry>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

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

struct NeighbourTree::Placed {
    Vector3f point;
    std::uint32_t index;
};

NeighbourTree::NeighbourTree(std::span<const Vector3f> points) {
    Untouched<Placed> placed(points.size());
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        placed[i] = {points[i], static_cast<std::uint32_t>(i)};
    });
    while ((points.size() >> levels_) >= leaf)
        ++levels_;
    boxes_.resize((std::size_t(2) << levels_) - 1);
    build(placed, 0, levels_);
    points_.resize(points.size());
    original_.resize(points.size());
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        points_[i] = placed[i].point;
        original_[i] = placed[i].index;
    });
}

/// The axis along which most points are far apart. In large nodes between the eighth and the seventh eighth of a
/// sample, since strays widen a box along all axes. A wall halved along its noise would make two layers.
int NeighbourTree::split_axis(std::span<const Placed> points, const Vector3f& box) {
    constexpr std::size_t sampled = 32, large = 8 * sampled;
    Vector3f width = box;
    for (int axis = 0; axis < 3 && points.size() > large; ++axis) {
        std::array<float, sampled> along;
        for (std::size_t i = 0; i < sampled; ++i)
            along[i] = points[(2 * i + 1) * points.size() / (2 * sampled)].point[axis];
        std::sort(along.begin(), along.end());
        width[axis] = along[sampled - sampled / 8] - along[sampled / 8];
    }
    if (!(width.maxCoeff() > 0))
        width = box;
    int axis = 0;
    width.maxCoeff(&axis);
    return axis;
}

NeighbourTree::Box NeighbourTree::box_of(std::span<const Placed> points) {
    const auto infinite = Vector3f::Constant(std::numeric_limits<float>::infinity());
    const auto join = [](const Box& a, const Box& b) { return Box{a.low.cwiseMin(b.low), a.high.cwiseMax(b.high)}; };
    const auto round = [&](const auto& range, Box box) {
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            box = join(box, {points[i].point, points[i].point});
        return box;
    };
    constexpr std::size_t worth_tasks = 1 << 18;
    const tbb::blocked_range<std::size_t> all(0, points.size(), worth_tasks / 8);
    const Box nothing{infinite, -infinite};
    return points.size() < worth_tasks ? round(all, nothing) : tbb::parallel_reduce(all, nothing, round, join);
}

void NeighbourTree::build(std::span<Placed> points, std::size_t node, int levels) {
    const Box& box = boxes_[node] = box_of(points);
    if (levels == 0)
        return;
    const int axis = split_axis(points, box.high - box.low);
    const std::size_t half = points.size() / 2;
    std::nth_element(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(half), points.end(),
                     [axis](const Placed& a, const Placed& b) {
                         return a.point[axis] != b.point[axis] ? a.point[axis] < b.point[axis] : a.index < b.index;
                     });
    const auto left = [&] { build(points.first(half), 2 * node + 1, levels - 1); };
    const auto right = [&] { build(points.subspan(half), 2 * node + 2, levels - 1); };
    constexpr std::size_t worth_a_task = 4096;
    if (points.size() > worth_a_task) {
        tbb::parallel_invoke(left, right);
    } else {
        left();
        right();
    }
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

void NeighbourTree::find_near(const Vector3f& at, std::size_t wanted, Nearest& found) const {
    find(at, size(), wanted, found, std::numeric_limits<float>::infinity());
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
