// Sides that are given: to a position, or recorded ones.
#include "ao/cloud/sides/sides.h"

#include <cmath>
#include <tbb/parallel_for.h>

namespace scanshade {

using Eigen::Vector3f;

Sides sides_to(const CloudSurface& surface, const Vector3f& position) {
    Sides sides{std::vector<std::int8_t>(surface.size(), 1), std::vector<float>(surface.size(), 1.0F), {}, 0, {}};
    std::vector<float> towards(surface.size()); // cosines
    for (std::size_t i = 0; i < surface.size(); ++i)
        towards[i] = surface.normals[i].dot((position - surface.tree[i]).stableNormalized());
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        float votes = towards[i];
        for (const std::uint32_t j : surface.near[i])
            if (j != i)
                votes += surface.normals[i].dot(surface.normals[j]) * towards[j];
        if (votes < 0)
            sides.sign[i] = -1;
    });
    return sides;
}

RecordedSides recorded_sides(const CloudSurface& surface, const Patches& patches) {
    std::vector<std::array<std::uint32_t, 2>> kinds(patches.count, {0, 0});
    for (std::size_t i = 0; i < surface.size(); ++i)
        ++kinds[patches.patch[i]][patches.turned[i] ? 1 : 0];
    // Heights over their neighbours, along the patch's side, of both kinds: sums for a t test.
    struct Heights {
        double sum[2] = {0, 0}, squares[2] = {0, 0};
    };
    std::vector<Heights> heights(patches.count);
    constexpr std::uint32_t fewest = 8;
    const auto mixed = [&](std::uint32_t patch) {
        const auto [one, other] = kinds[patch];
        return one + other >= fewest && 10 * std::min(one, other) >= one + other;
    };
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const std::uint32_t patch = patches.patch[i];
        if (!mixed(patch) || !(surface.disc_radius[i] > 0))
            continue;
        const Vector3f side = static_cast<float>(patches.sign(i)) * surface.normals[i];
        float mean = 0;
        for (const std::uint32_t j : surface.near[i])
            mean += (surface.tree[i] - surface.tree[j]).dot(side) / CloudSurface::kept;
        const double height = static_cast<double>(mean / surface.disc_radius[i]);
        heights[patch].sum[patches.turned[i] ? 1 : 0] += height;
        heights[patch].squares[patches.turned[i] ? 1 : 0] += height * height;
    }
    double all = 0, random = 0, opposed = 0;
    for (std::uint32_t patch = 0; patch < patches.count; ++patch) {
        const double one = kinds[patch][0], other = kinds[patch][1];
        if (one + other < fewest)
            continue;
        all += one + other;
        if (!mixed(patch))
            continue;
        const Heights& h = heights[patch];
        const double mean_one = h.sum[0] / one, mean_other = h.sum[1] / other;
        const double error =
            (h.squares[0] / one - mean_one * mean_one) / one + (h.squares[1] / other - mean_other * mean_other) / other;
        constexpr double surely = 3;
        if (error > 0 && (mean_one - mean_other) / std::sqrt(error) > surely)
            continue; // two sheets: those that face a side stand on it
        random += one + other;
        opposed += std::min(one, other);
    }
    return all > 0 ? RecordedSides{random / all, opposed / all} : RecordedSides{};
}

} // namespace scanshade
