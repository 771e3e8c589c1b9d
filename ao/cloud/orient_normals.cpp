// Normal orientation of a cloud: neighbours must agree, and points vote for one side of their plane.
#include "ao/cloud/cloud_surface.h"
#include "ao/cloud/disc_rays.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>
#include <limits>
#include <numeric>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;
using Pair = std::array<std::uint32_t, 2>;
/// For each point the vote for its normal (positive) or for the opposite direction (negative).
using Votes = std::vector<float>;

/// Points joined into pieces. Each point knows whether its normal must be flipped to agree with its piece.
class Pieces {
  public:
    explicit Pieces(Votes votes)
        : parent_(votes.size()), turned_(votes.size(), 0), size_(votes.size(), 1), votes_(std::move(votes)) {
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

    /// Joins the pieces of two points; `opposed`: their normals agree when one of them is flipped. Pieces whose clear
    /// votes contradict each other stay apart: there the neighbourhood is wrong, as where two sheets touch.
    void join(std::uint32_t a, std::uint32_t b, bool opposed) {
        constexpr float clear = 2; // points without doubt
        Member one = find(a), other = find(b);
        if (one.piece == other.piece)
            return;
        if (size_[one.piece] < size_[other.piece])
            std::swap(one, other);
        const bool turned = one.turned ^ other.turned ^ opposed;
        const float ours = votes_[one.piece], theirs = turned ? -votes_[other.piece] : votes_[other.piece];
        if (std::min(std::abs(ours), std::abs(theirs)) > clear && ours * theirs < 0)
            return;
        votes_[one.piece] += theirs;
        parent_[other.piece] = one.piece;
        turned_[other.piece] = turned;
        size_[one.piece] += size_[other.piece];
    }

  private:
    std::vector<std::uint32_t> parent_;
    std::vector<char> turned_;
    std::vector<std::uint32_t> size_;
    Votes votes_; ///< at a root: the sum of its piece's votes for the root's normal
};

/// Pairs of neighbours, the surest ones first: parallel planes, each point within the plane of the other. Planes more
/// than 75 degrees apart say nothing about each other's orientation.
std::vector<Pair> pairs_of(const CloudSurface& surface) {
    constexpr int classes = 128;
    constexpr float least = 0.26F; // the cosine of 75 degrees
    std::array<std::size_t, classes + 1> start{};
    const auto for_each_pair = [&](auto&& visit) {
        for (std::size_t i = 0; i < surface.size(); ++i)
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
    };
    for_each_pair([&](std::uint32_t, std::uint32_t, std::size_t rank) { ++start[rank + 1]; });
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<Pair> pairs(start.back());
    for_each_pair([&](std::uint32_t i, std::uint32_t j, std::size_t rank) { pairs[start[rank]++] = {i, j}; });
    return pairs;
}

Pieces joined(const CloudSurface& surface, const std::vector<Pair>& pairs, Votes votes) {
    Pieces pieces(std::move(votes));
    for (const auto& [i, j] : pairs)
        pieces.join(i, j, surface.normals[i].dot(surface.normals[j]) < 0);
    return pieces;
}

/// The votes of its points decide the orientation of each piece.
void orient_by_votes(CloudSurface& surface, Pieces& pieces, const Votes& votes) {
    std::vector<double> sums(surface.size(), 0.0);
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto [piece, turned] = pieces.find(static_cast<std::uint32_t>(i));
        sums[piece] += static_cast<double>(turned ? -votes[i] : votes[i]);
    }
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto [piece, turned] = pieces.find(static_cast<std::uint32_t>(i));
        if ((sums[piece] < 0) != turned)
            surface.normals[i] = -surface.normals[i];
    }
}

/// Terrain: normals point to the sky.
void orient_along(CloudSurface& surface, const std::vector<Pair>& pairs, const Vector3f& direction) {
    Votes votes(surface.size());
    std::transform(surface.normals.begin(), surface.normals.end(), votes.begin(),
                   [&](const Vector3f& normal) { return normal.dot(direction); });
    Pieces pieces = joined(surface, pairs, Votes(surface.size(), 0.0F));
    orient_by_votes(surface, pieces, votes);
}

