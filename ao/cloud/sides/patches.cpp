// Patches: union and find over pairs, the surest first: within regions on all cores, then between them.
#include "ao/cloud/sides/patches.h"

#include "ao/cloud/sides/pieces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <tbb/parallel_for.h>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Vector3f;

constexpr std::size_t classes = 128; ///< of sureness
constexpr float sure = 0.85F, likely = 0.6F;

/// How sure pairs of a class are at most, 0 .. 1.
constexpr float sureness_of(std::size_t rank) { return 1 - static_cast<float>(rank) / (classes - 1); }

/// Pairs of neighbours whose planes are less than 75 degrees apart, by how sure they are. Sure pairs have parallel
/// planes, each point within the plane of the other.
///
/// Pairs within a region, points of indices side by side, are kept together: regions can be joined at the same time,
/// and what they touch fits into a core's cache.
class SurePairs {
  public:
    using Pair = std::array<std::uint32_t, 2>;

    explicit SurePairs(const CloudSurface& surface);
    [[nodiscard]] std::size_t regions() const { return starts_.size() - 1; }
    /// Stands for a region in of(): the pairs between two regions.
    [[nodiscard]] std::size_t between() const { return regions(); }
    /// Of a class, those within a region.
    [[nodiscard]] std::span<const Pair> of(std::size_t region, std::size_t rank) const {
        return std::span(pairs_).subspan(starts_[region][rank], starts_[region][rank + 1] - starts_[region][rank]);
    }

  private:
    std::vector<Pair> pairs_;
    std::vector<std::array<std::size_t, classes + 1>> starts_; ///< of the classes in each region, then between them
};

SurePairs::SurePairs(const CloudSurface& surface) {
    constexpr float least = 0.26F; // the cosine of 75 degrees
    constexpr std::size_t at_once = 1 << 13, blocks_of_region = 8;
    const std::size_t blocks = (surface.size() + at_once - 1) / at_once;
    const auto region_of = [](std::size_t point) { return point / (at_once * blocks_of_region); };
    enum Where : std::size_t { within, across, places };
    const auto for_each_pair = [&](std::size_t block, auto&& visit) {
        for (std::size_t i = block * at_once; i < std::min((block + 1) * at_once, surface.size()); ++i) {
            if (surface.normals[i].isZero())
                continue;
            for (const std::uint32_t j : surface.near[i]) {
                const auto& back = surface.near[j];
                if (i == j || (i > j && std::find(back.begin(), back.end(), i) != back.end()))
                    continue; // each pair once
                const Vector3f &a = surface.normals[i], &b = surface.normals[j];
                const float like = std::abs(a.dot(b));
                if (like < least)
                    continue;
                const Vector3f apart = (surface.tree[j] - surface.tree[i]).stableNormalized();
                const float beside = 1 - std::max(std::abs(apart.dot(a)), std::abs(apart.dot(b)));
                visit(Pair{static_cast<std::uint32_t>(i), j}, region_of(i) == region_of(j) ? within : across,
                      static_cast<std::size_t>((classes - 1) * (1 - std::clamp(like * beside, 0.0F, 1.0F))));
            }
        }
    };
    using Counts = std::array<std::array<std::size_t, classes>, places>;
    std::vector<Counts> next(blocks); // where the pairs of a block go
    tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
        next[block] = {};
        for_each_pair(block, [&](const Pair&, Where where, std::size_t rank) { ++next[block][where][rank]; });
    });
    const std::size_t regions = (blocks + blocks_of_region - 1) / blocks_of_region;
    starts_.resize(regions + 1);
    std::size_t before = 0;
    for (std::size_t region = 0; region <= regions; ++region) {
        const Where where = region < regions ? within : across;
        const std::size_t first = where == within ? region * blocks_of_region : 0;
        const std::size_t end = where == within ? std::min(first + blocks_of_region, blocks) : blocks;
        for (std::size_t rank = 0; rank < classes; ++rank) {
            starts_[region][rank] = before;
            for (std::size_t block = first; block < end; ++block)
                before += std::exchange(next[block][where][rank], before);
        }
        starts_[region][classes] = before;
    }
    pairs_.resize(before);
    tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
        for_each_pair(
            block, [&](const Pair& pair, Where where, std::size_t rank) { pairs_[next[block][where][rank]++] = pair; });
    });
}

