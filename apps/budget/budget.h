// Chooses the configuration that keeps within an error or a time, from the measured Pareto front.
#pragma once

#include "apps/budget/front.h"
#include "apps/session/limits.h"

#include <string>
#include <vector>

namespace scanshade {

/// The index of the best point within the budget: the most accurate one within max_ms; without max_ms the cheapest one
/// within max_error. `ms` is each point's expected time. Throws Misuse, naming the fastest and the most accurate point,
/// where none is within.
[[nodiscard]] std::size_t pick(const std::vector<BenchmarkPoint>& points, const std::vector<double>& ms,
                               const Budget& budget);

/// The configuration picked for a capture, its expected time and error, and those measured on some of its frames.
struct Choice {
    Configuration configuration;
    double expected_ms = 0, expected_rms = 0;
    double measured_ms = 0;
    double measured_rms = 0;            ///< to truth, or to the most accurate configuration of the Pareto front
    std::vector<std::string> sentences; ///< the report for people
};

/// Times a few points of the Pareto front on the capture's frames. They show how this device and image size compare
/// with those of the front. Then picks a point and runs it on the frames. Where it is slower than allowed, or farther
/// from the capture's truth, the next point is tried. `radius_m` is the run's; truth of another radius is not used.
[[nodiscard]] Choice choose(gpu::Device& device, const ParetoFront& front, const TrialCapture& capture, double radius_m,
                            const Budget& budget);

} // namespace scanshade
