#include "projection/texels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace scanshade {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

constexpr int most_repeats = 16;
constexpr std::int64_t step = 256; // parts of a texel

/// In texels; whole images are taken off, so that the least coordinates are in the first one.
std::array<Vector2d, 3> placed(const TextureCorners& corners, int size) {
    const Eigen::Array2d first = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]).cast<double>().array().floor();
    std::array<Vector2d, 3> at;
    for (std::size_t i = 0; i < 3; ++i)
        at[i] = (corners[i].cast<double>().array() - first) * size;
    return at;
}

std::int64_t cross(const std::array<std::int64_t, 2>& a, const std::array<std::int64_t, 2>& b,
                   const std::array<std::int64_t, 2>& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

std::int64_t floor_of(std::int64_t a, std::int64_t b) { return a / b - (a % b != 0 && (a < 0) != (b < 0)); }

/// Calls visit(x, y) for every texel whose centre lies in the triangle.
template <class Visit>
void for_each_centre(const std::array<Vector2d, 3>& at, Visit&& visit) {
    std::array<std::array<std::int64_t, 2>, 3> p;
    for (std::size_t i = 0; i < 3; ++i)
        p[i] = {std::llround(at[i].x() * step), std::llround(at[i].y() * step)};
    const std::int64_t area = cross(p[0], p[1], p[2]);
    if (area == 0)
        return;
    if (area < 0)
        std::swap(p[1], p[2]);
    const auto [low, high] = std::minmax({p[0][1], p[1][1], p[2][1]});
    const std::int64_t half = step / 2;
    for (std::int64_t y = floor_of(low - half + step - 1, step), last = floor_of(high - half, step); y <= last; ++y) {
        std::int64_t from = std::numeric_limits<std::int64_t>::min(), to = std::numeric_limits<std::int64_t>::max();
        for (std::size_t i = 0; i < 3; ++i) {
            const auto &a = p[i], &b = p[(i + 1) % 3];
            const std::int64_t dx = b[0] - a[0], dy = b[1] - a[1];
            const bool top_left = dy < 0 || (dy == 0 && dx > 0);
            // slope * x + at_0 >= 0, or > 0 on an edge that belongs to the neighbour
            const std::int64_t slope = -dy * step,
                               at_0 = dx * (y * step + half - a[1]) - dy * (half - a[0]) - (top_left ? 0 : 1);
            if (slope > 0)
                from = std::max(from, -floor_of(at_0, slope));
            else if (slope < 0)
                to = std::min(to, floor_of(at_0, -slope));
            else if (at_0 < 0) { // the row is beyond a level edge
                from = 1, to = 0;
                break;
            }
        }
        for (std::int64_t x = from; x <= to; ++x)
            visit(static_cast<int>(x), static_cast<int>(y));
    }
}

/// Calls visit(x, y) for every texel that the triangle reaches into.
template <class Visit>
void for_each_touched(const std::array<Vector2d, 3>& at, Visit&& visit) {
    const auto [low, high] = std::minmax({at[0].y(), at[1].y(), at[2].y()});
    for (int y = static_cast<int>(low); y <= high; ++y) {
        double from = std::numeric_limits<double>::infinity(), to = -from;
        for (std::size_t i = 0; i < 3; ++i) { // what of each edge is between the row's borders
            const Vector2d &a = at[i], &b = at[(i + 1) % 3];
            const double dy = b.y() - a.y();
            const double t0 = dy == 0 ? 0 : (y - a.y()) / dy, t1 = dy == 0 ? 1 : (y + 1 - a.y()) / dy;
            const double begin = std::clamp(std::min(t0, t1), 0.0, 1.0), end = std::clamp(std::max(t0, t1), 0.0, 1.0);
            if (std::max(a.y(), b.y()) < y || std::min(a.y(), b.y()) > y + 1)
                continue;
            for (const double t : {begin, end}) {
                from = std::min(from, a.x() + t * (b.x() - a.x()));
                to = std::max(to, a.x() + t * (b.x() - a.x()));
            }
        }
        for (int x = static_cast<int>(std::max(from, 0.0)); x <= to; ++x)
            visit(x, y);
    }
}

/// Weights of the point of a triangle that is nearest to `p`, and its squared distance (Ericson, "Real-Time Collision
/// Detection", 5.1.5, by the edge that p is beyond).
std::pair<Vector3d, double> nearest_on(const std::array<Vector2d, 3>& at, const Vector2d& p) {
    const auto cross_of = [](const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); };
    const double area = cross_of(at[1] - at[0], at[2] - at[0]);
    if (area != 0) {
        const Vector3d inside(cross_of(at[1] - p, at[2] - p) / area, cross_of(at[2] - p, at[0] - p) / area,
                              cross_of(at[0] - p, at[1] - p) / area);
        if (inside.minCoeff() >= 0)
            return {inside, 0};
    }
    std::pair<Vector3d, double> best{Vector3d(1, 0, 0), std::numeric_limits<double>::infinity()};
    for (int i = 0; i < 3; ++i) {
        const int k = (i + 1) % 3;
        const Vector2d &a = at[static_cast<std::size_t>(i)], &b = at[static_cast<std::size_t>(k)];
        const double length = (b - a).squaredNorm();
        const double t = length > 0 ? std::clamp((p - a).dot(b - a) / length, 0.0, 1.0) : 0;
        const double distance = (a + t * (b - a) - p).squaredNorm();
        if (distance < best.second) {
            best = {Vector3d::Zero(), distance};
            best.first[i] = 1 - t;
            best.first[k] = t;
        }
    }
    return best;
}

