// Fits a parabola to the logarithm of depth in each of many patches, and compares its bend with that of planes.
#include "projection/sensor/depth_kind.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Core>
#include <numeric>
#include <optional>
#include <vector>

namespace scanshade {
namespace {

using Eigen::Vector3d;

constexpr int side = 9; ///< samples along a patch
using Patch = Eigen::Matrix<float, side, side>;

/// Of the logarithm of values over a patch of -1 .. 1 both ways: its slopes, the factors of x^2, x y and y^2, and the
/// deviation of the samples from that parabola.
struct Shape {
    double along_x = 0, along_y = 0;
    Vector3d bend = Vector3d::Zero();
    double deviation = 0;
};

/// The samples lie on a regular grid, where the terms of a parabola are orthogonal.
struct Basis {
    Patch x, y, xx, xy, yy;

    Basis() {
        for (int i = 0; i < side; ++i)
            for (int j = 0; j < side; ++j) {
                x(i, j) = 2.0F * static_cast<float>(j) / (side - 1) - 1;
                y(i, j) = 2.0F * static_cast<float>(i) / (side - 1) - 1;
            }
        const float mean = x.array().square().mean();
        xx = x.array().square() - mean;
        yy = y.array().square() - mean;
        xy = x.array() * y.array();
    }
};

const Basis& basis() {
    static const Basis made;
    return made;
}

float factor(const Patch& values, const Patch& term) { return values.cwiseProduct(term).sum() / term.squaredNorm(); }

Shape shape_of(const Patch& logarithms) {
    const Basis& terms = basis();
    const float x = factor(logarithms, terms.x), y = factor(logarithms, terms.y), xx = factor(logarithms, terms.xx),
                xy = factor(logarithms, terms.xy), yy = factor(logarithms, terms.yy);
    const Patch rest = (logarithms.array() - logarithms.mean()).matrix() - x * terms.x - y * terms.y - xx * terms.xx -
                       xy * terms.xy - yy * terms.yy;
    return {x, y, {xx, xy, yy}, std::sqrt(rest.squaredNorm() / (side * side - 6))};
}

/// Of log z on a plane with these slopes, since there z = 1 / (1 - a x - b y).
Vector3d bend_of_plane(double a, double b) { return {a * a / 2, a * b, b * b / 2}; }

/// Of the logarithm of range / z, log(1 + x^2 + y^2) / 2, by its derivatives at the middle of the patch.
Shape range_by_z(const Pinhole& camera, double u, double v, double half_px) {
    const Vector3d ray = camera.ray(u, v);
    const double square = ray.squaredNorm(), x = ray.x() / square, y = ray.y() / square;
    const double wide = half_px / camera.fx, high = half_px / camera.fy;
    return {wide * x,
            high * y,
            {wide * wide * (0.5 / square - x * x), -2 * wide * high * x * y, high * high * (0.5 / square - y * y)},
            0};
}

/// An inverse depth that is linear in the pixel, as a plane's: at the middle of a patch, and per pixel.
struct Inverse {
    double u = 0, v = 0, half_px = 0, middle = 0, by_u = 0, by_v = 0;

    [[nodiscard]] double at(double other_u, double other_v) const {
        return middle + by_u * (other_u - u) + by_v * (other_v - v);
    }
    /// Whether the planes through both patches are one, though the patches lie apart: curved surfaces have none such.
    [[nodiscard]] bool goes_on_in(const Inverse& other) const {
        constexpr double nearest = 1.45, farthest = 4, alike = 0.002; // half patches; of inverse depth
        const double apart_px = std::max(std::abs(other.u - u), std::abs(other.v - v));
        return apart_px >= nearest * half_px && apart_px <= farthest * half_px &&
               std::abs(at(other.u, other.v) - other.middle) < alike * other.middle &&
               std::abs(other.at(u, v) - middle) < alike * middle;
    }
    /// Of its plane, unit.
    [[nodiscard]] Vector3d normal(const Pinhole& camera) const {
        return Vector3d(by_u * camera.fx, by_v * camera.fy, at(camera.cx, camera.cy)).normalized();
    }
};

/// Patches for z and against it, weighted by how many standard deviations the bends of both kinds are apart.
class Votes {
  public:
    /// `measured` and its deviations, and what it would be if the image held z, or the other kind. `inverse`: by the
    /// other kind.
    template <class Of>
    void count(const Vector3d& measured, const Vector3d& sigma, const Vector3d& of_z, const Vector3d& of_other,
               const Of& inverse) {
        constexpr double least_apart = 2, most_apart = 10, largest_off = 3;
        const Vector3d apart = (of_z - of_other).cwiseQuotient(sigma),
                       from = (measured - of_other).cwiseQuotient(sigma);
        const double distance = apart.norm();
        if (distance < least_apart)
            return;
        const double share = from.dot(apart) / apart.squaredNorm(); // 0 if the other kind, 1 if z
        if ((from - share * apart).norm() > std::max(largest_off, distance / 2) || std::abs(share - 0.5) > 1)
            return; // neither: a surface that bends
        ++patches_;
        const double weight = std::min(distance, most_apart) * std::min(distance, most_apart);
        if (share > 0.5) {
            z_ += weight;
            return;
        }
        other_ += weight;
        against_.push_back({inverse(), weight});
    }
    [[nodiscard]] bool for_z() const { return decided() && z_ > most_ * (z_ + other_); }

