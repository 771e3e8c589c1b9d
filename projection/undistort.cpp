#include "projection/undistort.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <Eigen/LU>
#include <limits>
#include <mutex>

namespace scanshade {
namespace {

constexpr double converged_at = 1e-10;

Eigen::Matrix2d jacobian(const Distortion& d, const Eigen::Vector2d& p) {
    const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
    const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
    const double slope =
        2 * (d.k1 + r2 * (2 * d.k2 + r2 * 3 * d.k3)); // d radial / d (r2), times the 2 of d (r2) / dx = 2x
    Eigen::Matrix2d j;
    j(0, 0) = radial + x * x * slope + 2 * d.p1 * y + 6 * d.p2 * x;
    j(1, 1) = radial + y * y * slope + 6 * d.p1 * y + 2 * d.p2 * x;
    j(0, 1) = j(1, 0) = x * y * slope + 2 * d.p1 * x + 2 * d.p2 * y;
    return j;
}

/// Squared radius at which r (1 + k1 r2 + k2 r4 + k3 r6) stops growing: beyond it the lens model folds back on itself.
double fold_r2(const Distortion& d) {
    cv::Vec3d roots;
    const int count = cv::solveCubic(cv::Vec4d(7 * d.k3, 5 * d.k2, 3 * d.k1, 1), roots);
    double nearest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < count; ++i)
        if (roots[i] > 0)
            nearest = std::min(nearest, roots[i]);
    return nearest;
}

std::optional<Eigen::Vector2d> undistorted_within(const Distortion& distortion, const Eigen::Vector2d& bent,
                                                  double limit_r2) {
    Eigen::Vector2d straight = bent;
    for (int i = 0; i < 50; ++i) {
        const Eigen::Vector2d miss = distorted(distortion, straight) - bent;
        if (miss.squaredNorm() < converged_at * converged_at)
            return straight.squaredNorm() < limit_r2 ? std::optional(straight) : std::nullopt;
        Eigen::Vector2d step = jacobian(distortion, straight).partialPivLu().solve(miss);
        const double longest = 0.5; // keeps the first steps of strong lenses inside the fold
        if (step.norm() > longest)
            step *= longest / step.norm();
        straight -= step;
        if (!straight.allFinite())
            return std::nullopt;
    }
    return std::nullopt;
}

Eigen::Vector2d normalised(const Pinhole& camera, double u, double v) {
    return {(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy};
}

/// The pixel at normalised coordinates, if it is in the image.
std::optional<cv::Point> pixel_at(const Pinhole& camera, const Eigen::Vector2d& point) {
    const double u = std::round(camera.fx * point.x() + camera.cx), v = std::round(camera.fy * point.y() + camera.cy);
    if (!(u >= 0 && u < camera.size.width && v >= 0 && v < camera.size.height))
        return std::nullopt;
    return cv::Point(static_cast<int>(u), static_cast<int>(v));
}

cv::Mat1i map_to_recorded(const Camera& camera, double limit_r2) {
    const Pinhole& pinhole = camera.pinhole;
    cv::Mat1i map(pinhole.size, -1);
    for (int v = 0; v < map.rows; ++v)
        for (int u = 0; u < map.cols; ++u) {
            const Eigen::Vector2d straight = normalised(pinhole, u, v);
            if (straight.squaredNorm() >= limit_r2)
                continue;
            if (const auto pixel = pixel_at(pinhole, distorted(camera.distortion, straight)))
                map(v, u) = pixel->y * map.cols + pixel->x;
        }
    return map;
}

/// Rounding there and back may land a pixel aside: a neighbour that shows the very same recorded pixel comes first.
int same_pixel_near(const cv::Mat1i& recorded_pixel, cv::Point nearest, int recorded) {
    for (int v = std::max(nearest.y - 1, 0); v <= std::min(nearest.y + 1, recorded_pixel.rows - 1); ++v)
        for (int u = std::max(nearest.x - 1, 0); u <= std::min(nearest.x + 1, recorded_pixel.cols - 1); ++u)
            if (recorded_pixel(v, u) == recorded)
                return v * recorded_pixel.cols + u;
    return nearest.y * recorded_pixel.cols + nearest.x;
}

cv::Mat1i map_to_undistorted(const Camera& camera, double limit_r2, const cv::Mat1i& recorded_pixel) {
    const Pinhole& pinhole = camera.pinhole;
    cv::Mat1i map(pinhole.size, -1);
    for (int v = 0; v < map.rows; ++v)
        for (int u = 0; u < map.cols; ++u) {
            const auto straight = undistorted_within(camera.distortion, normalised(pinhole, u, v), limit_r2);
            if (!straight)
                continue;
            if (const auto pixel = pixel_at(pinhole, *straight))
                map(v, u) = same_pixel_near(recorded_pixel, *pixel, v * map.cols + u);
        }
    return map;
}

using Key = std::array<double, 11>;

Key key_of(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    const auto& [k1, k2, p1, p2, k3] = camera.distortion;
    return {fx, fy, cx, cy, double(size.width), double(size.height), k1, k2, p1, p2, k3};
}

} // namespace

Eigen::Vector2d distorted(const Distortion& distortion, const Eigen::Vector2d& straight) {
    const double coefficients[5] = {distortion.k1, distortion.k2, distortion.p1, distortion.p2, distortion.k3};
    Eigen::Vector2d bent;
    distort(coefficients, straight.x(), straight.y(), bent.x(), bent.y());
    return bent;
}

std::optional<Eigen::Vector2d> undistorted(const Distortion& distortion, const Eigen::Vector2d& bent) {
    return undistorted_within(distortion, bent, fold_r2(distortion));
}

Undistortion::Undistortion(const Camera& camera) {
    const double limit_r2 = fold_r2(camera.distortion);
    recorded_pixel_ = map_to_recorded(camera, limit_r2);
    undistorted_pixel_ = map_to_undistorted(camera, limit_r2, recorded_pixel_);
}

std::shared_ptr<const Undistortion> Undistortion::of(const Camera& camera) {
    static std::mutex mutex;
    static std::deque<std::pair<Key, std::shared_ptr<const Undistortion>>> recent;
    constexpr std::size_t kept = 4;
    const Key key = key_of(camera);
    const std::scoped_lock lock(mutex); // held while making: the threads that wait want the same maps
    for (const auto& [known, maps] : recent)
        if (known == key)
            return maps;
    recent.emplace_front(key, std::make_shared<const Undistortion>(camera));
    if (recent.size() > kept)
        recent.pop_back();
    return recent.front().second;
}

} // namespace scanshade
