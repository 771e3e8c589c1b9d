// Which of two labellings of a cloud's sides is the scanned one, where each is the other with all sides turned.
#pragma once

#include <array>

namespace scanshade {

/// What tells them apart. From the inner sides more rays meet something: those of a room, or of a valley.
struct SideSigns {
    double inner_cover = 0, outer_cover = 0;       ///< shares of the tests that stations explain: Stations::cover()
    double inner_stations = 0, outer_stations = 0; ///< how many stations that takes
    double inner_meets = 0, outer_meets = 0;       ///< shares of the rays that meet something
    double fronts = 0;                             ///< of all that far stations see, the share of outer sides
    double afar = 0;                               ///< share of the tests whose outer side three far stations see
    double within = 0;                             ///< Stations::density_fits() of the inner sides
    double boxed = 0;                              ///< Stations::boxed()
    double rise = 0;                               ///< of the inner sides, along z or what is known to be up
    bool up_known = false;
    double smallest_m = 0; ///< extent along the axes, in metres as is the custom
};

/// Numbers that a logistic regression weighs; the first is 1.
using SideFeatures = std::array<double, 18>;
[[nodiscard]] SideFeatures side_features(const SideSigns& signs);

/// The probability that the inner sides are the scanned ones, by weights fitted to generated scenes, half of them
/// random rooms, bodies, things on the ground, and hills: `developers_bench sides --fit`.
[[nodiscard]] double inner_probability(const SideSigns& signs);

} // namespace scanshade
