// Fits parabolas to many patches of the image, and compares their bends with those of planes in either kind of number.
#include "projection/sensor/depth_buffer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Core>
#include <optional>
#include <vector>

namespace scanshade {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int cells = 9; ///< along a patch
using CellPatch = Eigen::Matrix<double, cells, cells>;

/// The terms of a parabola over a patch of -1 .. 1 both ways, which are orthogonal there.
struct CellTerms {
    CellPatch x, y, xx, xy, yy;

    CellTerms() {
        for (int i = 0; i < cells; ++i)
            for (int j = 0; j < cells; ++j) {
                x(i, j) = 2.0 * j / (cells - 1) - 1;
                y(i, j) = 2.0 * i / (cells - 1) - 1;
            }
        const double mean = x.array().square().mean();
        xx = x.array().square() - mean;
        yy = y.array().square() - mean;
        xy = x.array() * y.array();
    }
};

const CellTerms& cell_terms() {
    static const CellTerms made;
    return made;
}

/// Numbers relative to their mean, in cells of up to 3 x 3 of them that lie `step` pixels apart; nothing where one is a
/// hole.
std::optional<CellPatch> patch_at(const cv::Mat1f& values, int v0, int u0, int step) {
    const int within = std::min(step, 3);
    CellPatch patch;
    for (int i = 0; i < cells; ++i)
        for (int j = 0; j < cells; ++j) {
            double sum = 0;
            for (int k = 0; k < within; ++k)
                for (int l = 0; l < within; ++l) {
                    const float value = values(v0 + i * step + k, u0 + j * step + l);
                    if (!(value > 0))
                        return std::nullopt;
                    sum += double{value};
                }
            patch(i, j) = sum;
        }
    return CellPatch(patch / patch.mean() - CellPatch::Ones());
}

enum class Kind { none, z, buffer };

struct Told {
    Kind kind = Kind::none;
    Vector2d slopes; ///< over half the patch
};

/// A plane's bend is none in a buffer. Of z it is a^2, 2 a b, b^2 by the slopes a and b, since z = 1 / (1 - a x - b y).
Told told_by(const CellPatch& patch) {
    constexpr double largest_deviation = 3e-7, last_bit = 1e-8;      // relative; a cell holds several rounded numbers
    constexpr double least_apart = 8, largest_off = 3, alike = 0.15; // deviations; of what is apart
    const CellTerms& t = cell_terms();
    const auto along = [&](const CellPatch& term) { return patch.cwiseProduct(term).sum() / term.squaredNorm(); };
    const double a = along(t.x), b = along(t.y);
    const Vector3d bend(along(t.xx), along(t.xy), along(t.yy));
    const CellPatch rest = patch - a * t.x - b * t.y - bend.x() * t.xx - bend.y() * t.xy - bend.z() * t.yy;
    const double deviation = std::max(std::sqrt(rest.squaredNorm() / (cells * cells - 6)), last_bit);
    Told told{Kind::none, {a, b}};
    if (deviation > largest_deviation)
        return told;
    const Vector3d norms(t.xx.norm(), t.xy.norm(), t.yy.norm());
    const Vector3d of_z = Vector3d(a * a, 2 * a * b, b * b).cwiseProduct(norms) / deviation;
    const Vector3d measured = bend.cwiseProduct(norms) / deviation;
    const double apart = of_z.norm();
    if (apart < least_apart)
        return told;
    const double off = std::max(largest_off, alike * apart);
    if ((measured - of_z).norm() < off)
        told.kind = Kind::z;
    else if (measured.norm() < off)
        told.kind = Kind::buffer;
    return told;
}

/// Whether they are multiples of it. Integers that count up by one from pixel to pixel make even planes, too.
bool are_in_steps(const cv::Mat1f& values, double per_unit) {
    constexpr double nearly_all = 0.9, alike = 0.02;
    std::size_t multiples = 0, all = 0;
    for (int v = 0; v < values.rows; v += 3)
        for (int u = 0; u < values.cols; u += 3, ++all) {
            const double counted = double{values(v, u)} * per_unit;
            multiples += std::abs(counted - std::round(counted)) < alike;
        }
    return static_cast<double>(multiples) > nearly_all * static_cast<double>(all);
}

/// No number is larger than 1, and they are no integers: of 1/20 mm, or of 16 bits for all from 0 to 1.
bool may_be_buffer(const cv::Mat1f& values) {
    constexpr std::array steps{20000.0, 65535.0, 65536.0};
    return std::ranges::all_of(values, [](float value) { return !(value > 1); }) &&
           std::ranges::none_of(steps, [&](double per_unit) { return are_in_steps(values, per_unit); });
}

/// Whether nearly all slopes are alike but for their signs: a ramp of numbers that somebody drew, or a single plane.
bool are_of_one_slope(const std::vector<Vector2d>& slopes) {
    constexpr double alike = 0.2, nearly_all = 0.95;
    return std::ranges::any_of(slopes, [&](const Vector2d& one) {
        const auto like_it = std::ranges::count_if(slopes, [&](const Vector2d& other) {
            return (other.cwiseAbs() - one.cwiseAbs()).norm() < alike * one.norm();
        });
        return static_cast<double>(like_it) > nearly_all * static_cast<double>(slopes.size());
    });
}

/// As of z-buffers whose near plane is near.
bool are_next_to_one(const cv::Mat1f& values) {
    constexpr float near = 0.8F;
    constexpr double nearly_all = 0.99;
    const auto known = std::ranges::count_if(values, [](float value) { return value > 0; });
    const auto next_to_one = std::ranges::count_if(values, [](float value) { return value > near; });
    return static_cast<double>(next_to_one) > nearly_all * static_cast<double>(known);
}

} // namespace

bool is_depth_buffer(const DepthImage& depth) {
    constexpr std::array patches_across{5, 8, 12};
    constexpr double nearly_all = 0.8;
    constexpr std::size_t fewest = 6;
    const cv::Mat1f& values = depth.z_m;
    if (!may_be_buffer(values))
        return false;
    std::vector<Vector2d> slopes; // of the patches of a buffer, per pixel but for a factor
    std::size_t of_z = 0;
    for (const int across : patches_across) {
        const int step = std::max(1, values.cols / across / cells), whole = step * cells, next = std::max(1, whole / 2);
        for (int v = 0; v + whole <= values.rows; v += next)
            for (int u = 0; u + whole <= values.cols; u += next) {
                const std::optional<CellPatch> patch = patch_at(values, v, u, step);
                const Told told = patch ? told_by(*patch) : Told{};
                of_z += told.kind == Kind::z;
                if (told.kind == Kind::buffer)
                    slopes.emplace_back(told.slopes * values(v + whole / 2, u + whole / 2) / whole);
            }
    }
    return slopes.size() >= fewest &&
           static_cast<double>(slopes.size()) > nearly_all * static_cast<double>(slopes.size() + of_z) &&
           (are_next_to_one(values) || !are_of_one_slope(slopes));
}

} // namespace scanshade
