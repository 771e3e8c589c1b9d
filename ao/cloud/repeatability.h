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

    /// RMS error that all differences together let expect; 0 where there are none.
    [[nodiscard]] double error() const { return rms_; }
    /// For each point of the cloud, the RMS error that the differences round it let expect; 1 where no point has both
    /// values. `whole`: their values; without one a point has 1, too. `order` holds every index once, or is empty for
    /// the order given: the time is short where its neighbours are neighbours in space.
    [[nodiscard]] std::vector<float> errors(std::span<const Eigen::Vector3d> points, std::span<const float> whole,
                                            std::span<const std::uint32_t> order = {}) const;

  private:
    double rms_ = 0;
    std::optional<LocalCloud> cloud_; ///< of the points that have both values
    std::vector<float> error_;        ///< by index in the tree
};

/// What the check found.
struct Repeatability {
    double rms = 0;           ///< CheckedPart::error()
    std::vector<float> error; ///< CheckedPart::errors() of every point
};
/// `whole` are the values of `points`, in any unit; `thinned` those of the points with the indices `kept`; NaN where
/// unknown. `order` holds every index once: the time is short where its neighbours are neighbours in space.
[[nodiscard]] Repeatability repeatability(std::span<const Eigen::Vector3d> points, std::span<const float> whole,
                                          std::span<const std::uint32_t> kept, std::span<const float> thinned,
                                          const ThinnedCheck& check, std::span<const std::uint32_t> order);

} // namespace scanshade
