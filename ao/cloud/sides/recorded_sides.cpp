// Sides that are given: to a position, or recorded ones.
#include "ao/cloud/sides/pieces.h"
#include "ao/cloud/sides/sides.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <tbb/parallel_sort.h>
#include <tuple>

namespace scanshade {

using Eigen::Vector3f;

Sides sides_to(const CloudSurface& surface, const Vector3f& position) {
    Sides sides{std::vector<std::int8_t>(surface.size(), 1), std::vector<float>(surface.size(), 1.0F), {}};
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

namespace {

constexpr float smooth_from = 0.8F;
constexpr std::size_t at_once = 1 << 13;

/// Two neighbours whose planes are nearly parallel, and each lies in the other's.
struct SmoothPair {
    float smooth = 0; ///< 0 .. 1
    bool opposed = false;
};

/// Each face of a thin board lies behind the other: they are no pair.
SmoothPair smooth_pair(const CloudSurface& surface, std::size_t i, std::size_t j) {
    constexpr float behind = 0.02F; // of their distance: beyond rounding
    const Vector3f &a = surface.normals[i], &b = surface.normals[j];
    const Vector3f towards = (surface.tree[j] - surface.tree[i]).stableNormalized();
    const float before_a = towards.dot(a), before_b = -towards.dot(b), cosine = a.dot(b);
    if (cosine < 0 && before_a + before_b < -2 * behind)
        return {};
    return {std::abs(cosine) * (1 - std::max(std::abs(before_a), std::abs(before_b))), cosine < 0};
}

/// Calls `visit(j, smooth, opposed)` for the neighbours that make a smooth pair with a point.
template <class Visit>
void for_each_smooth(const CloudSurface& surface, std::size_t i, Visit&& visit) {
    if (surface.normals[i].isZero())
        return;
    for (const std::uint32_t j : surface.near[i])
        if (i != j)
            if (const auto [smooth, opposed] = smooth_pair(surface, i, j); smooth >= smooth_from)
                visit(j, smooth, opposed);
}

} // namespace

double contradiction(const CloudSurface& surface) {
    constexpr float flat = 0.9F; // leaves are no patches: of them half a per cent look smooth and opposed
    struct Sums {
        double opposed = 0, all = 0;
    };
    const Sums sums = tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, surface.size(), at_once), Sums(),
        [&](const auto& range, Sums sum) {
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                for_each_smooth(surface, i, [&](std::uint32_t j, float smooth, bool opposed) {
                    if (surface.flatness[i] < flat || surface.flatness[j] < flat)
                        return;
                    sum.all += static_cast<double>(smooth);
                    sum.opposed += opposed ? static_cast<double>(smooth) : 0;
                });
            return sum;
        },
        [](const Sums& a, const Sums& b) {
            return Sums{a.opposed + b.opposed, a.all + b.all};
        });
    return sums.all > 0 ? sums.opposed / sums.all : 0;
}

RepairedSides repaired_sides(const CloudSurface& surface) {
    struct Opposed {
        float smooth;
        std::uint32_t a, b;
    };
    Pieces pieces(surface.size());
    std::vector<Opposed> opposed;
    for (std::size_t i = 0; i < surface.size(); ++i)
        for_each_smooth(surface, i, [&](std::uint32_t j, float smooth, bool oppose) {
            const auto a = static_cast<std::uint32_t>(i);
            if (oppose)
                opposed.push_back({smooth, a, j});
            else if (const Pieces::Member one = pieces.find(a), other = pieces.find(j); one.piece != other.piece)
                pieces.join(one, other, false);
        });
    tbb::parallel_sort(opposed.begin(), opposed.end(), [](const Opposed& one, const Opposed& other) {
        return std::tuple(-one.smooth, one.a, one.b) < std::tuple(-other.smooth, other.a, other.b);
    });
    std::vector<char> joined(surface.size(), 0); // by piece: of parts that oppose each other
    for (const Opposed& pair : opposed)
        if (const Pieces::Member one = pieces.find(pair.a), other = pieces.find(pair.b); one.piece != other.piece) {
            pieces.join(one, other, true);
            joined[pieces.find(pair.a).piece] = 1;
        }
    std::vector<std::int32_t> votes(surface.size(), 0); // by piece: points as its first one, less the others
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto [piece, turned] = pieces.find(static_cast<std::uint32_t>(i));
        votes[piece] += turned ? -1 : 1;
    }
    RepairedSides repaired{.sign = std::vector<std::int8_t>(surface.size())};
    constexpr double least_majority = 0.1; // of a piece's points: fewer may be chance
    std::size_t undecided = 0, turned_over = 0, in_joined = 0;
    double minority = 0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const Pieces::Member member = pieces.find(static_cast<std::uint32_t>(i));
        const std::int32_t vote = votes[member.piece];
        const bool decided = std::abs(vote) >= least_majority * pieces.size(member);
        repaired.sign[i] = static_cast<std::int8_t>(!decided ? 0 : (vote < 0) == member.turned ? 1 : -1);
        undecided += !decided;
        turned_over += repaired.sign[i] < 0;
        if (joined[member.piece]) {
            ++in_joined;
            minority += 0.5 - 0.5 * std::abs(vote) / pieces.size(member);
        }
    }
    const auto all = static_cast<double>(std::max<std::size_t>(surface.size(), 1));
    repaired.undecided = static_cast<double>(undecided) / all;
    repaired.turned = static_cast<double>(turned_over) / all;
    repaired.minority = minority / static_cast<double>(std::max<std::size_t>(in_joined, 1));
    return repaired;
}

} // namespace scanshade
