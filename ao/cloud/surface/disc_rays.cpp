// Rays from the points of a cloud. They start above the discs of their own surface.
#include "ao/cloud/surface/disc_rays.h"

#include "shaders/shared/cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

/// Axes with z along `normal` (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
Eigen::Matrix3f axes_about(const Vector3f& normal) {
    const float sign = std::copysign(1.0F, normal.z()), a = -1 / (sign + normal.z()), b = normal.x() * normal.y() * a;
    Eigen::Matrix3f axes;
    axes << Vector3f(1 + sign * normal.x() * normal.x() * a, sign * b, -sign * normal.x()),
        Vector3f(b, sign + normal.y() * normal.y() * a, -normal.y()), normal;
    return axes;
}

} // namespace

DiscRay DiscRays::ray_from(std::size_t index, const Vector3f& side, float radius) const {
    const float disc = surface_.disc_radius[index], rough = surface_.roughness[index];
    const float lift = shared::lift_of(disc, rough, static_cast<float>(discs_.rounding()));
    const Vector3d at = surface_.tree[index].cast<double>();
    DiscRay ray;
    ray.origin = discs_.local(at + static_cast<double>(lift) * side.cast<double>());
    ray.far = std::max(radius - lift, 0.0F);
    ray.own_point = discs_.local(at);
    ray.own_normal = side;
    ray.own_reach = shared::own_reach(disc);
    ray.own_depth = shared::own_depth(disc, rough);
    return ray;
}

void DiscRays::open(std::size_t leaf, const DirectionSet& directions, float radius, const std::optional<Vector3f>& up,
                    std::span<const char> asked, std::span<float> values) const {
    const auto [begin, end] = surface_.tree.leaf_range(leaf);
    std::array<DiscRay, NeighbourTree::leaf> rays;
    DiscTree::Origins origins;
    const auto is_asked = [&](std::size_t i) { return asked[i] != 0 && !surface_.normals[i].isZero(); };
    for (std::size_t i = begin; i < end; ++i)
        if (is_asked(i)) {
            rays[i - begin] = ray_from(i, surface_.normals[i], radius);
            origins.positions.extend(rays[i - begin].origin);
            origins.normals.extend(surface_.normals[i]);
        }
    if (origins.positions.isEmpty())
        return;
    origins.lowest = std::numeric_limits<float>::infinity();
    for (std::size_t i = begin; i < end; ++i)
        if (is_asked(i))
            origins.lowest =
                std::min(origins.lowest, surface_.normals[i].dot(rays[i - begin].origin - origins.positions.center()));
    const DiscTree::Start start = discs_.start_near(origins, radius);
    for (std::size_t i = begin; i < end; ++i) {
        if (!is_asked(i))
            continue;
        DiscRay& ray = rays[i - begin];
        const Eigen::Matrix3f axes = axes_about(surface_.normals[i]);
        const DirectionSet::Run run = directions.run(i);
        float free = 0;
        for (int k = 0; k < run.count; ++k) {
            ray.direction = axes * Vector3f(run.x[k], run.y[k], run.z[k]);
            const bool below = up && ray.direction.dot(*up) <= 0;
            if (!below)
                free += discs_.is_soft() ? discs_.transmitted(start, ray) : discs_.blocked(start, ray) ? 0.0F : 1.0F;
        }
        values[i] = free / static_cast<float>(run.count);
    }
}

DiscRays::Hits DiscRays::first_hits(std::size_t index, const Vector3f& side, const DirectionSet::Run& run) const {
    DiscRay ray = ray_from(index, side, std::numeric_limits<float>::max());
    const Eigen::Matrix3f axes = axes_about(side);
    Hits hits{};
    for (std::size_t i = 0; i < together; ++i) {
        const int k = std::min(static_cast<int>(i), run.count - 1);
        ray.direction = hits.direction[i] = axes * Vector3f(run.x[k], run.y[k], run.z[k]);
        const std::optional<DiscTree::Hit> met = static_cast<int>(i) < run.count ? discs_.first_hit(ray) : std::nullopt;
        hits.distance[i] = met ? met->distance : std::numeric_limits<float>::infinity();
        hits.index[i] = met ? met->index : 0;
        hits.facing[i] = met ? -ray.direction.dot(surface_.normals[met->index]) : 0;
    }
    return hits;
}

int DiscRays::seen_from(std::size_t index, const Vector3f& position) const {
    const Vector3f &normal = surface_.normals[index], apart = position - surface_.tree[index];
    const float distance = apart.norm(), disc = surface_.disc_radius[index];
    const float cosine = apart.dot(normal) / distance;
    if (!(std::abs(cosine) >= 0.1F) || distance <= 2 * disc)
        return 0;
    const int side = cosine < 0 ? -1 : 1;
    const float rough = surface_.roughness[index];
    const float lift = shared::lift_of(disc, rough, static_cast<float>(discs_.rounding()));
    // Past the own surface, but not past the other side of a thin board.
    const float past = std::min(shared::own_reach(disc), shared::own_depth(disc, rough) / std::abs(cosine));
    const Vector3f from = surface_.tree[index] + static_cast<float>(side) * lift * normal + past / distance * apart;
    constexpr float clear_of_ends = 1e-6F;
    DiscRay ray;
    ray.origin = discs_.local(from.cast<double>());
    ray.direction = position - from;
    ray.near = clear_of_ends;
    ray.far = 1 - clear_of_ends;
    constexpr float half = 0.5F;
    const DiscTree::Start start = discs_.start_at_root();
    const bool hidden = discs_.is_soft() ? discs_.transmitted(start, ray) < half : discs_.blocked(start, ray);
    return hidden ? 0 : side;
}

} // namespace scanshade
