// Points recorded twice, found by sorting coordinates.
#include "ao/cloud/twins.h"

#include "projection/base/indices_where.h"

#include <algorithm>
#include <bit>
#include <tbb/parallel_sort.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using Indices = std::vector<std::uint32_t>;

std::uint64_t hash_of(const Vector3d& point) {
    std::uint64_t all = 0;
    for (const double along : point) {
        all = (all ^ std::bit_cast<std::uint64_t>(along)) * 0x9e3779b97f4a7c15ULL;
        all ^= all >> 32;
    }
    return all;
}

constexpr double hardly_any = 0.001; ///< copies / points

/// Copies have the same hash, so choosing points by it chooses all copies of a point or none.
bool any_twins(std::span<const Vector3d> points, const Indices& indices) {
    constexpr std::size_t enough = 4096;
    const std::uint64_t every = std::max<std::size_t>(1, indices.size() / enough);
    std::vector<std::uint64_t> hashes;
    for (const std::uint32_t i :
         indices_where(indices, [&](auto point) { return hash_of(points[point]) % every == 0; }))
        hashes.push_back(hash_of(points[i]));
    const std::size_t all = hashes.size();
    std::sort(hashes.begin(), hashes.end());
    hashes.erase(std::unique(hashes.begin(), hashes.end()), hashes.end());
    return static_cast<double>(all - hashes.size()) > hardly_any * static_cast<double>(all);
}

} // namespace

std::vector<Twin> take_out_twins(std::span<const Vector3d> points, std::span<const Vector3d> normals,
                                 Indices& indices) {
    return any_twins(points, indices) ? all_twins(points, normals, indices) : std::vector<Twin>();
}

std::vector<Twin> all_twins(std::span<const Vector3d> points, std::span<const Vector3d> normals, Indices& indices) {
    Indices order = indices;
    tbb::parallel_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        for (int axis = 0; axis < 3; ++axis)
            if (points[a][axis] != points[b][axis])
                return points[a][axis] < points[b][axis];
        return a < b;
    });
    std::vector<Twin> twins;
    std::vector<bool> is_twin(points.size());
    Indices kept; // at the same coordinates
    for (const std::uint32_t point : order) {
        if (!kept.empty() && points[kept.front()] != points[point])
            kept.clear();
        const auto same = std::ranges::find_if(
            kept, [&](std::uint32_t other) { return normals.empty() || !(normals[other].dot(normals[point]) < 0); });
        if (same == kept.end()) {
            kept.push_back(point);
        } else {
            twins.push_back({point, *same});
            is_twin[point] = true;
        }
    }
    std::erase_if(indices, [&](std::uint32_t index) { return is_twin[index]; });
    return twins;
}

void TwinLook::add(const Vector3d& point) {
    constexpr std::size_t enough = 8192;
    const std::uint64_t hash = hash_of(point);
    if (hash >= below_)
        return;
    ++counts_[hash];
    if (counts_.size() <= 2 * enough)
        return;
    std::vector<std::uint64_t> hashes;
    for (const auto& [each, count] : counts_)
        hashes.push_back(each);
    std::nth_element(hashes.begin(), hashes.begin() + enough, hashes.end());
    below_ = hashes[enough];
    std::erase_if(counts_, [&](const auto& each) { return each.first >= below_; });
}

double TwinLook::distinct() const {
    std::uint64_t all = 0;
    for (const auto& [hash, count] : counts_)
        all += count;
    return all > 0 ? static_cast<double>(counts_.size()) / static_cast<double>(all) : 1;
}

bool TwinLook::many() const { return 1 - distinct() > hardly_any; }

} // namespace scanshade
