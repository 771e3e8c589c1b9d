// Which side of each plane of a cloud is outside: neighbours that must agree, and what tells for either side.
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
/// For every point what tells for the side of its normal, and with a minus for the other.
using Evidence = std::vector<float>;

/// Points joined into pieces, each knowing whether its normal must be turned to agree with its piece.
class Pieces {
  public:
    explicit Pieces(Evidence evidence)
        : parent_(evidence.size()), turned_(evidence.size(), 0), size_(evidence.size(), 1),
          votes_(std::move(evidence)) {
        std::iota(parent_.begin(), parent_.end(), 0U);
    }

    struct Place {
        std::uint32_t piece;
        bool turned; ///< against the piece's first point
    };
    Place find(std::uint32_t point) {
        bool turned = false;
        std::uint32_t root = point;
        for (; parent_[root] != root; root = parent_[root])
            turned ^= turned_[root] != 0;
        for (bool rest = turned; parent_[point] != point;) { // all on the way now hang on the root
            const std::uint32_t next = parent_[point];
            const bool own = turned_[point] != 0;
            parent_[point] = root;
            turned_[point] = rest;
            rest ^= own;
            point = next;
        }
        return {root, turned};
    }

    /// The two agree when one of them is turned, or when both are or neither is. Not where that goes against clear
    /// evidence of both pieces: then what joins them is a mistake, as where two sheets touch.
    void join(std::uint32_t a, std::uint32_t b, bool opposed) {
        constexpr float clear = 2; // points without doubt
        Place one = find(a), other = find(b);
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
    Evidence votes_; ///< of a piece's points for the side of its first one; at that
};

/// Neighbours, those that most surely lie on one surface first: planes alike, and each in the other's, not above it.
/// Planes more than 75 degrees apart say nothing about each other's sides.
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
    for_each_pair([&](std::uint32_t, std::uint32_t, std::size_t place) { ++start[place + 1]; });
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<Pair> pairs(start.back());
    for_each_pair([&](std::uint32_t i, std::uint32_t j, std::size_t place) { pairs[start[place]++] = {i, j}; });
    return pairs;
}

Pieces joined(const CloudSurface& surface, const std::vector<Pair>& pairs, Evidence evidence) {
    Pieces pieces(std::move(evidence));
    for (const auto& [i, j] : pairs)
        pieces.join(i, j, surface.normals[i].dot(surface.normals[j]) < 0);
    return pieces;
}

/// Every piece takes the side that its points have more evidence for.
void turn(CloudSurface& surface, Pieces& pieces, const Evidence& evidence) {
    std::vector<double> votes(surface.size(), 0.0);
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto [piece, turned] = pieces.find(static_cast<std::uint32_t>(i));
        votes[piece] += static_cast<double>(turned ? -evidence[i] : evidence[i]);
    }
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto [piece, turned] = pieces.find(static_cast<std::uint32_t>(i));
        if ((votes[piece] < 0) != turned)
            surface.normals[i] = -surface.normals[i];
    }
}

/// Under the sky normals point there.
void turn_to(CloudSurface& surface, const std::vector<Pair>& pairs, const Vector3f& direction) {
    Evidence evidence(surface.size());
    std::transform(surface.normals.begin(), surface.normals.end(), evidence.begin(),
                   [&](const Vector3f& normal) { return normal.dot(direction); });
    Pieces pieces = joined(surface, pairs, Evidence(surface.size(), 0.0F));
    turn(surface, pieces, evidence);
}

/// Of objects those points tell that lie farthest out of their piece, in many directions.
void turn_outward(CloudSurface& surface, const std::vector<Pair>& pairs) {
    constexpr auto nobody = std::numeric_limits<std::uint32_t>::max();
    constexpr int looks = 64;
    Pieces pieces = joined(surface, pairs, Evidence(surface.size(), 0.0F));
    Evidence evidence(surface.size(), 0.0F);
    std::vector<std::uint32_t> piece(surface.size()), farthest(surface.size());
    for (std::size_t i = 0; i < surface.size(); ++i)
        piece[i] = pieces.find(static_cast<std::uint32_t>(i)).piece;
    for (const Vector3d& look : spread_directions(looks)) {
        const Vector3f direction = look.cast<float>();
        std::fill(farthest.begin(), farthest.end(), nobody);
        for (std::size_t i = 0; i < surface.size(); ++i)
            if (std::uint32_t& best = farthest[piece[i]];
                best == nobody || surface.tree[i].dot(direction) > surface.tree[best].dot(direction))
                best = static_cast<std::uint32_t>(i);
        for (const std::uint32_t best : farthest)
            if (best != nobody)
                evidence[best] += surface.normals[best].dot(direction);
    }
    turn(surface, pieces, evidence);
}

