#include "tests/bench/flat_surfaces.h"

#include "projection/base/hash.h"
#include "projection/undistort.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace scanshade {
namespace {

using Eigen::Vector3d;

constexpr int most_planes = 8, trials = 600;
constexpr double smallest_share = 0.04; ///< of the points
constexpr double cell_m = 0.05;         ///< of the maps on planes
constexpr int sampled = 24000;          ///< points that planes are looked for in

/// A pixel's point in the world, or in camera space where there are no poses.
struct PlanePoint {
    Vector3d point;
    double tolerance_m; ///< that it may lie off its plane
    int frame, v, u;
};

struct Plane {
    Vector3d normal;
    double offset; ///< normal . point = offset
    [[nodiscard]] double distance(const Vector3d& point) const { return normal.dot(point) - offset; }
};

std::vector<PlanePoint> points_of(const TrialFrame& frame, int number, bool posed) {
    const cv::Mat1f& z = frame.exact_z_m;
    const bool bent = !frame.frame.depth_m.empty() && frame.frame.camera.distortion.any();
    const cv::Mat2f direction = bent ? Undistortion::of(frame.frame.camera)->direction() : cv::Mat2f();
    std::vector<PlanePoint> seen;
    for (int v = 0; v < z.rows; ++v)
        for (int u = 0; u < z.cols; ++u) {
            const double depth = z(v, u);
            if (!(depth > 0))
                continue;
            Vector3d point = frame.depth.camera.point(u, v, depth);
            if (bent)
                point = {depth * direction(v, u)[0], depth * direction(v, u)[1], depth};
            if (!point.allFinite())
                continue;
            if (posed)
                point = *frame.frame.world_from_camera * point;
            seen.push_back({point, 0.01 * depth + 0.003 * depth * depth, number, v, u});
        }
    return seen;
}

Plane through(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const Vector3d normal = (b - a).cross(c - a).normalized();
    return {normal, normal.dot(a)};
}

/// Least squares through the points within their tolerance of `plane`.
Plane refined(const Plane& plane, std::span<const PlanePoint> points) {
    Vector3d sum = Vector3d::Zero();
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    double count = 0;
    for (const PlanePoint& seen : points)
        if (std::abs(plane.distance(seen.point)) <= seen.tolerance_m) {
            sum += seen.point;
            squares += seen.point * seen.point.transpose();
            ++count;
        }
    const Vector3d mean = sum / count;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(squares / count - mean * mean.transpose());
    const Vector3d normal = axes.eigenvectors().col(0);
    return {normal, normal.dot(mean)};
}

/// The plane that most of the points lie on; of three points drawn, the others are near the first.
std::optional<Plane> largest_plane(std::span<const PlanePoint> points, std::uint32_t seed) {
    if (points.size() < 100)
        return std::nullopt;
    std::optional<Plane> best;
    std::size_t most = 0;
    for (std::uint32_t trial = 0; trial < trials; ++trial) {
        const auto drawn = [&](std::uint32_t k) -> const Vector3d& {
            return points[hash(seed * trials + trial, k) % points.size()].point;
        };
        const Vector3d& first = drawn(0);
        std::array<const Vector3d*, 2> others{};
        for (std::uint32_t k = 1, found = 0; k < 60 && found < 2; ++k)
            if (const double apart = (drawn(k) - first).norm(); apart > 0.1 && apart < 1)
                others[found++] = &drawn(k);
        if (!others[1])
            continue;
        const Plane plane = through(first, *others[0], *others[1]);
        if (!plane.normal.allFinite())
            continue;
        const auto on_it = static_cast<std::size_t>(std::ranges::count_if(
            points, [&](const PlanePoint& seen) { return std::abs(plane.distance(seen.point)) <= seen.tolerance_m; }));
        if (on_it > most) {
            most = on_it;
            best = plane;
        }
    }
    for (int round = 0; best && round < 3; ++round)
        best = refined(*best, points);
    return best;
}

/// Cells of a plane: how many points lie on it, and how many stand before it.
class PlaneMap {
  public:
    PlaneMap(const Plane& plane, std::span<const PlanePoint> all, double radius_m, int side) : plane_(plane) {
        x_ = plane.normal.unitOrthogonal();
        y_ = plane.normal.cross(x_);
        Eigen::AlignedBox2d box;
        for (const PlanePoint& seen : all)
            if (std::abs(plane.distance(seen.point)) <= seen.tolerance_m)
                box.extend(flat(seen.point));
        low_ = box.min() - Eigen::Vector2d::Constant(radius_m + cell_m);
        const Eigen::Vector2d size = (box.max() - low_).array() + radius_m + 2 * cell_m;
        on_.create(static_cast<int>(size.y() / cell_m) + 1, static_cast<int>(size.x() / cell_m) + 1);
        on_ = 0;
        cv::Mat1i before(on_.size(), 0);
        for (const PlanePoint& seen : all) {
            const double off = side * plane.distance(seen.point);
            const cv::Point at = cell(seen.point);
            if (off < -seen.tolerance_m || off > radius_m || at.x < 0 || at.y < 0 || at.x >= on_.cols ||
                at.y >= on_.rows)
                continue;
            ++(off > seen.tolerance_m ? before : on_)(at);
        }
        cv::Mat1b free(on_.size());
        constexpr int fewest = 3, tail = 30; // of noise, a thirtieth may lie outside
        for (int y = 0; y < free.rows; ++y)
            for (int x = 0; x < free.cols; ++x)
                free(y, x) = before(y, x) < std::max(fewest, on_(y, x) / tail + 1) ? 255 : 0;
        cv::distanceTransform(free, clearance_, cv::DIST_L2, cv::DIST_MASK_PRECISE);
        clearance_ *= cell_m;
    }
    [[nodiscard]] double clearance_m(const Vector3d& point) const {
        return static_cast<double>(clearance_(cell(point)));
    }

