#include "projection/undistort.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <Eigen/LU>
#include <limits>
#include <mutex>
#include <opencv2/core.hpp>
#include <vector>

namespace scanshade {
namespace {

constexpr double converged_at = 1e-10;

Eigen::Matrix2d jacobian(const Distortion& d, const Eigen::Vector2d& p) {
    const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
    const double upper = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3)), lower = 1 + r2 * (d.k4 + r2 * (d.k5 + r2 * d.k6));
    const double upper_slope = d.k1 + r2 * (2 * d.k2 + r2 * 3 * d.k3),
                 lower_slope = d.k4 + r2 * (2 * d.k5 + r2 * 3 * d.k6);
    const double radial = upper / lower;
    const double slope = 2 * (upper_slope - radial * lower_slope) / lower; // d radial / d (r2) by d (r2) / dx = 2x
    Eigen::Matrix2d j;
    j(0, 0) = radial + x * x * slope + 2 * d.p1 * y + 6 * d.p2 * x;
    j(1, 1) = radial + y * y * slope + 6 * d.p1 * y + 2 * d.p2 * x;
    j(0, 1) = j(1, 0) = x * y * slope + 2 * d.p1 * x + 2 * d.p2 * y;
    return j;
}

double value_at(const std::vector<double>& polynomial, double t) {
    double value = 0;
    for (auto c = polynomial.rbegin(); c != polynomial.rend(); ++c)
        value = value * t + *c;
    return value;
}

/// The rising roots of c0 + c1 t + c2 t^2 + ... between 0 and `end` at which it changes its sign: between neighbouring
/// roots of the derivative there is at most one.
std::vector<double> sign_changes(const std::vector<double>& polynomial, double end) {
    if (polynomial.size() < 2)
        return {};
    std::vector<double> derivative;
    for (std::size_t i = 1; i < polynomial.size(); ++i)
        derivative.push_back(static_cast<double>(i) * polynomial[i]);
    std::vector<double> borders = sign_changes(derivative, end), roots;
    borders.push_back(end);
    double low = 0;
    for (const double high : borders) {
        const bool positive = value_at(polynomial, low) > 0;
        if (positive != (value_at(polynomial, high) > 0)) {
            double a = low, b = high;
            for (double middle = a + (b - a) / 2; middle > a && middle < b; middle = a + (b - a) / 2)
                (positive == (value_at(polynomial, middle) > 0) ? a : b) = middle;
            roots.push_back(b);
        }
        low = high;
    }
    return roots;
}

/// The smallest positive root of 1 + c1 t + c2 t^2 + ..., infinity where there is none up to an angle of 89.9 degrees.
double first_root(const std::vector<double>& higher) {
    constexpr double farthest = 3e5; // squared tangent
    std::vector<double> polynomial{1};
    polynomial.insert(polynomial.end(), higher.begin(), higher.end());
    const std::vector<double> roots = sign_changes(polynomial, farthest);
    return roots.empty() ? std::numeric_limits<double>::infinity() : roots.front();
}

/// Of r (1 + k1 r^2 + ...) / (1 + k4 r^2 + ...) with t = r^2: where its derivative's numerator N D + 2 t (N' D - N D')
/// or its denominator D is 0 first.
double rational_fold_r2(const Distortion& d) {
    const std::array n{1.0, d.k1, d.k2, d.k3}, below{1.0, d.k4, d.k5, d.k6};
    std::vector<double> higher(6, 0.0); // of t^1 .. t^6
    for (std::size_t i = 0; i < n.size(); ++i)
        for (std::size_t j = 0; j < below.size(); ++j)
            if (i + j > 0)
                higher[i + j - 1] += n[i] * below[j] * (1 + 2 * static_cast<double>(i) - 2 * static_cast<double>(j));
    return std::min(first_root(higher), first_root({d.k4, d.k5, d.k6}));
}

/// The angle at which theta (1 + k1 theta^2 + ...) stops growing; just under 90 degrees at most, where a pinhole ends.
double fold_angle(const Distortion& d) {
    constexpr double widest = 1.55; // tangent 48
    return std::min(widest, std::sqrt(first_root({3 * d.k1, 5 * d.k2, 7 * d.k3, 9 * d.k4})));
}

double bent_angle(const Distortion& d, double theta) {
    const double t2 = theta * theta;
    return theta * (1 + t2 * (d.k1 + t2 * (d.k2 + t2 * (d.k3 + t2 * d.k4))));
}

