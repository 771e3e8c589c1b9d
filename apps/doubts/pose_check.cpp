#include "apps/doubts/pose_check.h"

#include "projection/base/error.h"
#include "projection/base/spread.h"
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

/// What a pair of frames tells of all.
struct Told {
    std::optional<double> factor;
    std::optional<PoseReading> reading;
};

Told told_by(const Capture& capture, const std::function<Frame(std::size_t)>& load, std::size_t a, std::size_t b) {
    const auto posed = [&](std::size_t index) {
        return PosedDepth{project(load ? load(index) : capture.load(index, false)),
                          *capture.entries[index].world_from_camera};
    };
    try {
        const PosedDepth one = posed(a), other = posed(b);
        return {depth_factor_by_poses(one, other), pose_reading(one, other)};
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // processing the frame reports the error
        return {};
    }
}

/// "2.3", "1000".
std::string two_digits(double value) {
    return value < 99.5 ? fmt::format("{:.2g}", value) : fmt::format("{:.0f}", value);
}

PoseCheck factor_check(const std::vector<double>& factors, bool arbitrary_unit) {
    constexpr double alike = 1.3, of_depths = 20;
    if (factors.empty())
        return {};
    const auto [low, high] = std::ranges::minmax(factors);
    const double factor = std::sqrt(low * high);
    if (low == 1 || high == 1 || high > alike * low)
        return {};
    const double power = std::abs(std::log10(factor));
    if (factors.size() < 2 && std::abs(power - std::round(power)) > std::log10(alike)) // one pair may be a bad pose
        return {};
    if (arbitrary_unit)
        return {fmt::format("depths fit the poses only if they are multiplied by {}: depth maps and poses are not of "
                            "the same reconstruction.",
                            two_digits(factor))};
    return {fmt::format("depths fit the poses only if they are multiplied by {}: the depth unit is wrong, or the "
                        "poses are not in metres.",
                        two_digits(factor)),
            power < std::log10(of_depths)};
}

/// Where all pairs that tell tell the same, and no fewer than `least`.
std::string reading_warning(const std::vector<PoseReading>& readings, std::size_t least) {
    if (readings.empty() || readings.size() < least ||
        std::ranges::any_of(readings, [&](PoseReading reading) { return reading != readings.front(); }))
        return {};
    const auto fits = [](const char* as) {
        return fmt::format("depths fit the poses only if these are read as {}. They are used as recorded: frames "
                           "together and clouds of the recording are wrong.",
                           as);
    };
    switch (readings.front()) {
    case PoseReading::recorded:
        return {};
    case PoseReading::inverse:
        return fits("camera from world, their inverse");
    case PoseReading::y_up:
        return fits("those of a camera with y up and z backward (OpenGL, Blender, ARKit)");
    case PoseReading::inverse_y_up:
        return fits("camera from world, of a camera with y up and z backward");
    case PoseReading::w_first:
        return fits("quaternions of the order w x y z");
    case PoseReading::contradicted:
        break;
    }
    return "depths contradict the poses: frames agree better if the camera is thought to stand still. The poses may be "
           "of another recording or clock, or in other axes, or the images hold no depths along z; frames together and "
           "clouds of the recording are wrong.";
}

} // namespace

PoseCheck check_poses(const Capture& capture, const std::vector<std::size_t>& frames,
                      const std::function<Frame(std::size_t)>& load) {
    constexpr std::size_t pairs = 3;
    std::vector<std::size_t> posed;
    for (const std::size_t i : frames)
        if (const CaptureEntry& entry = capture.entries[i];
            entry.world_from_camera && (load || !entry.depth.empty()) && entry.problem.empty())
            posed.push_back(i);
    const std::vector<std::size_t> chosen = spread(pairs, posed.size());
    std::vector<Told> found(chosen.size());
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), chosen.size(), [&](std::size_t i) {
            const std::size_t index = posed[chosen[i]];
            if (const auto partner = partner_of(capture, index, posed))
                found[i] = told_by(capture, load, index, *partner);
            // Wrong poses choose badly; the next frame sees the same all the same.
            if (const auto next = std::ranges::upper_bound(posed, index); !found[i].reading && next != posed.end())
                found[i].reading = told_by(capture, load, index, *next).reading;
        });
    });
    std::vector<double> factors;
    std::vector<PoseReading> readings;
    for (const Told& told : found) {
        if (told.factor)
            factors.push_back(*told.factor);
        if (told.reading)
            readings.push_back(*told.reading);
    }
    PoseCheck check = factor_check(factors, capture.unit.arbitrary());
    if (check.warning.empty())
        check.warning = reading_warning(readings, std::min<std::size_t>(2, chosen.size()));
    return check;
}

} // namespace scanshade
