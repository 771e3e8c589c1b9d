// Noise measured on gathered points.
#include "ao/cloud/surface/shared_noise.h"

#include "ao/cloud/surface/fitted_cloud.h"

#include <algorithm>
#include <cmath>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3i;

namespace {

/// Cells far apart may share a number: then a few points are looked at in vain.
std::int64_t number_of(const Vector3d& scaled, const Vector3i& off) {
    std::int64_t all = 0;
    for (int axis = 0; axis < 3; ++axis) {
        constexpr double most = 1e15; // still whole numbers
        const auto along = static_cast<std::int64_t>(std::floor(std::clamp(scaled[axis], -most, most))) + off[axis];
        all = static_cast<std::int64_t>((static_cast<std::uint64_t>(all) ^ static_cast<std::uint64_t>(along)) *
                                        0x9e3779b97f4a7c15ULL);
    }
    return all;
}

} // namespace

NoisePlaces::NoisePlaces(std::vector<Place> places, double reach)
    : places_(std::move(places)), reach_(reach), gathered_(places_.size(), 0) {
    if (!(reach_ > 0))
        places_.clear();
    for (std::uint32_t k = 0; k < places_.size(); ++k) {
        sorted_.push_back(places_[k].number);
        for (int dx = -1; dx <= 1; ++dx)
            for (int dy = -1; dy <= 1; ++dy)
                for (int dz = -1; dz <= 1; ++dz)
                    near_[cell(places_[k].point, {dx, dy, dz})].push_back(k);
    }
    std::sort(sorted_.begin(), sorted_.end());
}

std::int64_t NoisePlaces::cell(const Vector3d& point, const Vector3i& off) const {
    return number_of(point / reach_, off);
}

void NoisePlaces::add(std::uint32_t number, const Vector3d& point, const Vector3d* normal) {
    constexpr std::uint32_t most = 2 * usual_points; // round a place
    if (places_.empty())
        return;
    const auto found = near_.find(cell(point, {0, 0, 0}));
    if (found == near_.end())
        return;
    const bool place = std::binary_search(sorted_.begin(), sorted_.end(), number);
    bool wanted = place;
    for (const std::uint32_t k : found->second)
        if (gathered_[k] < most && (places_[k].point - point).squaredNorm() <= reach_ * reach_) {
            ++gathered_[k];
            wanted = true;
        }
    if (!wanted)
        return;
    if (place)
        at_[number] = static_cast<std::uint32_t>(points_.size());
    points_.push_back(point);
    if (normal)
        normals_.push_back(*normal);
}

std::optional<SharedNoise> NoisePlaces::measured(double widest) const {
    constexpr std::size_t fewest = 64;
    if (points_.size() < fewest)
        return std::nullopt;
    const LocalCloud local(points_);
    std::vector<std::uint32_t> index_of(points_.size());
    for (std::uint32_t i = 0; i < local.size(); ++i)
        index_of[local.tree.original(i)] = i;
    std::vector<std::size_t> middles;
    for (const Place& place : places_)
        if (const auto found = at_.find(place.number); found != at_.end())
            middles.push_back(index_of[found->second]);
    const std::span<const Vector3d> normals =
        normals_.size() == points_.size() ? normals_ : std::span<const Vector3d>();
    const bool sides = !normals.empty() && sides_agree(local.tree, normals);
    CloudNoise noise(local.tree, static_cast<float>(widest), sides ? normals : std::span<const Vector3d>(), middles);
    if (!noise.known())
        return std::nullopt;
    return SharedNoise{local.middle, std::move(noise), sides};
}

} // namespace scanshade
