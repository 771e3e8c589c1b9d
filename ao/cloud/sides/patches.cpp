// Patches: union and find over pairs in the order of their sureness.
#include "ao/cloud/sides/patches.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tbb/parallel_for.h>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Vector3f;

constexpr int classes = 128;

/// Points joined into pieces. Each point knows whether it must be turned to agree with its piece.
class Pieces {
  public:
    explicit Pieces(std::size_t points) : parent_(points), turned_(points, 0), size_(points, 1) {
        std::iota(parent_.begin(), parent_.end(), 0U);
    }

    struct Member {
        std::uint32_t piece;
        bool turned; ///< against the piece's first point
    };
    Member find(std::uint32_t point) {
        bool turned = false;
        std::uint32_t root = point;
        for (; parent_[root] != root; root = parent_[root])
            turned ^= turned_[root] != 0;
        // Path compression: all points on the way become the root's children.
        for (bool rest = turned; parent_[point] != point;) {
            const std::uint32_t next = parent_[point];
            const bool own = turned_[point] != 0;
            parent_[point] = root;
            turned_[point] = rest;
            rest ^= own;
            point = next;
        }
        return {root, turned};
    }
    [[nodiscard]] std::uint32_t size(const Member& member) const { return size_[member.piece]; }

    void join(Member one, Member other, bool opposed) {
        if (size(one) < size(other))
            std::swap(one, other);
        parent_[other.piece] = one.piece;
        turned_[other.piece] = one.turned ^ other.turned ^ opposed;
        size_[one.piece] += size_[other.piece];
    }

  private:
    std::vector<std::uint32_t> parent_;
    std::vector<char> turned_;
    std::vector<std::uint32_t> size_;
};

/// Pairs of neighbours, the surest ones first, whose planes are less than 75 degrees apart. Sure pairs have parallel
/// planes, each point within the plane of the other.
class SurePairs {
  public:
    using Pair = std::array<std::uint32_t, 2>;

    explicit SurePairs(const CloudSurface& surface);
    [[nodiscard]] const std::vector<Pair>& all() const { return pairs_; }
    /// How sure all pairs from this one on are at most, 0 .. 1.
    [[nodiscard]] float sureness(std::size_t pair) const;

  private:
    std::vector<Pair> pairs_;
    std::vector<std::size_t> starts_; ///< of the classes of equal sureness
};

SurePairs::SurePairs(const CloudSurface& surface) : starts_(classes + 1, 0) {
    constexpr float least = 0.26F; // the cosine of 75 degrees
    constexpr std::size_t at_once = 1 << 13;
    const std::size_t blocks = (surface.size() + at_once - 1) / at_once;
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
                visit(static_cast<std::uint32_t>(i), j,
                      static_cast<std::size_t>((classes - 1) * (1 - std::clamp(like * beside, 0.0F, 1.0F))));
            }
        }
    };
    std::vector<std::array<std::size_t, classes>> next(blocks); // by block and class, where its pairs go
    tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
        next[block].fill(0);
        for_each_pair(block, [&](std::uint32_t, std::uint32_t, std::size_t rank) { ++next[block][rank]; });
    });
    std::size_t before = 0;
    for (std::size_t rank = 0; rank < classes; ++rank) {
        for (auto& block : next)
            before += std::exchange(block[rank], before);
        starts_[rank + 1] = before;
    }
    pairs_.resize(before);
    tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
        for_each_pair(block, [&](std::uint32_t i, std::uint32_t j, std::size_t rank) {
            pairs_[next[block][rank]++] = {i, j};
        });
    });
}

float SurePairs::sureness(std::size_t pair) const {
    const auto after = std::upper_bound(starts_.begin(), starts_.end(), pair);
    return 1 - static_cast<float>(after - starts_.begin() - 1) / (classes - 1);
}

/// As Patches::links says.
std::vector<SignedGraph::Link> links_between(const Patches& patches, const CloudSurface& surface,
                                             const SurePairs& pairs) {
    std::vector<SignedGraph::Link> links;
    const std::vector<SurePairs::Pair>& all = pairs.all();
    for (std::size_t k = 0; k < all.size(); ++k) {
        const auto& [i, j] = all[k];
        const std::uint32_t a = patches.patch[i], b = patches.patch[j];
        if (a == b)
            continue;
        const double sureness = static_cast<double>(pairs.sureness(k));
        const int sign = (surface.normals[i].dot(surface.normals[j]) < 0 ? -1 : 1) * patches.sign(i) * patches.sign(j);
        links.push_back({std::min(a, b), std::max(a, b), sign * sureness * sureness});
    }
    return summed(std::move(links));
}

} // namespace

Patches patches_of(const CloudSurface& surface) {
    const SurePairs pairs(surface);
    constexpr float sure = 0.85F, likely = 0.6F;
    constexpr std::uint32_t crumb = 8;
    const auto most = static_cast<std::uint32_t>(std::max<std::size_t>(32, surface.size() / 3000));
    Pieces pieces(surface.size());
    const std::vector<SurePairs::Pair>& all = pairs.all();
    for (std::size_t k = 0; k < all.size(); ++k) {
        const float sureness = pairs.sureness(k);
        if (sureness < likely)
            break;
        const auto& [i, j] = all[k];
        const Pieces::Member one = pieces.find(i), other = pieces.find(j);
        if (one.piece == other.piece)
            continue;
        const bool small = sureness >= sure ? pieces.size(one) + pieces.size(other) <= most
                                            : std::min(pieces.size(one), pieces.size(other)) <= crumb;
        if (small)
            pieces.join(one, other, surface.normals[i].dot(surface.normals[j]) < 0);
    }
    Patches patches{std::vector<std::uint32_t>(surface.size()), std::vector<char>(surface.size()), 0, {}};
    constexpr auto nobody = static_cast<std::uint32_t>(-1);
    std::vector<std::uint32_t> number(surface.size(), nobody);
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto [piece, turned] = pieces.find(static_cast<std::uint32_t>(i));
        if (number[piece] == nobody)
            number[piece] = patches.count++;
        patches.patch[i] = number[piece];
        patches.turned[i] = turned;
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
