// Which side of a cloud's planes is outside: what the cloud tells of its scanner, and neighbours that must agree.
#include "ao/cloud/cloud_surface.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <numeric>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

constexpr std::size_t enough_to_judge = 200000;

template <class Visit>
void for_some(std::span<const Vector3d> points, Visit&& visit) {
    const std::size_t step = std::max<std::size_t>(1, points.size() / enough_to_judge);
    for (std::size_t i = 0; i < points.size(); i += step)
        if (points[i].allFinite())
            visit(points[i]);
}

/// How a cloud looks from a place.
struct LookFrom {
    double seen_first = 0;  ///< share of points with nothing clearly in front of them
    double off_centre = 0;  ///< distance of the middle from the place / the cloud's radius
    double range_ratio = 1; ///< far points' distance / near points' distance (95 % and 5 %)
};

/// One cell per two degrees or so: wide enough to hold several points of a sparse scan.
LookFrom look_from(const Vector3d& place, std::span<const Vector3d> points) {
    constexpr int columns = 180, rows = 90;
    std::vector<float> nearest(columns * rows, std::numeric_limits<float>::infinity());
    const auto cell = [](const Vector3d& p, double range) {
        const double turn = std::atan2(p.y(), p.x()) / (2 * std::numbers::pi) + 0.5;
        const double tilt = std::acos(std::clamp(p.z() / range, -1.0, 1.0)) / std::numbers::pi;
        return std::min(static_cast<int>(tilt * rows), rows - 1) * columns +
               std::min(static_cast<int>(turn * columns), columns - 1);
    };
    std::vector<float> ranges;
    Vector3d sum = Vector3d::Zero();
    for_some(points, [&](const Vector3d& at) {
        const Vector3d point = at - place;
        const double range = point.norm();
        if (!(range > 0))
            return;
        float& least = nearest[static_cast<std::size_t>(cell(point, range))];
        least = std::min(least, static_cast<float>(range));
        ranges.push_back(static_cast<float>(range));
        sum += point;
    });
    if (ranges.empty())
        return {};
    const Vector3d middle = sum / static_cast<double>(ranges.size());
    std::size_t first = 0, all = 0;
    double radius2 = 0;
    for_some(points, [&](const Vector3d& at) {
        const Vector3d point = at - place;
        const double range = point.norm();
        if (!(range > 0))
            return;
        // Within a cell a surface met at 60 degrees recedes by 6 %; beyond that it takes a second surface.
        first += range <= 1.25 * static_cast<double>(nearest[static_cast<std::size_t>(cell(point, range))]);
        ++all;
        radius2 += (point - middle).squaredNorm();
    });
    std::sort(ranges.begin(), ranges.end());
    const auto range_at = [&](double share) {
        return static_cast<double>(ranges[static_cast<std::size_t>(share * static_cast<double>(ranges.size() - 1))]);
    };
    const double radius = std::sqrt(radius2 / static_cast<double>(all));
    return {static_cast<double>(first) / static_cast<double>(all), radius > 0 ? middle.norm() / radius : 0,
            range_at(0.05) > 0 ? range_at(0.95) / range_at(0.05) : std::numeric_limits<double>::infinity()};
}

/// Share of the points that are seen from straight above, in cells of about four.
double seen_from_above(std::span<const Vector3d> points) {
    Eigen::AlignedBox3d box;
    std::size_t count = 0;
    for_some(points, [&](const Vector3d& point) {
        box.extend(point);
        ++count;
    });
    if (count == 0 || !(box.sizes().x() > 0) || !(box.sizes().y() > 0))
        return 0;
    const double side = std::sqrt(4 * box.sizes().x() * box.sizes().y() / static_cast<double>(count));
    const auto columns = static_cast<std::size_t>(box.sizes().x() / side) + 1;
    const auto rows = static_cast<std::size_t>(box.sizes().y() / side) + 1;
    if (columns * rows > 4 * enough_to_judge) // a cloud as thin as a wall
        return 0;
    std::vector<double> top(columns * rows, -std::numeric_limits<double>::infinity());
    const auto cell = [&](const Vector3d& p) {
        return static_cast<std::size_t>((p.y() - box.min().y()) / side) * columns +
               static_cast<std::size_t>((p.x() - box.min().x()) / side);
    };
    for_some(points, [&](const Vector3d& point) { top[cell(point)] = std::max(top[cell(point)], point.z()); });
    std::size_t seen = 0;
    for_some(points, [&](const Vector3d& point) { seen += point.z() > top[cell(point)] - 3 * side; });
    return static_cast<double>(seen) / static_cast<double>(count);
}

