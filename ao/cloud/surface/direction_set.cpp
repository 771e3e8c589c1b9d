// Cosine-weighted directions for many neighbouring points.
#include "ao/cloud/surface/direction_set.h"

#include "ao/raycast/low_discrepancy.h"
#include "projection/base/hash.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace scanshade {
namespace {

/// Sort key. Eight rays are traced together: those of one sector of azimuth, up one sector and down the next.
int order_of(const Eigen::Vector3f& d, std::size_t rays) {
    const int sectors = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(rays) / 8)));
    const double turn =
        std::atan2(static_cast<double>(d.y()), static_cast<double>(d.x())) / (2 * std::numbers::pi) + 0.5;
    const int sector = std::min(static_cast<int>(turn * sectors), sectors - 1), height = static_cast<int>(1000 * d.z());
    return sector * 2048 + (sector % 2 ? height : 1024 - height);
}

} // namespace

std::vector<Eigen::Vector3d> spread_directions(int count) {
    std::vector<Eigen::Vector3d> directions;
    for (int i = 0; i < count; ++i) {
        const double z = 1 - (2 * i + 1.0) / count, turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
        const double across = std::sqrt(1 - z * z);
        directions.emplace_back(across * std::cos(turn), across * std::sin(turn), z);
    }
    return directions;
}

DirectionSet::DirectionSet(int rays, int seed)
    : rays_(static_cast<std::size_t>(rays)), runs_(std::max<std::size_t>(16384 / rays_, 1)) {
    const std::uint32_t key = hash(static_cast<std::uint32_t>(seed));
    std::vector<Eigen::Vector3f> all;
    for (std::uint32_t i = 0; i < rays_ * runs_; ++i) {
        const double a = (owen_scrambled(bits_reversed(i), key) + 0.5) * 0x1p-32;
        const double b = owen_scrambled(sobol(i), hash(key ^ 0x5bd1e995U)) * 0x1p-32 * 2 * std::numbers::pi;
        all.emplace_back(static_cast<float>(std::sqrt(a) * std::cos(b)), static_cast<float>(std::sqrt(a) * std::sin(b)),
                         static_cast<float>(std::sqrt(1 - a)));
    }
    std::vector<std::pair<int, std::size_t>> order(all.size());
    for (std::size_t i = 0; i < all.size(); ++i)
        order[i] = {order_of(all[i], rays_), i};
    for (auto run = order.begin(); run != order.end(); run += static_cast<std::ptrdiff_t>(rays_))
        std::sort(run, run + static_cast<std::ptrdiff_t>(rays_));
    for (const auto& [sector_and_height, i] : order) {
        const Eigen::Vector3f& d = all[i];
        x_.push_back(d.x());
        y_.push_back(d.y());
        z_.push_back(d.z());
    }
}

} // namespace scanshade
