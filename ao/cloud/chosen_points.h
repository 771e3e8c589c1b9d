// Points of a cloud that are looked at: those with numbers, and parts that a hash chooses.
#pragma once

#include "ao/cloud/surface/shared_noise.h"

#include <cstdint>
#include <Eigen/Core>
#include <span>
#include <vector>

namespace scanshade {

/// Indices of points, ascending.
using Indices = std::vector<std::uint32_t>;

constexpr std::size_t enough_to_judge = 60000; ///< points of a sample

/// About `wanted` of these points, chosen by a hash: every n-th point in recording order would skip whole scan lines.
[[nodiscard]] std::vector<Eigen::Vector3d> sampled(std::span<const Eigen::Vector3d> points, const Indices& indices,
                                                   std::size_t wanted);
/// The places where noise is looked for: of the points with these numbers.
[[nodiscard]] std::vector<NoisePlace> noise_places(std::span<const Eigen::Vector3d> points, const Indices& those);
[[nodiscard]] Indices finite(std::span<const Eigen::Vector3d> points);

} // namespace scanshade