/// Directions spread evenly over the sphere (Fibonacci's spiral).
std::vector<Vector3d> spread_directions(int count) {
    std::vector<Vector3d> directions;
    for (int i = 0; i < count; ++i) {
        const double z = 1 - (2 * i + 1.0) / count, turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
        const double across = std::sqrt(1 - z * z);
        directions.emplace_back(across * std::cos(turn), across * std::sin(turn), z);
    }
    return directions;
}

/// Share of the points that lie behind others from wherever outside one looks.
double hidden_share(std::span<const Vector3d> all) {
    std::vector<Vector3d> points;
    Eigen::AlignedBox3d box;
    for_some(all, [&](const Vector3d& point) {
        points.push_back(point);
        box.extend(point);
    });
    const double radius = box.isEmpty() ? 0 : box.diagonal().norm() / 2;
    if (!(radius > 0))
        return 0;
    // Pixels that hold several points each, so that surfaces have no holes to look through.
    const int side = std::clamp(static_cast<int>(std::sqrt(static_cast<double>(points.size()) / 8)), 4, 128);
    std::vector<char> seen(points.size(), 0);
    std::vector<double> front(static_cast<std::size_t>(side * side));
    for (const Vector3d& direction : spread_directions(26)) {
        const Vector3d x = direction.unitOrthogonal(), y = direction.cross(x);
        const auto pixel = [&](const Vector3d& p) {
            const auto along = [&](const Vector3d& axis) {
                return std::clamp(static_cast<int>((p.dot(axis) / radius + 1) / 2 * side), 0, side - 1);
            };
            return static_cast<std::size_t>(along(y) * side + along(x));
        };
        std::fill(front.begin(), front.end(), -std::numeric_limits<double>::infinity());
        for (Vector3d& point : points)
            front[pixel(point - box.center())] =
                std::max(front[pixel(point - box.center())], (point - box.center()).dot(direction));
        const double same = 6 * radius / side; // three pixels: a surface seen at 70 degrees
        for (std::size_t i = 0; i < points.size(); ++i)
            seen[i] |= (points[i] - box.center()).dot(direction) > front[pixel(points[i] - box.center())] - same;
    }
    return static_cast<double>(std::count(seen.begin(), seen.end(), 0)) / static_cast<double>(points.size());
}

/// Points joined into pieces, each knowing whether its normal must be turned to agree with its piece.
class Pieces {
  public:
    explicit Pieces(std::size_t count) : parent_(count), turned_(count, 0), size_(count, 1) {
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

    /// The two agree when one of them is turned, or when both are or neither is.
    void join(std::uint32_t a, std::uint32_t b, bool opposed) {
        Place one = find(a), other = find(b);
        if (one.piece == other.piece)
            return;
        if (size_[one.piece] < size_[other.piece])
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

/// Joins neighbours, those with the most alike planes first; planes more than 75 degrees apart say nothing about each
/// other's sides.
Pieces joined_pieces(const CloudSurface& surface) {
    constexpr int classes = 128, least = 33; // 33 / 128: 75 degrees
    const auto likeness = [&](std::size_t i, std::uint32_t j) {
        return static_cast<int>(std::abs(surface.normals[i].dot(surface.normals[j])) * (classes - 1));
    };
    std::array<std::size_t, classes + 1> start{};
    const auto for_each_pair = [&](auto&& visit) {
        for (std::size_t i = 0; i < surface.size(); ++i)
            for (const std::uint32_t j : surface.near[i])
                if (const bool once =
                        i < j || std::find(surface.near[j].begin(), surface.near[j].end(), i) == surface.near[j].end();
                    once && i != j)
                    if (const int like = likeness(i, j); like >= least)
                        visit(static_cast<std::uint32_t>(i), j, static_cast<std::size_t>(classes - 1 - like));
    };
    for_each_pair([&](std::uint32_t, std::uint32_t, std::size_t place) { ++start[place + 1]; });
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<std::array<std::uint32_t, 2>> pairs(start.back());
    for_each_pair([&](std::uint32_t i, std::uint32_t j, std::size_t place) { pairs[start[place]++] = {i, j}; });
    Pieces pieces(surface.size());
    for (const auto& [i, j] : pairs)
        pieces.join(i, j, surface.normals[i].dot(surface.normals[j]) < 0);
    return pieces;
}

/// For every point how far it faces out of its piece, from the points that lie farthest in many directions; and by
/// piece in how many of these it reaches as far as the whole cloud.
struct Outward {
    static constexpr int looks = 64;
    std::vector<double> evidence;
    std::vector<int> reached;
};

Outward outward_evidence(const CloudSurface& surface, Pieces& pieces) {
    constexpr auto nobody = std::numeric_limits<std::uint32_t>::max();
    Outward found{std::vector<double>(surface.size(), 0.0), std::vector<int>(surface.size(), 0)};
    std::vector<std::uint32_t> piece(surface.size()), farthest(surface.size());
    for (std::size_t i = 0; i < surface.size(); ++i)
        piece[i] = pieces.find(static_cast<std::uint32_t>(i)).piece;
    for (const Vector3d& look : spread_directions(Outward::looks)) {
        const Vector3f direction = look.cast<float>();
        std::fill(farthest.begin(), farthest.end(), nobody);
        float low = std::numeric_limits<float>::infinity(), high = -low;
        for (std::size_t i = 0; i < surface.size(); ++i) {
            std::uint32_t& best = farthest[piece[i]];
            const float along = surface.tree[i].dot(direction);
            low = std::min(low, along), high = std::max(high, along);
            if (best == nobody || along > surface.tree[best].dot(direction))
                best = static_cast<std::uint32_t>(i);
        }
        for (std::size_t p = 0; p < farthest.size(); ++p)
            if (const std::uint32_t best = farthest[p]; best != nobody) {
                found.evidence[best] += static_cast<double>(surface.normals[best].dot(direction));
                found.reached[p] += surface.tree[best].dot(direction) > high - 0.05F * (high - low);
            }
    }
    return found;
}

/// In a room the walls, which reach to its ends on many sides, face in; what stands about in it faces out.
void turn_pieces(CloudSurface& surface, const Outside& outside) {
    Pieces pieces = joined_pieces(surface);
    const Vector3f up = outside.point.cast<float>();
    const bool by_up = outside.kind == Outside::Kind::direction;
    const Outward outward = by_up ? Outward{} : outward_evidence(surface, pieces);
    std::vector<double> votes(surface.size(), 0.0);
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto [piece, turned] = pieces.find(static_cast<std::uint32_t>(i));
        const double own = by_up ? static_cast<double>(surface.normals[i].dot(up)) : outward.evidence[i];
        const bool encloses = outside.kind == Outside::Kind::inward && 4 * outward.reached[piece] > Outward::looks;
        votes[piece] += turned != encloses ? -own : own;
    }
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto [piece, turned] = pieces.find(static_cast<std::uint32_t>(i));
        if ((votes[piece] < 0) != turned)
            surface.normals[i] = -surface.normals[i];
    }
}

} // namespace

