// A cloud too large for the memory, cut into tiles: points to be computed, each with all that lies within their reach.
#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

namespace scanshade {

/// Indices of points, ascending.
using Places = std::vector<std::uint32_t>;

/// Halves `core` along its longest side until one half and all that lies within `reach` of it (in the points' unit) are
/// at most `at_once` points, and calls `tile` with each half and those round it, itself among them. More than `at_once`
/// where halving helps no further: nearly all points within reach of all, or at one place. Together the halves are
/// `core`, which must be finite.
void cut_into_tiles(std::span<const Eigen::Vector3d> points, const Places& core, double reach, std::size_t at_once,
                    const std::function<void(const Places& half, const Places& round)>& tile);

} // namespace scanshade
