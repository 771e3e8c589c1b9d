// Rays from the points of a cloud, eight at a time. They start above the discs of their own surface.
#include "ao/cloud/disc_rays.h"

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

RaySurface discs_of(const CloudSurface& surface) {
    std::vector<Disc> all(surface.size());
    for (std::size_t i = 0; i < all.size(); ++i)
        all[i] = {surface.tree[i].cast<double>(), surface.normals[i].cast<double>(),
                  surface.normals[i].isZero() ? 0 : static_cast<double>(surface.disc_radius[i])};
    return RaySurface(std::span<const Disc>(all));
}

/// Rays `first` .. `first + 7` of a run; the last bundle may hold fewer.
void aim(RayBundle& bundle, const Eigen::Matrix3f& axes, const DirectionSet::Run& run, int first) {
    for (int i = 0; i < RayBundle::size; ++i) {
        const int ray = std::min(first + i, run.count - 1);
        const Vector3f direction = axes * Vector3f(run.x[ray], run.y[ray], run.z[ray]);
        const auto lane = static_cast<std::size_t>(i);
        bundle.x[lane] = direction.x(), bundle.y[lane] = direction.y(), bundle.z[lane] = direction.z();
        bundle.live[lane] = first + i < run.count ? -1 : 0;
    }
}

} // namespace

DiscRays::DiscRays(const CloudSurface& surface) : surface_(surface), discs_(discs_of(surface)) {}

RayBundle DiscRays::bundle_from(std::size_t place, const Vector3f& side, float radius) const {
    const float disc = surface_.disc_radius[place], rough = surface_.roughness[place];
    const float lift = shared::lift_of(disc, rough, static_cast<float>(discs_.rounding_m()));
    const Vector3d at = surface_.tree[place].cast<double>();
    RayBundle bundle;
    bundle.origin = discs_.local(at + static_cast<double>(lift) * side.cast<double>());
    bundle.far_m = std::max(radius - lift, 0.0F);
    bundle.own = {discs_.local(at), shared::own_reach(disc), shared::own_depth(disc, rough), side};
    return bundle;
}

float DiscRays::open(std::size_t place, const DirectionSet& directions, float radius,
                     const std::optional<Vector3f>& up) const {
    const Vector3f& normal = surface_.normals[place];
    RayBundle bundle = bundle_from(place, normal, radius);
    const Eigen::Matrix3f axes = axes_about(normal);
    const DirectionSet::Run run = directions.run(place);
    int free = 0;
    for (int first = 0; first < run.count; first += RayBundle::size) {
        aim(bundle, axes, run, first);
        for (std::size_t i = 0; up && i < RayBundle::size; ++i)
            if (Vector3f(bundle.x[i], bundle.y[i], bundle.z[i]).dot(*up) <= 0)
                bundle.live[i] = 0;
        discs_.drop_blocked(bundle);
        for (const int live : bundle.live)
            free += live != 0;
    }
    return static_cast<float>(free) / static_cast<float>(run.count);
}

DiscRays::Hits DiscRays::first_hits(std::size_t place, const Vector3f& side, const DirectionSet::Run& run) const {
    RayBundle bundle = bundle_from(place, side, std::numeric_limits<float>::max());
    aim(bundle, axes_about(side), run, 0);
    const auto [distance, met] = discs_.hits(bundle);
    Hits hits{distance, {}, {}, {}};
    for (std::size_t i = 0; i < RayBundle::size; ++i) {
        hits.direction[i] = {bundle.x[i], bundle.y[i], bundle.z[i]};
        if (met[i] < 0)
            continue;
        hits.place[i] = static_cast<std::uint32_t>(met[i]);
        hits.facing[i] = -hits.direction[i].dot(surface_.normals[hits.place[i]]);
    }
    return hits;
}

int DiscRays::seen_from(std::size_t place, const Vector3f& position) const {
    const Vector3f &normal = surface_.normals[place], apart = position - surface_.tree[place];
    const float distance = apart.norm(), disc = surface_.disc_radius[place];
    const float cosine = apart.dot(normal) / distance;
    if (!(std::abs(cosine) >= 0.1F) || distance <= 2 * disc)
        return 0;
    const int side = cosine < 0 ? -1 : 1;
    const float rough = surface_.roughness[place];
    const float lift = shared::lift_of(disc, rough, static_cast<float>(discs_.rounding_m()));
    // Past the own surface, but not past the other side of a thin board.
    const float past = std::min(shared::own_reach(disc), shared::own_depth(disc, rough) / std::abs(cosine));
    const Vector3f from = surface_.tree[place] + static_cast<float>(side) * lift * normal + past / distance * apart;
    return discs_.blocked(from.cast<double>(), position.cast<double>()) ? 0 : side;
}

} // namespace scanshade
