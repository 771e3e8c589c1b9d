// Noise measured round places, on a whole cloud or on points gathered near them.
#include "ao/cloud/surface/shared_noise.h"

#include "ao/cloud/surface/cleaned_cloud.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tbb/parallel_for.h>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3f, Eigen::Vector3i;

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

std::optional<SharedNoise> known_noise(const Vector3d& middle, CloudNoise&& noise,
                                       std::span<const std::optional<bool>> opposed,
                                       std::span<const std::optional<Slab>> slabs) {
    const bool exceeds_spacing = noise_exceeds_spacing(slabs);
    if (!noise.known() && !exceeds_spacing)
        return std::nullopt;
    return SharedNoise{middle, std::move(noise), sides_agree(opposed, exceeds_spacing), exceeds_spacing};
}

} // namespace

NoiseLook look_for_noise(double radius, double spacing) {
    constexpr double widest_in_spacings = 38;
    const double widest = radius / 3;
    return {static_cast<float>(widest), static_cast<float>(std::min(1.5 * widest, widest_in_spacings * spacing))};
}

std::optional<SharedNoise> noise_at(std::span<const NoisePlace> places, const LocalCloud& cloud,
                                    std::span<const Vector3d> normals, const NoiseLook& look) {
    std::vector<std::size_t> indices;
    for (const NoisePlace& place : places) {
        Nearest nearest; // by position: a copy of a point may stand for it
        cloud.tree.find_near((place.point - cloud.middle).cast<float>(), 1, nearest);
        if (!nearest.all().empty())
            indices.push_back(nearest.all()[0].point);
    }
    std::vector<std::optional<bool>> opposed;
    for (const std::size_t index : normals.empty() ? std::vector<std::size_t>() : indices)
        opposed.push_back(opposed_beside(cloud.tree, normals, index));
    const bool sides = sides_agree(opposed, false);
    const std::span<const Vector3d> facing = sides ? normals : std::span<const Vector3d>();
    return known_noise(cloud.middle, CloudNoise(cloud.tree, look, facing, indices), opposed,
                       slabs_around(cloud.tree, facing, indices, look.reach));
}

NoisePlaces::NoisePlaces(std::span<const NoisePlace> places, const NoiseLook& look) : look_(look) {
    if (!(look.reach > 0 && std::isfinite(look.reach)))
        return;
    for (const NoisePlace& place : places) {
        const auto k = static_cast<std::uint32_t>(rounds_.size());
        rounds_.push_back({place, look.reach * look.reach, false, {Vector3f::Zero()}, {Vector3f::Zero()}});
        for (int dx = -1; dx <= 1; ++dx)
            for (int dy = -1; dy <= 1; ++dy)
                for (int dz = -1; dz <= 1; ++dz)
                    near_[cell(place.point, {dx, dy, dz})].push_back(k);
    }
}

std::int64_t NoisePlaces::cell(const Vector3d& point, const Vector3i& off) const {
    return number_of(point / static_cast<double>(look_.reach), off);
}

void NoisePlaces::add(std::uint32_t number, const Vector3d& point, const Vector3d* normal) {
    if (rounds_.empty())
        return;
    const auto found = near_.find(cell(point, {0, 0, 0}));
    if (found == near_.end())
        return;
    with_normals_ |= normal != nullptr;
    for (const std::uint32_t k : found->second) {
        Round& round = rounds_[k];
        const Vector3f offset = (point - round.place.point).cast<float>();
        if (!(offset.squaredNorm() <= round.reach2))
            continue;
        const Vector3f facing = normal ? Vector3f(normal->cast<float>()) : Vector3f(Vector3f::Zero());
        if (number == round.place.number) {
            round.complete = true;
            round.normals[0] = facing;
            continue;
        }
        round.points.push_back(offset);
        round.normals.push_back(facing);
        if (round.points.size() >= NoiseLook::most_points * 3 / 2)
            keep_nearest(round);
    }
}

/// So dense a place needs no wider balls.
void NoisePlaces::keep_nearest(Round& round) const {
    std::vector<std::uint32_t> order(round.points.size() - 1);
    std::iota(order.begin(), order.end(), 1U);
    const auto distance2 = [&](std::uint32_t i) { return round.points[i].squaredNorm(); };
    const auto last = order.begin() + static_cast<std::ptrdiff_t>(NoiseLook::most_points) - 1;
    std::nth_element(order.begin(), last, order.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return distance2(a) < distance2(b); });
    round.reach2 = distance2(*last);
    std::sort(order.begin(), last + 1); // in the order in which they came
    std::vector<Vector3f> points{round.points[0]}, normals{round.normals[0]};
    for (auto each = order.begin(); each <= last; ++each) {
        points.push_back(round.points[*each]);
        normals.push_back(round.normals[*each]);
    }
    round.points = std::move(points), round.normals = std::move(normals);
}

std::optional<SharedNoise> NoisePlaces::measured() const {
    std::vector<const Round*> rounds;
    for (const Round& round : rounds_)
        if (round.complete)
            rounds.push_back(&round);
    if (rounds.empty())
        return std::nullopt;
    const Vector3d middle = rounds[0]->place.point;
    std::vector<std::optional<float>> found(rounds.size());
    std::vector<Vector3f> positions(rounds.size());
    std::vector<std::optional<bool>> opposed(rounds.size());
    const auto each = [&](auto&& visit) {
        tbb::parallel_for(std::size_t(0), rounds.size(), [&](std::size_t k) {
            const NeighbourTree tree(rounds[k]->points);
            std::vector<Vector3d> normals;
            for (std::size_t i = 0; with_normals_ && i < rounds[k]->normals.size(); ++i)
                normals.push_back(rounds[k]->normals[i].cast<double>());
            std::size_t own = 0;
            while (tree.original(own) != 0)
                ++own;
            visit(k, tree, normals, own);
        });
    };
    bool sides = false;
    if (with_normals_) {
        each([&](std::size_t k, const NeighbourTree& tree, const std::vector<Vector3d>& normals, std::size_t own) {
            opposed[k] = opposed_beside(tree, normals, own);
        });
        sides = sides_agree(opposed, false);
    }
    std::vector<std::optional<Slab>> slabs(rounds.size());
    each([&](std::size_t k, const NeighbourTree& tree, const std::vector<Vector3d>& normals, std::size_t own) {
        const std::span<const Vector3d> facing = sides ? normals : std::span<const Vector3d>();
        found[k] = noise_round(tree, facing, own, look_);
        slabs[k] = slabs_around(tree, facing, std::array{own}, look_.reach)[0];
        positions[k] = (rounds[k]->place.point - middle).cast<float>();
    });
    return known_noise(middle, CloudNoise(positions, found), opposed, slabs);
}

} // namespace scanshade
