// "No more than this error", "no more than these milliseconds": the configuration that keeps to it, from the measured
// front.
#pragma once

#include "apps/measure/front.h"

#include <string>
#include <vector>

namespace scanshade {

/// 0 = no limit.
struct Budget {
    double max_error = 0; ///< RMSE to truth
    double max_ms = 0;    ///< per frame on the device, transfers left out
    [[nodiscard]] bool any() const { return max_error > 0 || max_ms > 0; }
};

/// The index of the point that keeps to the budget: the most accurate one within max_ms; without max_ms the cheapest
/// one within max_error. `ms` is what each point is expected to take. Throws Misuse, naming the nearest point, where
/// none does.
[[nodiscard]] std::size_t pick(const std::vector<Priced>& points, const std::vector<double>& ms, const Budget& budget);

/// What was picked for a capture, and what it turned out to be worth on some of its frames.
struct Choice {
    Configuration configuration;
    double expected_ms = 0, expected_rms = 0;
    double measured_ms = 0;
    double measured_rms = 0; ///< to truth, or to the most accurate configuration of the front
    std::vector<std::string> sentences; ///< what was done and found, for people
};

/// Times a few points of the front on the capture's frames, which tells how this device and image size compare with
/// those of the front, picks, then runs the pick on the frames: where it is slower than allowed, or farther from the
/// capture's truth, the next point is tried. `radius_m` is the run's; truth of another radius is not used.
[[nodiscard]] Choice choose(gpu::Device& device, const Front& front, const TrialCapture& capture, double radius_m,
                            const Budget& budget);

} // namespace scanshade