  private:
    [[nodiscard]] Eigen::Vector2d flat(const Vector3d& point) const { return {x_.dot(point), y_.dot(point)}; }
    [[nodiscard]] cv::Point cell(const Vector3d& point) const {
        const Eigen::Vector2d at = (flat(point) - low_) / cell_m;
        return {static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y()))};
    }

    Plane plane_;
    Vector3d x_, y_;
    Eigen::Vector2d low_;
    cv::Mat1i on_;
    cv::Mat1f clearance_;
};

/// Marks the pixels of frames that share a space. Returns the number of planes.
int mark(const std::vector<PlanePoint>& all, std::span<const Vector3d> eyes, double radius_m,
         std::span<cv::Mat1b> marks) {
    std::vector<PlanePoint> left;
    const double share =
        std::min(1.0, static_cast<double>(sampled) / static_cast<double>(std::max<std::size_t>(1, all.size())));
    for (std::size_t i = 0; i < all.size(); ++i)
        if (hash(static_cast<std::uint32_t>(i)) < share * 0x1p32)
            left.push_back(all[i]);
    const double whole = static_cast<double>(left.size());
    int planes = 0;
    std::vector<char> taken(all.size(), 0);
    for (; planes < most_planes; ++planes) {
        const std::optional<Plane> plane = largest_plane(left, static_cast<std::uint32_t>(planes));
        const auto on_it = [&](const PlanePoint& seen) {
            return std::abs(plane->distance(seen.point)) <= seen.tolerance_m;
        };
        if (!plane || static_cast<double>(std::ranges::count_if(left, on_it)) < smallest_share * whole)
            break;
        std::erase_if(left, on_it);
        const std::array<PlaneMap, 2> maps{PlaneMap(*plane, all, radius_m, -1), PlaneMap(*plane, all, radius_m, 1)};
        for (std::size_t i = 0; i < all.size(); ++i)
            if (const PlanePoint& seen = all[i]; !taken[i] && on_it(seen)) {
                taken[i] = 1;
                const auto frame = static_cast<std::size_t>(seen.frame);
                const PlaneMap& map = maps[plane->distance(eyes[frame]) > 0];
                marks[frame](seen.v, seen.u) = map.clearance_m(seen.point) > radius_m ? 255 : 1;
            }
    }
    return planes;
}

} // namespace

FlatSurfaces flat_surfaces(std::span<const TrialFrame> frames, double radius_m) {
    FlatSurfaces found;
    const bool posed =
        std::ranges::all_of(frames, [](const TrialFrame& each) { return each.frame.world_from_camera.has_value(); });
    std::vector<PlanePoint> all;
    std::vector<Vector3d> eyes;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        found.of_planes.emplace_back(frames[i].exact_z_m.size(), 0);
        eyes.push_back(posed ? Vector3d(frames[i].frame.world_from_camera->translation()) : Vector3d::Zero());
    }
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const std::vector<PlanePoint> seen = points_of(frames[i], static_cast<int>(i), posed);
        if (posed)
            all.insert(all.end(), seen.begin(), seen.end());
        else
            found.planes += mark(seen, eyes, radius_m, found.of_planes);
    }
    if (posed)
        found.planes = mark(all, eyes, radius_m, found.of_planes);
    return found;
}

} // namespace scanshade
