#include "apps/walk/pose_check.h"

#include "apps/walk/measured_noise.h"
#include "projection/pose_scale.h"
#include "projection/project.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <optional>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace scanshade {
namespace {

constexpr double best_motion_m = 0.3, least_motion_m = 0.03, largest_turn = 0.5; ///< turn in radians

/// The frame whose camera moved about as far as tells most, without turning away.
std::optional<std::size_t> partner_of(const Capture& capture, std::size_t index,
                                      const std::vector<std::size_t>& posed) {
    const Eigen::Isometry3d camera_from_world = capture.entries[index].world_from_camera->inverse();
    std::optional<std::size_t> best;
    double least = std::numeric_limits<double>::infinity();
    for (const std::size_t other : posed) {
        const Eigen::Isometry3d motion = camera_from_world * *capture.entries[other].world_from_camera;
        const double moved = motion.translation().norm();
        if (moved < least_motion_m || Eigen::AngleAxisd(motion.linear()).angle() > largest_turn)
            continue;
        if (const double off = std::abs(std::log(moved / best_motion_m)); off < least) {
            least = off;
            best = other;
        }
    }
    return best;
}

std::optional<double> factor_of(const Capture& capture, std::size_t a, std::size_t b) {
    const auto posed = [&](std::size_t index) {
        return PosedDepth{project(capture.load(index, false)), *capture.entries[index].world_from_camera};
    };
    try {
        return depth_factor_by_poses(posed(a), posed(b));
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // processing the frame reports the error
        return std::nullopt;
    }
}

} // namespace

std::string pose_warning(const Capture& capture, const std::vector<std::size_t>& frames) {
    constexpr std::size_t pairs = 3;
    constexpr double alike = 1.3;
    std::vector<std::size_t> posed;
    for (const std::size_t i : frames)
        if (const CaptureEntry& entry = capture.entries[i];
            entry.world_from_camera && !entry.depth.empty() && entry.problem.empty())
            posed.push_back(i);
    const std::vector<std::size_t> chosen = spread(pairs, posed.size());
    std::vector<std::optional<double>> found(chosen.size());
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), chosen.size(), [&](std::size_t i) {
            const std::size_t index = posed[chosen[i]];
            if (const auto partner = partner_of(capture, index, posed))
                found[i] = factor_of(capture, index, *partner);
        });
    });
    std::vector<double> factors;
    for (const auto& factor : found)
        if (factor)
            factors.push_back(*factor);
    if (factors.empty())
        return {};
    const auto [low, high] = std::ranges::minmax(factors);
    const double factor = std::sqrt(low * high);
    if (low == 1 || high == 1 || high > alike * low)
        return {};
    if (capture.unit.arbitrary())
        return fmt::format(
            "depths fit the poses only if they are multiplied by {:.2g}: depth maps and poses are not of "
            "the same reconstruction.",
            factor);
    return fmt::format("depths fit the poses only if they are multiplied by {:.2g}: the depth unit is wrong, or the "
                       "poses are not in metres.",
                       factor);
}

} // namespace scanshade