/// Newton's method on the angle, kept in the bracket where the polynomial grows.
std::optional<Eigen::Vector2d> undistorted_fisheye(const Distortion& d, const Eigen::Vector2d& bent) {
    const double wanted = bent.norm();
    if (wanted < 1e-8)
        return bent;
    double low = 0, high = fold_angle(d), theta = std::min(wanted, high);
    if (wanted >= bent_angle(d, high))
        return std::nullopt;
    for (int i = 0; i < 100 && std::abs(bent_angle(d, theta) - wanted) > 1e-14; ++i) {
        const double miss = bent_angle(d, theta) - wanted, t2 = theta * theta;
        (miss > 0 ? high : low) = theta;
        const double slope = 1 + t2 * (3 * d.k1 + t2 * (5 * d.k2 + t2 * (7 * d.k3 + t2 * 9 * d.k4)));
        theta -= miss / slope;
        if (!(theta > low && theta < high))
            theta = (low + high) / 2;
    }
    return Eigen::Vector2d(bent * (std::tan(theta) / wanted));
}

/// Where the radial part alone would have come from: a start for Newton's method in two dimensions, which would leap
/// across the poles of a rational lens. Newton's method again, kept in the bracket where the lens grows.
Eigen::Vector2d radial_guess(const Distortion& d, const Eigen::Vector2d& bent, double limit_r2) {
    const double wanted = bent.norm();
    if (wanted < 1e-8)
        return bent;
    constexpr double widest = 50, close = 1e-6; // tangent
    double low = 0, high = std::min(widest, std::sqrt(limit_r2)), r = std::min(wanted, high / 2);
    for (int i = 0; i < 60 && high - low > close; ++i) {
        const double r2 = r * r, upper = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3)),
                     lower = 1 + r2 * (d.k4 + r2 * (d.k5 + r2 * d.k6)), radial = upper / lower;
        const double miss = r * radial - wanted;
        if (std::abs(miss) < close)
            break;
        (miss > 0 ? high : low) = r;
        const double upper_slope = d.k1 + r2 * (2 * d.k2 + r2 * 3 * d.k3),
                     lower_slope = d.k4 + r2 * (2 * d.k5 + r2 * 3 * d.k6);
        r -= miss / (radial + 2 * r2 * (upper_slope - radial * lower_slope) / lower);
        if (!(r > low && r < high))
            r = (low + high) / 2;
    }
    return bent * (r / wanted);
}

