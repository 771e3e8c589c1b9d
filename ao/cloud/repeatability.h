// How far values depend on which points were recorded: the same cloud, thinned, gives others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

namespace scanshade {

/// A check that costs at most about a quarter of the time: `keep` of the points are computed once more by themselves.
struct ThinnedCheck {
    double keep = 0; ///< share of the points; 0 = none, since so dense a cloud tells nothing new
    /// An error that falls like the spacing is this times the difference between thinned and whole cloud (Richardson's
    /// extrapolation). With a quarter of the points, spacings are twice as wide, and the difference is the error.
    [[nodiscard]] double error_per_difference() const;
};
/// For so many points, and a radius that spans so many of their spacings.
[[nodiscard]] ThinnedCheck thinned_check(std::size_t points, double radius_in_spacings);

/// What the check found.
struct Repeatability {
    std::optional<double> error; ///< expected RMS error of visibility; nothing where no point has both values
    /// One per point: the error expected of its surroundings as a factor of confidence: 1 = none, 1/2 = 0.15.
    std::vector<float> confidence;
};
/// `whole` are the values of `points`, in any unit; `thinned` those of the points with the indices `kept`; NaN where
/// unknown. `order` holds every index once: the time is short where its neighbours are neighbours in space.
[[nodiscard]] Repeatability repeatability(std::span<const Eigen::Vector3d> points, std::span<const float> whole,
                                          std::span<const std::uint32_t> kept, std::span<const float> thinned,
                                          const ThinnedCheck& check, std::span<const std::uint32_t> order);

} // namespace scanshade
