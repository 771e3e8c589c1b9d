// A cloud as a surface: planes of least squares, discs as wide as the gaps.
#include "ao/cloud/surface/cloud_surface.h"

#include "ao/cloud/surface/cloud_gpu.h"
#include "ao/cloud/surface/leaf_neighbours.h"
#include "ao/cloud/surface/moments.h"
#include "ao/cloud/surface/order_statistics.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <functional>
#include <limits>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

constexpr std::size_t usual = shared::cloud_neighbours, wider = Nearest::most;
/// Discs of 1.13 spacings. With random points 2 % of a surface stay uncovered. Larger discs cost more, since they reach
/// beyond edges (RMSE 0.024; at 1.2 it is 0.046, at 0.6 0.028).
constexpr float disc_over_gap = 0.8F;
constexpr float sixth_on_grid = 1.414F; ///< distance of the sixth neighbour / spacing

/// The least-squares plane through a neighbourhood: near points weigh most, so that edges stay sharp.
struct Plane {
    Vector3f normal = Vector3f::Zero();
    float variance_across = 0;                    ///< along the normal
    float variance_narrow = 0, variance_wide = 0; ///< within the plane
};

Plane plane_round(const NeighbourTree& tree, std::size_t index, std::span<const Nearest::Neighbour> near) {
    if (near.size() < 2 || !(near.back().distance2 > 0))
        return {};
    const Vector3f& at = tree[index];
    const float scale = -2 / near.back().distance2; // the farthest weighs e^-2
    float sum = 1;
    Vector3f mean = Vector3f::Zero();
    Eigen::Matrix3f spread = Eigen::Matrix3f::Zero();
    for (const auto& [distance2, other] : near) {
        const float weight = std::exp(scale * distance2);
        const Vector3f offset = tree[other] - at;
        sum += weight;
        mean += weight * offset;
        spread += weight * offset * offset.transpose();
    }
    mean /= sum;
    spread = spread / sum - mean * mean.transpose();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> axes;
    axes.computeDirect(spread);
    const Vector3f variance = axes.eigenvalues().cwiseMax(0);
    return {axes.eigenvectors().col(0), variance[0], variance[1], variance[2]};
}

/// Whether points lie on a line rather than in a plane.
bool on_a_line(const Plane& plane) { return !(plane.variance_narrow > 0.01F * plane.variance_wide); }

/// Discs are as wide as the gaps to their neighbours, within half and twice their neighbours' discs: an outlier must
/// not get a large disc.
void limit_discs(CloudSurface& surface) {
    Untouched<float> limited(surface.size());
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        std::array<float, CloudSurface::kept> round;
        std::transform(surface.near[i].begin(), surface.near[i].end(), round.begin(),
                       [&](std::uint32_t other) { return surface.disc_radius[other]; });
        const float usual_radius = ascending(round)[round.size() / 2];
        limited[i] = usual_radius > 0 ? std::clamp(surface.disc_radius[i], usual_radius / 2, 2 * usual_radius)
                                      : surface.disc_radius[i];
    });
    surface.disc_radius = std::move(limited);
}

bool is_direction(const Vector3d& normal) { return normal.allFinite() && normal.norm() > 0.1; }

/// Orients estimated normals like given ones next to them.
void orient_like_given(CloudSurface& surface, std::span<const Vector3d> given) {
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) { // given normals are not turned
        if (is_direction(given[surface.tree.original(i)]))
            return;
        Vector3f beside = Vector3f::Zero();
        for (const std::uint32_t j : surface.near[i])
            if (is_direction(given[surface.tree.original(j)]))
                beside += surface.normals[j];
        if (surface.normals[i].dot(beside) < 0)
            surface.normals[i] = -surface.normals[i];
    });
}

} // namespace

float spacing_of(const LocalCloud& points) {
    constexpr std::size_t wanted = 6;
    std::vector<float> sixth(points.size());
    for_each_neighbourhood(points.tree, wanted, [&](std::size_t i, std::span<const Nearest::Neighbour> near) {
        sixth[i] = near.empty() ? 0 : std::sqrt(near.back().distance2);
    });
    return median_of_lengths(sixth) / sixth_on_grid;
}

