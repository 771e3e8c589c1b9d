// Visibility of a point by rays, eight at a time.
#include "ao/raycast/ray_hemisphere.h"

#include "ao/raycast/low_discrepancy.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <tuple>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

// ---------------------------------------------------------------------------------------------------- directions

/// Index of a direction on a coarse grid of the hemisphere: sectors of azimuth, alternately up and down in elevation.
int place_of(const CosineDirections::Direction& d, int rays) {
    const int sectors = std::max(1, static_cast<int>(std::sqrt(rays / RayBundle::size)));
    const double turn = std::atan2(d.y, d.x) / (2 * std::numbers::pi) + 0.5;
    const int sector = std::min(static_cast<int>(turn * sectors), sectors - 1);
    const int height = static_cast<int>(1000 * d.z);
    return sector * 2048 + (sector % 2 ? height : 1024 - height);
}

/// Axes with z along `normal`, turned about it by `angle` (Duff et al. 2017, "Building an Orthonormal Basis,
/// Revisited").
Eigen::Matrix3f axes_about(const Vector3d& normal, double angle) {
    const double sign = std::copysign(1.0, normal.z()), a = -1 / (sign + normal.z()), b = normal.x() * normal.y() * a;
    const Vector3d x(1 + sign * normal.x() * normal.x() * a, sign * b, -sign * normal.x());
    const Vector3d y(b, sign + normal.y() * normal.y() * a, -normal.y());
    const double cosine = std::cos(angle), sine = std::sin(angle);
    Eigen::Matrix3d axes;
    axes << cosine * x + sine * y, cosine * y - sine * x, normal;
    return axes.cast<float>();
}

// ---------------------------------------------------------------------------------------------------- results

float occlusion(Falloff falloff, float share_of_radius) {
    constexpr float range = 0.615F;
    if (share_of_radius > 1)
        return 0;
    switch (falloff) {
    case Falloff::quad:
        return 1 - share_of_radius * share_of_radius;
    case Falloff::lin:
        return std::min(1.0F, (1 - share_of_radius) / range);
    case Falloff::hard:
        break;
    }
    return 1;
}

/// Sums of what rays see, by block of the sequence.
struct Tally {
    std::array<double, CosineDirections::blocks> open{};
    std::array<int, CosineDirections::blocks> cast{};

    void add(int block, float visible) {
        open[static_cast<std::size_t>(block)] += static_cast<double>(visible);
        ++cast[static_cast<std::size_t>(block)];
    }

    [[nodiscard]] std::pair<float, float> mean_and_error() const {
        double sum = 0;
        int count = 0, filled = 0;
        for (std::size_t b = 0; b < open.size(); ++b)
            sum += open[b], count += cast[b], filled += cast[b] > 0;
        if (count == 0)
            return {std::numeric_limits<float>::quiet_NaN(), 0.0F};
        const double mean = sum / count;
        double spread = 0;
        for (std::size_t b = 0; b < open.size(); ++b)
            if (cast[b] > 0)
                spread += std::pow(open[b] / cast[b] - mean, 2);
        // Blocks act as independent sets; the error of a low-discrepancy set falls as its size^-3/4.
        const double of_block = filled > 1 ? std::sqrt(spread / (filled - 1)) : 0;
        return {static_cast<float>(mean), static_cast<float>(of_block * std::pow(filled, -0.75))};
    }
};

/// Rotates up to eight directions about the normal; unused lanes and directions below all faces stay dead.
void aim(RayBundle& bundle, std::span<const CosineDirections::Direction> eight, const Eigen::Matrix3f& axes,
         std::span<const Vector3d> faces) {
    bundle.live.fill(0);
    for (std::size_t i = 0; i < RayBundle::size; ++i) {
        const auto& d = eight[std::min(i, eight.size() - 1)];
        const Vector3f turned = axes * Vector3f(d.x, d.y, d.z);
        bundle.x[i] = turned.x(), bundle.y[i] = turned.y(), bundle.z[i] = turned.z();
        const bool inside = !faces.empty() && std::all_of(faces.begin(), faces.end(), [&](const Vector3d& face) {
            return face.cast<float>().dot(turned) <= 0;
        });
        bundle.live[i] = i < eight.size() && !inside ? -1 : 0;
    }
}

} // namespace