/// As Patches::links says.
std::vector<SignedGraph::Link> links_between(const Patches& patches, const CloudSurface& surface,
                                             const SurePairs& pairs) {
    std::vector<std::vector<SignedGraph::Link>> of_region(pairs.regions() + 1);
    tbb::parallel_for(std::size_t(0), of_region.size(), [&](std::size_t region) {
        for (std::size_t rank = 0; rank < classes; ++rank) {
            const auto sureness = static_cast<double>(sureness_of(rank));
            for (const auto& [i, j] : pairs.of(region, rank)) {
                const std::uint32_t a = patches.patch[i], b = patches.patch[j];
                if (a == b)
                    continue;
                const int sign =
                    (surface.normals[i].dot(surface.normals[j]) < 0 ? -1 : 1) * patches.sign(i) * patches.sign(j);
                of_region[region].push_back({std::min(a, b), std::max(a, b), sign * sureness * sureness});
            }
        }
    });
    std::vector<SignedGraph::Link> links;
    for (const auto& some : of_region)
        links.insert(links.end(), some.begin(), some.end());
    return summed(std::move(links));
}

} // namespace

Patches patches_of(const CloudSurface& surface) {
    const SurePairs pairs(surface);
    constexpr std::uint32_t crumb = 8;
    const auto most = static_cast<std::uint32_t>(std::max<std::size_t>(32, surface.size() / 3000));
    Pieces pieces(surface.size());
    const auto join = [&](std::size_t region, std::size_t rank) {
        const bool surely = sureness_of(rank) >= sure;
        for (const auto& [i, j] : pairs.of(region, rank)) {
            const Pieces::Member one = pieces.find(i), other = pieces.find(j);
            if (one.piece == other.piece)
                continue;
            const bool small = surely ? pieces.size(one) + pieces.size(other) <= most
                                      : std::min(pieces.size(one), pieces.size(other)) <= crumb;
            if (small)
                pieces.join(one, other, surface.normals[i].dot(surface.normals[j]) < 0);
        }
    };
    std::size_t sure_classes = 0, likely_classes = 0;
    while (sure_classes < classes && sureness_of(sure_classes) >= sure)
        ++sure_classes;
    while (likely_classes < classes && sureness_of(likely_classes) >= likely)
        ++likely_classes;
    // Sure pairs within regions, all regions at the same time; then those between regions, which are few; then crumbs.
    tbb::parallel_for(std::size_t(0), pairs.regions(), [&](std::size_t region) {
        for (std::size_t rank = 0; rank < sure_classes; ++rank)
            join(region, rank);
    });
    for (std::size_t rank = 0; rank < sure_classes; ++rank)
        join(pairs.between(), rank);
    for (std::size_t rank = sure_classes; rank < likely_classes; ++rank)
        for (std::size_t region = 0; region <= pairs.between(); ++region)
            join(region, rank);
    Patches patches{std::vector<std::uint32_t>(surface.size()), std::vector<char>(surface.size()), 0, {}};
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        const auto [piece, turned] = pieces.found(static_cast<std::uint32_t>(i));
        patches.patch[i] = piece;
        patches.turned[i] = turned;
    });
    constexpr auto nobody = static_cast<std::uint32_t>(-1);
    std::vector<std::uint32_t> number(surface.size(), nobody);
    for (std::uint32_t& patch : patches.patch) {
        if (number[patch] == nobody)
            number[patch] = patches.count++;
        patch = number[patch];
    }
    patches.links = links_between(patches, surface, pairs);
    return patches;
}

std::vector<SignedGraph::Link> summed(std::vector<SignedGraph::Link> links) {
    std::vector<std::size_t> starts(2, 0); // by first node
    for (const SignedGraph::Link& link : links) {
        if (link.a + 2 >= starts.size())
            starts.resize(2 * std::size_t(link.a) + 3, 0);
        ++starts[link.a + 2];
    }
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    std::vector<SignedGraph::Link> sorted(links.size());
    for (const SignedGraph::Link& link : links)
        sorted[starts[link.a + 1]++] = link;
    links.swap(sorted);
    tbb::parallel_for(std::size_t(0), starts.size() - 1, [&](std::size_t a) {
        std::stable_sort(links.begin() + static_cast<std::ptrdiff_t>(starts[a]),
                         links.begin() + static_cast<std::ptrdiff_t>(starts[a + 1]),
                         [](const SignedGraph::Link& one, const SignedGraph::Link& other) { return one.b < other.b; });
    });
    std::size_t kept = 0;
    for (std::size_t k = 0; k < links.size(); ++k) {
        if (kept > 0 && links[kept - 1].a == links[k].a && links[kept - 1].b == links[k].b)
            links[kept - 1].weight += links[k].weight;
        else
            links[kept++] = links[k];
    }
    links.resize(kept);
    return links;
}

} // namespace scanshade