/// A room by the air in it, where the scanner stood: rays to both sides of some of the points tell how wide it is
/// there. The room's is wider than what furniture encloses; outside the room, where rays leave, nobody stood.
class Air {
  public:
    Air(const CloudSurface& surface, const DiscRays& rays)
        : surface_(surface), rays_(rays), fan_(RayBundle::size, 1),
          step_(std::max<std::size_t>(1, surface.size() / enough)) {
        Eigen::AlignedBox3f box;
        for (std::size_t i = 0; i < surface.size(); i += step_)
            box.extend(surface.tree[i]);
        wide_ = 0.05F * box.diagonal().norm();
    }

    /// How much more air there is before a point than behind it, -1 .. 1; 0 for points that were not asked. `fronts`:
    /// normals are right for the most part, so that a ray which meets something from behind was in no air at all.
    [[nodiscard]] Evidence evidence(bool fronts) const {
        Evidence found(surface_.size(), 0.0F);
        tbb::parallel_for(std::size_t(0), surface_.size() / step_, [&](std::size_t k) {
            const std::size_t i = k * step_;
            if (const Vector3f& normal = surface_.normals[i]; !normal.isZero())
                found[i] = (width(i, normal, fan_.run(k), fronts) - width(i, -normal, fan_.run(k), fronts)) / 2;
        });
        return found;
    }

  private:
    static constexpr std::size_t enough = 100000;

    [[nodiscard]] float width(std::size_t place, const Vector3f& side, const RayFan::Run& run, bool fronts) const {
        const DiscRays::Looks looks = rays_.look(place, side, run);
        float sum = 0;
        for (std::size_t ray = 0; ray < RayBundle::size; ++ray)
            if (const float distance = looks.distance[ray]; std::isfinite(distance))
                sum += (fronts && looks.facing[ray] < 0 ? -1.0F : 1.0F) * distance / (distance + wide_);
        return sum / RayBundle::size;
    }

    const CloudSurface& surface_;
    const DiscRays& rays_;
    RayFan fan_;
    std::size_t step_; ///< every so manieth point is asked
    float wide_;       ///< a twentieth of the cloud: air of this width counts half
};

/// First by widths alone, then knowing most surfaces' fronts.
void turn_inward(CloudSurface& surface, const std::vector<Pair>& pairs, const DiscRays& rays) {
    const Air air(surface, rays);
    for (const bool fronts : {false, true}) {
        const Evidence evidence = air.evidence(fronts);
        Pieces pieces = joined(surface, pairs, evidence);
        turn(surface, pieces, evidence);
    }
}

/// Each point by itself.
void turn_to_viewpoint(CloudSurface& surface, const Vector3f& viewpoint) {
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

void turn_outside(CloudSurface& surface, const Outside& outside, const DiscRays* rays) {
    switch (outside.kind) {
    case Outside::Kind::viewpoint:
        turn_to_viewpoint(surface, (outside.point - surface.middle).cast<float>());
        return;
    case Outside::Kind::direction: {
        const Vector3f direction = outside.point.cast<float>().stableNormalized();
        turn_to(surface, pairs_of(surface), direction);
        std::replace_if(
            surface.normals.begin(), surface.normals.end(), [](const Vector3f& normal) { return normal.isZero(); },
            direction);
        return;
    }
    case Outside::Kind::outward:
        turn_outward(surface, pairs_of(surface));
        return;
    case Outside::Kind::inward:
        turn_inward(surface, pairs_of(surface), *rays);
        return;
    }
}

} // namespace scanshade
