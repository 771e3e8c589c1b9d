// How far values depend on which points were recorded: the same cloud, thinned, gives others.
#pragma once

#include "ao/cloud/surface/neighbours.h"

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

/// The values of the part by itself beside those of the whole, and what they tell of places near by.
class CheckedPart {
  public:
    /// `whole` are the values of these points among all, `thinned` those of them by themselves; NaN where unknown.
    CheckedPart(std::span<const Eigen::Vector3d> points, std::span<const float> whole, std::span<const float> thinned,
                const ThinnedCheck& check);

    /// Expected RMS error of visibility; nothing where no point has both values.
    [[nodiscard]] std::optional<double> error() const { return error_; }
    /// A factor of confidence for each point of the cloud, from the error expected of its surroundings: 1 = none, 1/2 =
    /// 0.15. `whole`: their values. `order` holds every index once, or is empty for the order given: the time is short
    /// where its neighbours are neighbours in space.
    [[nodiscard]] std::vector<float> factors(std::span<const Eigen::Vector3d> points, std::span<const float> whole,
                                             std::span<const std::uint32_t> order = {}) const;

  private:
    std::optional<LocalCloud> cloud_; ///< of the points that have both values
    std::vector<float> factor_;       ///< by index in the tree
    std::optional<double> error_;
};

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
