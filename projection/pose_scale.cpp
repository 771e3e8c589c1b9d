#include "projection/pose_scale.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace scanshade {
namespace {

constexpr int most_samples = 4000;
constexpr double least_overlap = 0.3;  ///< share of the samples that land in the other image
constexpr double fewest_landed = 50;   ///< samples that land on a depth
constexpr double truncated_at = 0.05;  ///< of the depth: a larger distance is to another surface
constexpr double agreeing = 0.35;      ///< mean truncated distance, in units of the truncation
constexpr double clearly_better = 0.5; ///< a cost is clearly lower if it is below this share of the other
constexpr double farthest = 20, factor_step = 1.1, about_one = 1.35;

/// Mean truncated distance between the surfaces, 0 .. 1; none without overlap.
std::optional<double> overlap_cost(const DepthImage& a, const DepthImage& b, const Eigen::Isometry3d& b_from_a) {
    const int stride = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(a.z_m.total()) / most_samples)));
    double samples = 0, inside = 0, landed = 0, sum = 0;
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
            ++inside;
            const auto there = static_cast<double>(
                b.z_m(static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x()))));
            if (!(there > 0))
                continue;
            ++landed;
            sum += std::min(1.0, std::abs(point.z() - there) / (truncated_at * there));
        }
    return inside > least_overlap * samples && landed > fewest_landed ? std::optional(sum / landed) : std::nullopt;
}

/// The same; 1 without overlap.
double cost(const DepthImage& a, const DepthImage& b, const Eigen::Isometry3d& b_from_a) {
    return overlap_cost(a, b, b_from_a).value_or(1);
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
    const auto attempt = [&](double tried) {
        if (const double found = cost_of(1 / tried); found < best) {
            best = found;
            factor = tried;
        }
    };
    for (double tried = 1 / farthest; tried < farthest; tried *= factor_step)
        attempt(tried);
    for (const double units : {100.0, 1000.0}) { // centimetres and millimetres
        attempt(units);
        attempt(1 / units);
    }
    // Where a camera that stands still explains as much, the motion tells nothing.
    if (best > agreeing || best > clearly_better * still)
        return std::nullopt;
    if (factor < about_one && factor > 1 / about_one)
        return 1;
    return best < clearly_better * recorded ? std::optional(factor) : std::nullopt;
}

namespace {

using Eigen::Isometry3d;

Isometry3d world_from_camera(const Isometry3d& recorded, PoseReading reading) {
    const Isometry3d turned(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX())); // y and z the other way
    switch (reading) {
    case PoseReading::inverse:
        return recorded.inverse();
    case PoseReading::y_up:
        return recorded * turned;
    case PoseReading::inverse_y_up:
        return recorded.inverse() * turned;
    case PoseReading::w_first: { // what was taken for x, y, z, w
        const Eigen::Quaterniond taken(recorded.linear());
        return Eigen::Translation3d(recorded.translation()) *
               Eigen::Quaterniond(taken.x(), taken.y(), taken.z(), taken.w());
    }
    case PoseReading::recorded:
    case PoseReading::contradicted:
        break;
    }
    return recorded;
}

} // namespace

std::optional<PoseReading> pose_reading(const PosedDepth& a, const PosedDepth& b) {
    constexpr double better_still = 0.75; // right poses cost less than half of none
    const auto between = [&](PoseReading reading) {
        return overlap_cost(a.depth, b.depth,
                            world_from_camera(b.world_from_camera, reading).inverse() *
                                world_from_camera(a.world_from_camera, reading));
    };
    const auto cost_of = [&](PoseReading reading) { return between(reading).value_or(1); };
    const bool overlaps = between(PoseReading::recorded).has_value();
    const double recorded = cost_of(PoseReading::recorded), still = cost(a.depth, b.depth, Isometry3d::Identity());
    if (recorded <= agreeing)
        return recorded < clearly_better * still ? std::optional(PoseReading::recorded) : std::nullopt;
    PoseReading reading = PoseReading::recorded;
    double best = recorded;
    for (const PoseReading tried :
         {PoseReading::inverse, PoseReading::y_up, PoseReading::inverse_y_up, PoseReading::w_first})
        if (const double found = cost_of(tried); found < best) {
            best = found;
            reading = tried;
        }
    if (best <= agreeing && best < clearly_better * std::min(recorded, still))
        return reading;
    // Frames of which poses say that they see other things may well be of other things.
    return overlaps && still < better_still * recorded ? std::optional(PoseReading::contradicted) : std::nullopt;
}

} // namespace scanshade
