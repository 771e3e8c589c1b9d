// The hard cases: what recorded depth has that rendered depth has not, each with the answer that should come out.
#pragma once

#include "projection/maps.h"
#include "projection/noise.h"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace scanshade::hard_cases {

/// What a case is looked at with, and what should come out.
struct Case {
    std::string name;
    DepthImage depth;
    cv::Mat1f expected; ///< visibility; NaN where nothing is expected in particular; empty: only sanity is asked for
    double radius_m = 0.5;
    DepthNoise noise = {}; ///< where there is any, depth goes through the preparation that `run` gives it
};

/// Limits that every case of a family has to keep. RMSE and worst are differences to what is expected.
struct Gate {
    std::optional<double> rmse = {}, least = {}, mean = {}; ///< least and mean: visibility itself, from below
};

struct Family {
    std::string name, what;
    Gate gate;
    std::function<std::vector<Case>()> cases;
    /// Instead of an expected answer: what the method itself says of this image, on the pixels that both know.
    std::function<std::vector<std::pair<Case, Case>>()> pairs = {};
};

[[nodiscard]] const std::vector<Family>& families();

} // namespace scanshade::hard_cases
