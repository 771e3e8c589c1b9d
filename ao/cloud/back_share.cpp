#include "ao/cloud/back_share.h"

#include <algorithm>
#include <cmath>
#include <tbb/parallel_for.h>

namespace scanshade {

namespace {

/// Its square is the share's without bias: that of the counted share is larger by what chance adds, which matters where
/// few rays meet backs.
float root_of_square(int back, int cast) {
    const auto hits = static_cast<float>(back), all = static_cast<float>(cast);
    return back > 1 ? std::sqrt(hits * (hits - 1) / (all * (all - 1))) : 0.0F;
}

} // namespace

BackShare back_share(const CloudSurface& surface, const DiscRays& rays, float radius, std::size_t most_leaves) {
    constexpr std::size_t runs = 3;      // of eight rays
    constexpr std::size_t together = 6;  // leaves, whose rays make one share
    constexpr float least_facing = 0.1F; // grazing hits say nothing
    const DirectionSet directions(DiscRays::together, 0);
    const std::size_t leaves = surface.tree.leaves(), every = (leaves - 1) / std::min(most_leaves, leaves) + 1;
    struct Counts {
        int cast = 0, back = 0;
    };
    std::vector<Counts> of(leaves);
    tbb::parallel_for(std::size_t(0), leaves, [&](std::size_t leaf) {
        const auto [begin, end] = surface.tree.leaf_range(leaf);
        const std::size_t index = begin + (end - begin) / 2;
        if (begin == end || leaf % every != 0 || surface.normals[index].isZero() || !(surface.disc_radius[index] > 0))
            return;
        const Eigen::Vector3f& normal = surface.normals[index];
        for (std::size_t run = 0; run < runs; ++run) {
            const DiscRays::Hits hits = rays.first_hits(index, normal, directions.run(runs * leaf + run));
            for (std::size_t i = 0; i < DiscRays::together; ++i) {
                ++of[leaf].cast;
                of[leaf].back += hits.distance[i] <= radius && hits.facing[i] < -least_facing;
            }
        }
    });
    BackShare found;
    found.near.assign(surface.size(), 0);
    Counts all;
    for (std::size_t first = 0; first < leaves; first += together) {
        const std::size_t last = std::min(first + together, leaves);
        Counts some;
        for (std::size_t leaf = first; leaf < last; ++leaf) {
            some.cast += of[leaf].cast;
            some.back += of[leaf].back;
        }
        all.cast += some.cast;
        all.back += some.back;
        const std::size_t begin = surface.tree.leaf_range(first).first, end = surface.tree.leaf_range(last - 1).second;
        std::fill(found.near.begin() + static_cast<std::ptrdiff_t>(begin),
                  found.near.begin() + static_cast<std::ptrdiff_t>(end), root_of_square(some.back, some.cast));
    }
    found.mean = all.cast > 0 ? static_cast<double>(all.back) / all.cast : 0;
    return found;
}

} // namespace scanshade