/// The same for a texel's centre, in whichever repetition of the image it is nearest.
std::pair<Vector3d, double> nearest_in(const std::array<Vector2d, 3>& at, int x, int y, int size) {
    const Vector2d centre(x + 0.5, y + 0.5);
    const Vector2d high = at[0].cwiseMax(at[1]).cwiseMax(at[2]);
    std::pair<Vector3d, double> best = nearest_on(at, centre);
    if (best.second == 0 || (high.x() <= size && high.y() <= size))
        return best;
    for (int j = 0; j * size + y <= high.y() + 1; ++j)
        for (int i = 0; i * size + x <= high.x() + 1; ++i)
            if (const auto found = nearest_on(at, centre + Vector2d(i * size, j * size)); found.second < best.second)
                best = found;
    return best;
}

/// Texels that no centre gave to a triangle, while triangles compete for them: -3 - face.
constexpr std::int32_t touched(int face) { return -3 - face; }

void claim_centres(Texels& texels, std::span<const TextureCorners> corners, std::span<const int> faces) {
    const std::size_t most = 4 * texels.face.size();
    for (const int face : faces) {
        if (!has_place(corners[static_cast<std::size_t>(face)]) || texels.too_many)
            continue;
        for_each_centre(placed(corners[static_cast<std::size_t>(face)], texels.size), [&](int x, int y) {
            std::int32_t& shown = texels.face[texels.index(x, y)];
            if (shown == Texels::none) {
                shown = face;
                ++texels.covered;
                return;
            }
            texels.too_many = texels.claims.size() >= most;
            if (texels.too_many)
                return;
            if (shown != Texels::several) {
                texels.claims.push_back({x % texels.size, y % texels.size, shown});
                ++texels.shared;
            }
            texels.claims.push_back({x, y, face});
            shown = Texels::several;
        });
    }
    std::ranges::stable_sort(texels.claims, {},
                             [&](const Texels::Claim& claim) { return texels.index(claim.x, claim.y); });
}

} // namespace

bool has_place(const TextureCorners& corners) {
    const Eigen::Vector2f low = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]),
                          high = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]);
    constexpr float farthest = 1e6F; // beyond it single precision has no texels
    return std::ranges::all_of(corners, [](const Eigen::Vector2f& corner) { return corner.allFinite(); }) &&
           low.minCoeff() > -farthest && high.maxCoeff() < farthest && (high - low).maxCoeff() <= most_repeats;
}

Texels texels_of(std::span<const TextureCorners> corners, std::span<const int> faces, int size) {
    Texels texels;
    texels.size = size;
    texels.face.assign(static_cast<std::size_t>(size) * static_cast<std::size_t>(size), Texels::none);
    claim_centres(texels, corners, faces);
    for (const int face : faces) {
        const TextureCorners& places = corners[static_cast<std::size_t>(face)];
        if (!has_place(places) || !(area_in_texels(places, size) > 0) || texels.too_many)
            continue;
        const auto at = placed(places, size);
        for_each_touched(at, [&](int x, int y) {
            std::int32_t& shown = texels.face[texels.index(x, y)];
            if (shown >= 0 || shown == Texels::several)
                return;
            const int holder = touched(shown); // its own inverse
            if (shown != Texels::none &&
                nearest_in(placed(corners[static_cast<std::size_t>(holder)], size), x % size, y % size, size).second <=
                    nearest_on(at, {x + 0.5, y + 0.5}).second)
                return;
            shown = touched(face);
        });
    }
    for (std::int32_t& shown : texels.face)
        shown = shown < Texels::several ? touched(shown) : shown;
    return texels;
}

Vector3d weights_at(const TextureCorners& corners, int x, int y, int size) {
    constexpr double inset = 0.1, most = 0.25;
    const auto at = placed(corners, size);
    Vector3d weights =
        x < size && y < size ? nearest_in(at, x, y, size).first : nearest_on(at, {x + 0.5, y + 0.5}).first;
    const double area = 2 * area_in_texels(corners, size);
    for (int i = 0; i < 3; ++i) {
        const double edge =
            (at[static_cast<std::size_t>((i + 2) % 3)] - at[static_cast<std::size_t>((i + 1) % 3)]).norm();
        weights[i] = std::max(weights[i], area > 0 ? std::min(inset * edge / area, most) : most);
    }
    return weights / weights.sum();
}

double area_in_texels(const TextureCorners& corners, int size) {
    const Vector2d a = (corners[1] - corners[0]).cast<double>() * size,
                   b = (corners[2] - corners[0]).cast<double>() * size;
    return std::abs(a.x() * b.y() - a.y() * b.x()) / 2;
}

} // namespace scanshade
