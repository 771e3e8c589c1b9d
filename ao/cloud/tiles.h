// Cuts a cloud too large for the memory into tiles: points to compute, and all points within their reach.
#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

namespace scanshade {

/// Indices of points, ascending.
using Indices = std::vector<std::uint32_t>;

/// Halves `core` along its longest axis until a part and all points within `reach` of it (in the points' unit) are at
/// most `at_once` points. Calls `tile` with each part, and with the part and all points round it. A tile exceeds
/// `at_once` where halving does not help: nearly all points are within reach of all, or coincide. Together the parts
/// are `core`, which must be finite.
void cut_into_tiles(std::span<const Eigen::Vector3d> points, const Indices& core, double reach, std::size_t at_once,
                    const std::function<void(const Indices& half, const Indices& round)>& tile);

} // namespace scanshade
