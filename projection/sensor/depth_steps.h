// The steps that recorded depths come in.
#pragma once

#include <vector>

namespace scanshade {

/// Depths are step_m + step_per_z2 z^2 apart, in metres and 1/m; 0 = none found.
struct DepthSteps {
    double step_m = 0, step_per_z2 = 0;
    double rounding_m = 0; ///< all values are whole numbers of these apart; 0 = none found
    bool halves = false;   ///< they are 16-bit floats, of 11 binary digits; then both are 0

    /// The step in metres at a depth above 0.
    [[nodiscard]] double at(double z_m) const;
    /// The deviation in metres of an error that is uniform over the step.
    [[nodiscard]] double sigma(double z_m) const;
};

/// `values_m`: the distinct depths of some images in metres, above 0 and ascending.
[[nodiscard]] DepthSteps steps_of(const std::vector<float>& values_m);

} // namespace scanshade