Falloff falloff_named(std::string_view name) {
    Falloff falloff{};
    if (!OneOf(&falloff, falloff_words).set(name))
        throw Misuse(fmt::format("no falloff '{}', there are: hard, quad, lin", name));
    return falloff;
}

CosineDirections::CosineDirections(int rays, int seed, bool by_block)
    : rays_(rays), sets_(std::clamp(65536 / rays, 1, 256)) {
    directions_.reserve(static_cast<std::size_t>(rays_) * static_cast<std::size_t>(sets_));
    for (int set = 0; set < sets_; ++set) {
        const std::uint32_t key = hash(static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(set));
        for (int i = 0; i < rays_; ++i) {
            const auto index = static_cast<std::uint32_t>(i);
            const double a = (owen_scrambled(bits_reversed(index), hash(key)) + 0.5) * 0x1p-32;
            const double b = owen_scrambled(sobol(index), hash(key ^ 0x5bd1e995U)) * 0x1p-32 * 2 * std::numbers::pi;
            directions_.push_back({static_cast<float>(std::sqrt(a) * std::cos(b)),
                                   static_cast<float>(std::sqrt(a) * std::sin(b)), static_cast<float>(std::sqrt(1 - a)),
                                   static_cast<int>(static_cast<long>(i) * blocks / rays_)});
        }
        const auto place = [&](const Direction& one) {
            return std::pair(by_block ? one.block : 0, place_of(one, rays_));
        };
        std::stable_sort(directions_.end() - rays_, directions_.end(),
                         [&](const Direction& one, const Direction& two) { return place(one) < place(two); });
    }
}

std::span<const CosineDirections::Direction> CosineDirections::set_for(std::uint32_t key) const {
    const auto count = static_cast<std::size_t>(rays_);
    return {directions_.data() + key % static_cast<std::uint32_t>(sets_) * count, count};
}

RayHemisphere::RayHemisphere(const RaySurface& surface, const CosineDirections& directions, double radius_m,
                             bool all_falloffs)
    : surface_(surface), directions_(directions), radius_m_(radius_m), all_falloffs_(all_falloffs) {}

RayEstimate RayHemisphere::at(const RayStart& start) const {
    const double lift =
        std::max(start.lift_m, surface_.rounding_m()); // not a share of the radius, which may be infinite
    const Eigen::Matrix3f axes = axes_about(start.normal, 2 * std::numbers::pi * hash(start.key) * 0x1p-32);
    RayBundle bundle;
    bundle.origin = surface_.local(start.point + lift * start.normal);
    bundle.far_m = static_cast<float>(std::min(radius_m_ - lift, 1e30));
    bundle.own = {surface_.local(start.point), static_cast<float>(2 * start.disc_radius_m),
                  static_cast<float>(0.2 * start.disc_radius_m)};
    auto directions = directions_.set_for(hash(start.key ^ 0x68bc21ebU));
    if (const std::size_t part = directions.size() / CosineDirections::blocks; start.block)
        directions = directions.subspan(static_cast<std::size_t>(*start.block) * part, part);
    std::array<Tally, 3> tallies;
    for (std::size_t first = 0; first < directions.size(); first += RayBundle::size) {
        const auto eight = directions.subspan(first, std::min<std::size_t>(RayBundle::size, directions.size() - first));
        aim(bundle, eight, axes, start.faces);
        const auto cast = bundle.live;
        if (all_falloffs_) {
            const auto met = surface_.hits(bundle).distance;
            for (std::size_t i = 0; i < eight.size(); ++i)
                for (const Falloff falloff : {Falloff::hard, Falloff::quad, Falloff::lin})
                    if (cast[i])
                        tallies[static_cast<std::size_t>(falloff)].add(eight[i].block,
                                                                       1 - occlusion(falloff, met[i] / bundle.far_m));
        } else {
            surface_.drop_blocked(bundle);
            for (std::size_t i = 0; i < eight.size(); ++i)
                if (cast[i])
                    tallies[0].add(eight[i].block, bundle.live[i] ? 1.0F : 0.0F);
        }
    }
    RayEstimate estimate;
    for (std::size_t f = 0; f < (all_falloffs_ ? tallies.size() : 1); ++f)
        std::tie(estimate.visibility[f], estimate.standard_error[f]) = tallies[f].mean_and_error();
    return estimate;
}

} // namespace scanshade