    /// Most speaks against z, and most of that lies on planes that go on elsewhere. To second order a ball in front of
    /// the camera looks like the distances of a wall.
    [[nodiscard]] bool against_z() const {
        constexpr double enough = 0.5;
        if (!decided() || other_ <= most_ * (z_ + other_))
            return false;
        return enough * other_ < weight_where([&](const Against& one) {
                   return std::any_of(against_.begin(), against_.end(),
                                      [&](const Against& another) { return one.inverse.goes_on_in(another.inverse); });
               });
    }
    /// Most of what speaks against z has one slope: a ramp of numbers that somebody drew looks like that, and like the
    /// disparities of a single plane.
    [[nodiscard]] bool of_one_slope() const {
        constexpr double alike = 0.2, nearly_all = 0.85;
        const auto slope = [](const Against& one) { // on whichever side of an edge or a ridge
            return Eigen::Vector2d(std::abs(one.inverse.by_u), std::abs(one.inverse.by_v));
        };
        return std::any_of(against_.begin(), against_.end(), [&](const Against& one) {
            return nearly_all * other_ < weight_where([&](const Against& another) {
                       return (slope(another) - slope(one)).norm() < alike * slope(one).norm();
                   });
        });
    }
    /// A part of what speaks against z lies on planes that are turned to most of the others.
    [[nodiscard]] bool of_several_planes(const Pinhole& camera) const {
        constexpr double alike = 0.9945, turned = 0.951; // cosines of 6 and 18 degrees
        constexpr double enough = 0.05;
        double most = 0;
        Vector3d usual = Vector3d::UnitZ();
        for (const Against& one : against_) {
            const Vector3d normal = one.inverse.normal(camera);
            const double weight = weight_where(
                [&](const Against& another) { return another.inverse.normal(camera).dot(normal) > alike; });
            if (weight > most) {
                most = weight;
                usual = normal;
            }
        }
        return enough * other_ <
               weight_where([&](const Against& one) { return one.inverse.normal(camera).dot(usual) < turned; });
    }

  private:
    struct Against {
        Inverse inverse;
        double weight;
    };
    static constexpr double most_ = 0.8;

    [[nodiscard]] bool decided() const {
        constexpr int fewest = 6;
        constexpr double least = 60;
        return patches_ >= fewest && z_ + other_ >= least;
    }
    template <class Holds>
    [[nodiscard]] double weight_where(const Holds& holds) const {
        return std::accumulate(against_.begin(), against_.end(), 0.0,
                               [&](double sum, const Against& one) { return holds(one) ? sum + one.weight : sum; });
    }

    int patches_ = 0;
    double z_ = 0, other_ = 0;
    std::vector<Against> against_;
};

/// The pixel of a patch's sample: the middle is at `at`.
int nearest(double at, double half_px, int sample) {
    return static_cast<int>(at + half_px * (2.0 * sample / (side - 1) - 1) + 0.5);
}

std::optional<Patch> logarithms_at(const cv::Mat1f& values, double u, double v, double half_px) {
    Patch patch;
    for (int i = 0; i < side; ++i) {
        const float* row = values[nearest(v, half_px, i)];
        for (int j = 0; j < side; ++j) {
            const float value = row[nearest(u, half_px, j)];
            if (!(value > 0))
                return std::nullopt;
            patch(i, j) = value;
        }
    }
    return Patch(patch.array().log());
}

/// Of the rays (x, y, 1) through a patch's samples.
Patch ray_lengths(const Pinhole& camera, double u, double v, double half_px) {
    Patch lengths;
    for (int i = 0; i < side; ++i)
        for (int j = 0; j < side; ++j)
            lengths(i, j) = static_cast<float>(camera.ray(nearest(u, half_px, j), nearest(v, half_px, i)).norm());
    return lengths;
}

} // namespace

DepthKind depth_kind(const DepthImage& depth) {
    constexpr std::array patches_across{5.0, 8.0}; // large ones bend more, small ones are even more often
    constexpr double next = 0.75;                  // of half a patch
    constexpr double largest_deviation = 0.02;     // of depth: an edge, or noise
    constexpr double least_deviation = 3e-4;       // planes are not that even, and files have steps
    const Pinhole& camera = depth.camera;
    const double xx_norm = basis().xx.norm(), xy_norm = basis().xy.norm();
    Votes inverse, range;
    for (const double across : patches_across) {
        const double half = depth.z_m.cols / (2 * across);
        for (double v = half; v + half < depth.z_m.rows - 1; v += next * half)
            for (double u = half; u + half < depth.z_m.cols - 1; u += next * half) {
                const auto values = logarithms_at(depth.z_m, u, v, half);
                if (!values)
                    continue;
                const Shape shape = shape_of(*values);
                if (shape.deviation > largest_deviation)
                    continue;
                const double sigma_xx = std::max(shape.deviation / xx_norm, least_deviation),
                             sigma_xy = std::max(shape.deviation / xy_norm, least_deviation);
                const Vector3d sigma(sigma_xx, sigma_xy, sigma_xx);
                const Vector3d of_z = bend_of_plane(shape.along_x, shape.along_y);
                const auto of_patch = [&] { return Patch(values->array().exp()); };
                const auto linear = [&](const Patch& w) {
                    return Inverse{
                        u, v, half, double{w.mean()}, factor(w, basis().x) / half, factor(w, basis().y) / half};
                };
                inverse.count(shape.bend, sigma, of_z, -of_z, [&] { return linear(of_patch()); });
                const Shape ratio = range_by_z(camera, u, v, half);
                range.count(shape.bend, sigma, of_z,
                            ratio.bend + bend_of_plane(shape.along_x - ratio.along_x, shape.along_y - ratio.along_y),
                            [&] { return linear(ray_lengths(camera, u, v, half).cwiseQuotient(of_patch())); });
            }
    }
    if (inverse.against_z() && !inverse.of_one_slope())
        return DepthKind::inverse;
    if (range.against_z() && range.of_several_planes(camera))
        return DepthKind::range;
    return inverse.for_z() || range.for_z() ? DepthKind::z : DepthKind::unknown;
}

} // namespace scanshade