std::optional<Eigen::Vector2d> undistorted_within(const Distortion& distortion, const Eigen::Vector2d& bent,
                                                  double limit_r2) {
    if (distortion.model == LensModel::kannala_brandt)
        return undistorted_fisheye(distortion, bent);
    Eigen::Vector2d straight = distortion.rational() ? radial_guess(distortion, bent, limit_r2) : bent;
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

Eigen::Vector2d normalised(const Pinhole& camera, double u, double v) { return camera.ray(u, v).head<2>(); }

/// The pixel at normalised coordinates, if it is in the image.
std::optional<cv::Point> pixel_at(const Pinhole& camera, const Eigen::Vector2d& point) {
    const double u = std::round(camera.fx * point.x() + camera.cx), v = std::round(camera.fy * point.y() + camera.cy);
    if (!(u >= 0 && u < camera.size.width && v >= 0 && v < camera.size.height))
        return std::nullopt;
    return cv::Point(static_cast<int>(u), static_cast<int>(v));
}

/// The recorded camera, widened to show all these directions of recorded pixels. A side grows by half the image's
/// length at most: near 90 degrees a pinhole image has no end.
Pinhole widened(Pinhole camera, const cv::Mat2f& direction) {
    double left = 0, top = 0, right = camera.size.width - 1, bottom = camera.size.height - 1;
    for (const cv::Vec2f& ray : direction)
        if (!std::isnan(ray[0])) {
            const double u = camera.fx * ray[0] + camera.cx, v = camera.fy * ray[1] + camera.cy;
            left = std::min(left, u), right = std::max(right, u);
            top = std::min(top, v), bottom = std::max(bottom, v);
        }
    const auto pixels_beyond = [](double distance, int length) {
        return std::min(static_cast<int>(std::lround(std::min(distance, double(length)))), length / 2);
    };
    const int more_left = pixels_beyond(-left, camera.size.width), more_top = pixels_beyond(-top, camera.size.height);
    const int more_right = pixels_beyond(right - (camera.size.width - 1), camera.size.width),
              more_bottom = pixels_beyond(bottom - (camera.size.height - 1), camera.size.height);
    camera.cx += more_left;
    camera.cy += more_top;
    camera.size += cv::Size(more_left + more_right, more_top + more_bottom);
    return camera;
}

cv::Mat2f places_in_recorded(const Camera& recorded, const Pinhole& straight, double limit_r2) {
    constexpr float nowhere = std::numeric_limits<float>::quiet_NaN();
    const Pinhole& pinhole = recorded.pinhole;
    cv::Mat2f map(straight.size, cv::Vec2f(nowhere, nowhere));
    for (int v = 0; v < map.rows; ++v)
        for (int u = 0; u < map.cols; ++u) {
            const Eigen::Vector2d ray = normalised(straight, u, v);
            if (ray.squaredNorm() >= limit_r2)
                continue;
            const Eigen::Vector2d bent = distorted(recorded.distortion, ray);
            if (pixel_at(pinhole, bent))
                map(v, u) = {static_cast<float>(pinhole.fx * bent.x() + pinhole.cx),
                             static_cast<float>(pinhole.fy * bent.y() + pinhole.cy)};
        }
    return map;
}

/// Indices in an image of `size`.
cv::Mat1i nearest_pixels(const cv::Mat2f& places, cv::Size size) {
    cv::Mat1i map(places.size(), -1);
    std::transform(places.begin(), places.end(), map.begin(), [&](const cv::Vec2f& at) {
        if (std::isnan(at[0]))
            return -1;
        const int u = std::clamp(static_cast<int>(std::lround(at[0])), 0, size.width - 1);
        const int v = std::clamp(static_cast<int>(std::lround(at[1])), 0, size.height - 1);
        return v * size.width + u;
    });
    return map;
}

/// Rounding there and back may be off by one pixel: a neighbour that shows the same recorded pixel comes first.
int same_pixel_near(const cv::Mat1i& recorded_pixel, cv::Point nearest, int recorded) {
    for (int v = std::max(nearest.y - 1, 0); v <= std::min(nearest.y + 1, recorded_pixel.rows - 1); ++v)
        for (int u = std::max(nearest.x - 1, 0); u <= std::min(nearest.x + 1, recorded_pixel.cols - 1); ++u)
            if (recorded_pixel(v, u) == recorded)
                return v * recorded_pixel.cols + u;
    return nearest.y * recorded_pixel.cols + nearest.x;
}

cv::Mat2f directions(const Camera& camera, double limit_r2) {
    constexpr float nowhere = std::numeric_limits<float>::quiet_NaN();
    cv::Mat2f map(camera.pinhole.size, cv::Vec2f(nowhere, nowhere));
    for (int v = 0; v < map.rows; ++v)
        for (int u = 0; u < map.cols; ++u)
            if (const auto straight = undistorted_within(camera.distortion, normalised(camera.pinhole, u, v), limit_r2))
                map(v, u) = {static_cast<float>(straight->x()), static_cast<float>(straight->y())};
    return map;
}

cv::Mat1i map_to_undistorted(const Pinhole& straight, const cv::Mat2f& direction, const cv::Mat1i& recorded_pixel) {
    cv::Mat1i map(direction.size(), -1);
    for (int v = 0; v < map.rows; ++v)
        for (int u = 0; u < map.cols; ++u)
            if (const auto pixel = pixel_at(straight, {direction(v, u)[0], direction(v, u)[1]})) // none for NaN
                map(v, u) = same_pixel_near(recorded_pixel, *pixel, v * map.cols + u);
    return map;
}

using Key = std::array<double, 15>;

Key key_of(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    const Distortion& d = camera.distortion;
    return {fx,   fy,   cx,   cy,   double(size.width), double(size.height), d.k1, d.k2, d.p1, d.p2,
            d.k3, d.k4, d.k5, d.k6, double(d.model)};
}

} // namespace

double fold_r2(const Distortion& d) {
    if (d.model == LensModel::kannala_brandt)
        return std::pow(std::tan(fold_angle(d)), 2);
    return d.rational() ? rational_fold_r2(d) : first_root({3 * d.k1, 5 * d.k2, 7 * d.k3});
}

Eigen::Vector2d distorted(const Distortion& d, const Eigen::Vector2d& straight) {
    Eigen::Vector2d bent;
    if (d.model == LensModel::kannala_brandt)
        distort_fisheye(std::array{d.k1, d.k2, d.k3, d.k4}.data(), straight.x(), straight.y(), bent.x(), bent.y());
    else
        distort(std::array{d.k1, d.k2, d.p1, d.p2, d.k3, d.k4, d.k5, d.k6}.data(), straight.x(), straight.y(), bent.x(),
                bent.y());
    return bent;
}

std::optional<Eigen::Vector2d> undistorted(const Distortion& distortion, const Eigen::Vector2d& bent) {
    return undistorted_within(distortion, bent, fold_r2(distortion));
}

Undistortion::Undistortion(const Camera& camera) {
    const double limit_r2 = fold_r2(camera.distortion);
    direction_ = directions(camera, limit_r2);
    straight_camera_ = widened(camera.pinhole, direction_);
    recorded_at_ = places_in_recorded(camera, straight_camera_, limit_r2);
    recorded_pixel_ = nearest_pixels(recorded_at_, camera.pinhole.size);
    undistorted_pixel_ = map_to_undistorted(straight_camera_, direction_, recorded_pixel_);
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
