// The hard cases: depth with holes, noise, steps and odd sizes, each with the expected visibility.
#pragma once

#include "projection/maps.h"
#include "projection/sensor/noise.h"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace scanshade::hard_cases {

/// The input of a case, and the expected visibility.
struct Case {
    std::string name;
    DepthImage depth;
    cv::Mat1f
        expected; ///< visibility; NaN where any value is right; empty: only NaN, range and repeatability are checked
    double radius_m = 0.5;
    DepthNoise noise = {}; ///< where there is any, depth is prepared as in `run`
};

/// Limits that every case of a family must keep. RMSE is the difference to the expected visibility.
struct Gate {
    std::optional<double> rmse = {}, least = {}, mean = {}; ///< least and mean: visibility itself, from below
};

struct Family {
    std::string name, what;
    Gate gate;
    std::function<std::vector<Case>()> cases;
    /// Instead of cases: the method's own result on the first of a pair is expected of the second, on the pixels that
    /// both have.
    std::function<std::vector<std::pair<Case, Case>>()> pairs = {};
};

[[nodiscard]] const std::vector<Family>& families();

} // namespace scanshade::hard_cases
