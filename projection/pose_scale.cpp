#include "projection/pose_scale.h"

#include <algorithm>
#include <cmath>

namespace scanshade {
namespace {

constexpr int most_samples = 4000;
constexpr double least_overlap = 0.3;  ///< share of the samples that land on a depth
constexpr double truncated_at = 0.05;  ///< of the depth: a larger distance is to another surface
constexpr double agreeing = 0.35;      ///< mean truncated distance, in units of the truncation
constexpr double clearly_better = 0.5; ///< a cost is clearly lower if it is below this share of the other
constexpr double farthest = 20, factor_step = 1.1, about_one = 1.35;

/// Mean truncated distance between the surfaces, 0 .. 1; 1 without overlap.
double cost(const DepthImage& a, const DepthImage& b, const Eigen::Isometry3d& b_from_a) {
    const int stride = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(a.z_m.total()) / most_samples)));
    double samples = 0, landed = 0, sum = 0;
    for (int v = stride / 2; v < a.z_m.rows; v += stride)
        for (int u = stride / 2; u < a.z_m.cols; u += stride) {
            if (!(a.z_m(v, u) > 0))
                continue;
            ++samples;
            const Eigen::Vector3d point = b_from_a * a.camera.point(u, v, static_cast<double>(a.z_m(v, u)));
            if (!(point.z() > 0))
                continue;
            const Eigen::Vector2d pixel = b.camera.pixel(point);
            if (!(pixel.x() > -0.5 && pixel.y() > -0.5 && pixel.x() < b.z_m.cols - 0.5 && pixel.y() < b.z_m.rows - 0.5))
                continue;
            const auto there = static_cast<double>(
                b.z_m(static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x()))));
            if (!(there > 0))
                continue;
            ++landed;
            sum += std::min(1.0, std::abs(point.z() - there) / (truncated_at * there));
        }
    return landed > least_overlap * samples ? sum / landed : 1;
}

} // namespace

std::optional<double> depth_factor_by_poses(const PosedDepth& a, const PosedDepth& b) {
    const Eigen::Isometry3d b_from_a = b.world_from_camera.inverse() * a.world_from_camera;
    // Scaling both depths is the same as scaling the translation by the inverse.
    const auto cost_of = [&](double translation_share) {
        Eigen::Isometry3d shared = b_from_a;
        shared.translation() *= translation_share;
        return cost(a.depth, b.depth, shared);
    };
    const double recorded = cost_of(1), still = cost_of(0);
    double best = recorded, factor = 1;
    for (double tried = 1 / farthest; tried < farthest; tried *= factor_step)
        if (const double found = cost_of(1 / tried); found < best) {
            best = found;
            factor = tried;
        }
    // Where a camera that stands still explains as much, the motion tells nothing.
    if (best > agreeing || best > clearly_better * still)
        return std::nullopt;
    if (factor < about_one && factor > 1 / about_one)
        return 1;
    return best < clearly_better * recorded ? std::optional(factor) : std::nullopt;
}

} // namespace scanshade
