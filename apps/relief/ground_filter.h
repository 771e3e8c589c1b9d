// Ground among unclassified points: the progressive morphological filter (Zhang et al. 2003, IEEE TGRS 41(4)).
#pragma once

#include <opencv2/core.hpp>

namespace scanshade::relief {

/// Lowest height of each cell, NaN = none -> the surface below which no building or tree of up to `window_m` across
/// reaches; points above it by more than tolerance_m() are not ground. Heights and cell in metres.
/// Cells that lie alone below their surroundings, as false returns do, have no height.
[[nodiscard]] cv::Mat1f opened_ground(const cv::Mat1f& lowest, double cell_m, double window_m);

/// Standard deviation of what the filter takes for ground and is not, metres: fitted (`developers_bench
/// relief-errors`).
[[nodiscard]] constexpr double filter_error_m() { return 0.05; }

/// How far below its surroundings a cell is alone, and a point is none of the ground, metres.
[[nodiscard]] constexpr double false_depth_m() { return 2.5; }

/// How far ground may lie above the opened surface, metres.
[[nodiscard]] constexpr double ground_tolerance_m() { return 0.3; }

} // namespace scanshade::relief