Outside guessed_outside(std::span<const Vector3d> points, const std::optional<Vector3d>& recorded) {
    constexpr double nearly_all = 0.85, clearly_off = 0.5, many_ranges = 3;
    constexpr double too_far = 20; // in radii of the cloud: from there nothing is behind anything, and tells nothing
    if (recorded)
        if (const LookFrom look = look_from(*recorded, points);
            look.seen_first >= nearly_all && look.off_centre < too_far)
            return {Outside::Kind::viewpoint, *recorded,
                    fmt::format("the recorded viewpoint, from where {:.0f} % of the points are seen first",
                                100 * look.seen_first)};
    const LookFrom look = look_from(Vector3d::Zero(), points);
    if (look.seen_first >= nearly_all && look.off_centre < too_far &&
        (look.off_centre > clearly_off || look.range_ratio > many_ranges))
        return {Outside::Kind::viewpoint, Vector3d::Zero(),
                fmt::format("the origin of the coordinates, from where {:.0f} % of the points are seen first",
                            100 * look.seen_first)};
    if (const double above = seen_from_above(points); above >= nearly_all)
        return {Outside::Kind::direction, Vector3d::UnitZ(),
                fmt::format("up along z, as of terrain: {:.0f} % of the points have nothing above them", 100 * above)};
    if (const double hidden = hidden_share(points); hidden > 0.05)
        return {Outside::Kind::inward, Vector3d::Zero(),
                fmt::format("inward, as of a room: {:.0f} % of the points lie inside, hidden from all round",
                            100 * hidden)};
    return {Outside::Kind::outward, Vector3d::Zero(), "outward, as nothing tells where the scanner stood"};
}

void turn_outside(CloudSurface& surface, const Outside& outside) {
    const Vector3f viewpoint = (outside.point - surface.middle).cast<float>();
    const auto facing = [&](std::size_t i) -> Vector3f {
        const Vector3f towards = outside.kind == Outside::Kind::viewpoint ? Vector3f(viewpoint - surface.tree[i])
                                                                          : Vector3f(outside.point.cast<float>());
        return towards.stableNormalized();
    };
    if (outside.kind != Outside::Kind::viewpoint)
        turn_pieces(surface, outside);
    for (std::size_t i = 0; i < surface.size(); ++i) {
        Vector3f& normal = surface.normals[i];
        const bool looks_somewhere =
            outside.kind == Outside::Kind::viewpoint || outside.kind == Outside::Kind::direction;
        if (normal.isZero() && looks_somewhere)
            normal = facing(i);
        else if (outside.kind == Outside::Kind::viewpoint && normal.dot(facing(i)) < 0)
            normal = -normal;
    }
}

} // namespace scanshade
