#include "ao/cloud/chosen_points.h"

#include "projection/base/hash.h"
#include "projection/base/indices_where.h"

#include <algorithm>
#include <functional>

namespace scanshade {

using Eigen::Vector3d;

std::vector<Vector3d> sampled(std::span<const Vector3d> points, const Indices& indices, std::size_t wanted) {
    const double share =
        std::min(1.0, static_cast<double>(wanted) / static_cast<double>(std::max<std::size_t>(indices.size(), 1)));
    const auto chosen = static_cast<std::uint64_t>(share * 0x1p32);
    std::vector<Vector3d> some;
    for (const std::uint32_t i : indices_where(indices, [&](std::uint32_t point) { return hash(point) < chosen; }))
        some.push_back(points[i]);
    return some;
}

std::vector<NoisePlace> noise_places(std::span<const Vector3d> points, const Indices& those) {
    struct Hashed {
        std::uint32_t hash, number;
        bool operator<(const Hashed& other) const {
            return hash != other.hash ? hash < other.hash : number < other.number;
        }
    };
    // A threshold that four times as many are below, so that few have to be sorted.
    const double share = 4.0 * NoisePlace::wanted / static_cast<double>(std::max<std::size_t>(those.size(), 1));
    const auto chosen = static_cast<std::uint64_t>(std::min(share, 1.0) * 0x1p32);
    std::vector<Hashed> lowest;
    for (const std::uint32_t number : indices_where(those, [&](std::uint32_t i) { return hash(i) < chosen; }))
        lowest.push_back({hash(number), number});
    std::ranges::sort(lowest, std::less());
    std::vector<NoisePlace> places;
    for (std::size_t k = 0; k < std::min(lowest.size(), NoisePlace::wanted); ++k)
        places.push_back({lowest[k].number, points[lowest[k].number]});
    return places;
}

Indices finite(std::span<const Vector3d> points) {
    return indices_where(points.size(), [&](std::size_t i) { return points[i].allFinite(); });
}

} // namespace scanshade