/// Objects: in many directions the farthest point of each piece votes for a normal along that direction.
void orient_outward(CloudSurface& surface, const std::vector<Pair>& pairs) {
    constexpr auto nobody = std::numeric_limits<std::uint32_t>::max();
    constexpr int directions = 64;
    Pieces pieces = joined(surface, pairs, Votes(surface.size(), 0.0F));
    Votes votes(surface.size(), 0.0F);
    std::vector<std::uint32_t> piece(surface.size()), farthest(surface.size());
    for (std::size_t i = 0; i < surface.size(); ++i)
        piece[i] = pieces.find(static_cast<std::uint32_t>(i)).piece;
    for (const Vector3d& spread : spread_directions(directions)) {
        const Vector3f direction = spread.cast<float>();
        std::fill(farthest.begin(), farthest.end(), nobody);
        for (std::size_t i = 0; i < surface.size(); ++i)
            if (std::uint32_t& best = farthest[piece[i]];
                best == nobody || surface.tree[i].dot(direction) > surface.tree[best].dot(direction))
                best = static_cast<std::uint32_t>(i);
        for (const std::uint32_t best : farthest)
            if (best != nobody)
                votes[best] += surface.normals[best].dot(direction);
    }
    orient_by_votes(surface, pieces, votes);
}

/// The free space of a room, where the scanner stood. Rays from a sample of the points measure its width on both sides
/// of their planes. The room is wider than the inside of furniture. Rays that leave the cloud count as no width.
class FreeSpace {
  public:
    FreeSpace(const CloudSurface& surface, const DiscRays& rays)
        : surface_(surface), rays_(rays), directions_(RayBundle::size, 1),
          step_(std::max<std::size_t>(1, surface.size() / enough)) {
        Eigen::AlignedBox3f box;
        for (std::size_t i = 0; i < surface.size(); i += step_)
            box.extend(surface.tree[i]);
        wide_ = 0.05F * box.diagonal().norm();
    }

    /// How much wider the space is in front of a point than behind it, -1 .. 1; 0 for points outside the sample.
    /// `fronts`: most normals are right already, so a ray that hits a surface from behind was not in free space.
    [[nodiscard]] Votes votes(bool fronts) const {
        Votes found(surface_.size(), 0.0F);
        tbb::parallel_for(std::size_t(0), surface_.size() / step_, [&](std::size_t k) {
            const std::size_t i = k * step_;
            if (const Vector3f& normal = surface_.normals[i]; !normal.isZero())
                found[i] =
                    (width(i, normal, directions_.run(k), fronts) - width(i, -normal, directions_.run(k), fronts)) / 2;
        });
        return found;
    }

  private:
    static constexpr std::size_t enough = 100000; // points in the sample

    [[nodiscard]] float width(std::size_t place, const Vector3f& side, const DirectionSet::Run& run,
                              bool fronts) const {
        const DiscRays::Hits hits = rays_.first_hits(place, side, run);
        float sum = 0;
        for (std::size_t ray = 0; ray < RayBundle::size; ++ray)
            if (const float distance = hits.distance[ray]; std::isfinite(distance))
                sum += (fronts && hits.facing[ray] < 0 ? -1.0F : 1.0F) * distance / (distance + wide_);
        return sum / RayBundle::size;
    }

    const CloudSurface& surface_;
    const DiscRays& rays_;
    DirectionSet directions_;
    std::size_t step_; ///< the sample is every step_-th point
    float wide_;       ///< a twentieth of the cloud's diagonal: space of this width counts half
};

/// The first pass uses widths alone, the second also the fronts that the first one found.
void orient_inward(CloudSurface& surface, const std::vector<Pair>& pairs, const DiscRays& rays) {
    const FreeSpace space(surface, rays);
    for (const bool fronts : {false, true}) {
        const Votes votes = space.votes(fronts);
        Pieces pieces = joined(surface, pairs, votes);
        orient_by_votes(surface, pieces, votes);
    }
}

/// Each point by itself.
void orient_to_viewpoint(CloudSurface& surface, const Vector3f& viewpoint) {
    for (std::size_t i = 0; i < surface.size(); ++i) {
        Vector3f& normal = surface.normals[i];
        const Vector3f towards = (viewpoint - surface.tree[i]).stableNormalized();
        if (normal.isZero())
            normal = towards;
        else if (normal.dot(towards) < 0)
            normal = -normal;
    }
}

} // namespace

void orient_normals(CloudSurface& surface, const NormalOrientation& orientation, const DiscRays* rays) {
    switch (orientation.kind) {
    case NormalOrientation::Kind::viewpoint:
        orient_to_viewpoint(surface, (orientation.point - surface.middle).cast<float>());
        return;
    case NormalOrientation::Kind::direction: {
        const Vector3f direction = orientation.point.cast<float>().stableNormalized();
        orient_along(surface, pairs_of(surface), direction);
        std::replace_if(
            surface.normals.begin(), surface.normals.end(), [](const Vector3f& normal) { return normal.isZero(); },
            direction);
        return;
    }
    case NormalOrientation::Kind::outward:
        orient_outward(surface, pairs_of(surface));
        return;
    case NormalOrientation::Kind::inward:
        orient_inward(surface, pairs_of(surface), *rays);
        return;
    }
}

} // namespace scanshade
