// The extent of a cloud by order statistics, and strays by the distance of their neighbours.
#include "ao/cloud/extent.h"

#include "ao/cloud/surface/leaf_neighbours.h"
#include "ao/cloud/surface/order_statistics.h"
#include "projection/base/indices_where.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tbb/parallel_for.h>
#include <vector>

namespace scanshade {
namespace {

using Eigen::Vector3d;

constexpr double lonely_share = 0.1; ///< distance of the sixth neighbour / distance from the centre

/// `of(coordinates)` along each axis; it may reorder them.
template <class Of>
Vector3d along_axes(std::span<const Vector3d> points, Of&& of) {
    Vector3d result;
    tbb::parallel_for(0, 3, [&](int axis) {
        std::vector<double> along(points.size());
        std::transform(points.begin(), points.end(), along.begin(), [&](const Vector3d& p) { return p[axis]; });
        result[axis] = of(along);
    });
    return result;
}

Vector3d median_of(std::span<const Vector3d> points) {
    return along_axes(points, [](std::vector<double>& along) { return ranked(along, along.size() / 2); });
}

/// The diagonal of the box that holds all but the lowest and highest hundredth along each axis.
double size_of(std::span<const Vector3d> points) {
    const Vector3d sizes = along_axes(points, [](std::vector<double>& along) {
        const std::size_t cut = along.size() / 100;
        const double low = ranked(along, cut);
        return ranked(along, along.size() - 1 - cut) - low;
    });
    return sizes.norm();
}

} // namespace

Extent extent_of(std::span<const Vector3d> sample) {
    Extent extent;
    if (sample.empty())
        return extent;
    extent.centre = median_of(sample);
    // Single precision suffices: strays lie so far from each other that rounding does not matter.
    const NeighbourTree tree(local_points(extent.centre, sample));
    std::vector<char> lonely(sample.size());
    for_each_neighbourhood(tree, 6, [&](std::size_t i, std::span<const Nearest::Neighbour> near) {
        const double sixth = near.empty() ? 0 : std::sqrt(static_cast<double>(near.back().distance2));
        lonely[tree.original(i)] = near.size() == 6 && sixth > lonely_share * static_cast<double>(tree[i].norm());
    });
    std::vector<std::pair<double, std::uint32_t>> far; // by distance, of those that are not lonely
    for (std::uint32_t i = 0; i < sample.size(); ++i)
        if (!lonely[i])
            far.emplace_back((sample[i] - extent.centre).norm(), i);
    if (10 * far.size() < 9 * sample.size()) { // so sparse that all are lonely
        far.clear();
        for (std::uint32_t i = 0; i < sample.size(); ++i)
            far.emplace_back((sample[i] - extent.centre).norm(), i);
    }
    constexpr double surely = 0.98, step = 2;
    std::size_t last = static_cast<std::size_t>(surely * static_cast<double>(far.size() - 1));
    (void)ranked(far, last);
    std::sort(far.begin() + static_cast<std::ptrdiff_t>(last), far.end());
    while (last + 1 < far.size() && far[last + 1].first <= step * far[last].first)
        ++last;
    // The sample may have missed the farthest of the cloud; half of the step is left to them.
    extent.farthest = far[last].first * std::sqrt(step);
    std::vector<Vector3d> within;
    for (std::size_t k = 0; k <= last; ++k)
        within.push_back(sample[far[k].second]);
    extent.size = size_of(within);
    return extent;
}

std::vector<std::uint32_t> drop_strays(CloudSurface& surface, const Vector3d& centre, double spacing) {
    constexpr std::size_t sixth = 5;
    constexpr float lonely_spacings = 8, detached_from = 4, apart_from = 1.5F;
    Untouched<float> reach(surface.size()); // distance of the sixth neighbour
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        reach[i] = (surface.tree[surface.near[i][sixth]] - surface.tree[i]).norm();
    });
    const Eigen::Vector3f from = (centre - surface.middle).cast<float>();
    enum Kind : char { connected, detached, lonely };
    std::vector<Kind> kind(surface.size(), connected);
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        if (reach[i] > lonely_spacings * static_cast<float>(spacing) &&
            reach[i] > static_cast<float>(lonely_share) * (surface.tree[i] - from).norm()) {
            kind[i] = lonely;
            return;
        }
        std::array<float, sixth + 1> of_near;
        for (std::size_t k = 0; k < of_near.size(); ++k)
            of_near[k] = reach[surface.near[i][k]];
        of_near = ascending(of_near);
        const float second = (surface.tree[surface.near[i][1]] - surface.tree[i]).norm();
        if (reach[i] > detached_from * of_near[1] || second > apart_from * of_near[of_near.size() / 2])
            kind[i] = detached;
    });
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        if (kind[i] != connected)
            surface.disc_radius[i] = 0;
    });
    return indices_where(surface.size(), [&](std::size_t i) { return kind[i] == lonely; });
}

} // namespace scanshade