double share_on_lines(const CloudSurface& surface) {
    constexpr std::size_t enough = 20000;
    constexpr float narrow = 0.02F; // variance across / along
    const std::size_t step = std::max<std::size_t>(1, surface.size() / enough);
    const auto on_line = [&](std::size_t i) {
        Vector3f middle = Vector3f::Zero();
        for (const std::uint32_t j : surface.near[i])
            middle += surface.tree[j] / CloudSurface::kept;
        Eigen::Matrix3f spread = Eigen::Matrix3f::Zero();
        for (const std::uint32_t j : surface.near[i])
            spread += (surface.tree[j] - middle) * (surface.tree[j] - middle).transpose();
        const Vector3f variance = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f>(spread).eigenvalues();
        return variance[1] < narrow * variance[2];
    };
    const std::size_t looked_at = surface.size() / step;
    const std::size_t lines = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, looked_at), std::size_t(0),
        [&](const auto& range, std::size_t sum) {
            for (std::size_t k = range.begin(); k < range.end(); ++k)
                sum += on_line(k * step + step / 2);
            return sum;
        },
        std::plus<>());
    return looked_at > 0 ? static_cast<double>(lines) / static_cast<double>(looked_at) : 0;
}

CloudSurface cloud_surface(LocalCloud&& points, std::span<const Vector3d> normals, CloudGpu* gpu,
                           std::span<const Vector3f> axes) {
    const std::size_t count = points.size();
    CloudSurface surface{points.middle, std::move(points.tree), {}, {}, {}, {}, {}, {}};
    Untouched<float> cosines(normals.empty() ? 0 : count); // between given normals and planes
    surface.near.resize(count);
    surface.normals.resize(count);
    surface.disc_radius.resize(count);
    surface.roughness.resize(count);
    surface.flatness.resize(count);
    Untouched<float> sixth(count);
    std::atomic<bool> all_given = true;
    const auto settle = [&](std::size_t i, std::size_t found, Plane plane) {
        constexpr std::size_t soon = 16; // the file's order is another: each of its normals is a cache miss
        if (!normals.empty() && i + soon < count)
            __builtin_prefetch(&normals[surface.tree.original(i + soon)]);
        if (on_a_line(plane) && found == usual) {
            Nearest far;
            surface.tree.find_round(i, wider, far);
            plane = plane_round(surface.tree, i, far.all());
        }
        // Random points, one per s^2, have their sixth neighbour at 1.4 s. Where rows are farther apart than their
        // points, the narrow side's sqrt(variance) is 0.8 rows.
        surface.disc_radius[i] = disc_over_gap * std::max(sixth[i], std::sqrt(plane.variance_narrow));
        surface.roughness[i] = std::sqrt(plane.variance_across);
        const float variance = plane.variance_across + plane.variance_narrow + plane.variance_wide;
        surface.flatness[i] = on_a_line(plane) ? 0 : 1 - 3 * plane.variance_across / variance;
        surface.normals[i] = on_a_line(plane) ? Vector3f(Vector3f::Zero()) : plane.normal;
        if (!axes.empty() && !axes[surface.tree.original(i)].isZero())
            surface.normals[i] = axes[surface.tree.original(i)];
        if (normals.empty())
            return;
        if (const Vector3d& given = normals[surface.tree.original(i)]; is_direction(given)) {
            const Vector3f unit = given.normalized().cast<float>();
            cosines[i] = surface.normals[i].isZero() ? 1.0F : std::abs(unit.dot(surface.normals[i]));
            constexpr float flat = 0.1F; // roughness / spacing: the plane's normal is then within a degree or two
            const bool sure = !surface.normals[i].isZero() && surface.roughness[i] < flat * sixth[i] / sixth_on_grid;
            surface.normals[i] = sure ? checked_normal(unit, surface.normals[i]) : unit;
        } else {
            cosines[i] = 1;
            all_given.store(false, std::memory_order_relaxed);
        }
    };
    if (gpu) {
        gpu->neighbourhoods(
            surface.tree, surface.near, [&](std::size_t first, std::span<const shared::CloudRound> rounds) {
                tbb::parallel_for(std::size_t(0), rounds.size(), [&](std::size_t k) {
                    const auto& [normal, sixth_distance, variance, found] = rounds[k];
                    sixth[first + k] = sixth_distance;
                    settle(first + k, found, {{normal.x, normal.y, normal.z}, variance.x, variance.y, variance.z});
                });
            });
    } else {
        for_each_neighbourhood(surface.tree, usual, [&](std::size_t i, std::span<const Nearest::Neighbour> near) {
            for (std::size_t k = 0; k < CloudSurface::kept; ++k)
                surface.near[i][k] = k < near.size() ? near[k].point : static_cast<std::uint32_t>(i);
            sixth[i] = near.empty() ? 0 : std::sqrt(near[std::min<std::size_t>(5, near.size() - 1)].distance2);
            settle(i, near.size(), plane_round(surface.tree, i, near));
        });
    }
    surface.spacing = median_of_lengths(sixth) / sixth_on_grid;
    limit_discs(surface);
    if (!normals.empty()) {
        surface.agreement = static_cast<double>(median_of_lengths(cosines));
        if (!all_given)
            orient_like_given(surface, normals);
    }
    return surface;
}

} // namespace scanshade
