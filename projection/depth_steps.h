// The steps that recorded depths come in.
#pragma once

#include <vector>

namespace scanshade {

/// Depths are step_m + step_per_z2 z^2 apart; 0 = none found.
struct DepthSteps {
    double step_m = 0, step_per_z2 = 0;
    bool halves = false; ///< they are 16-bit floats, of 11 binary digits

    [[nodiscard]] double at(double z_m) const;
    /// The deviation of an error that is uniform over the step.
    [[nodiscard]] double sigma(double z_m) const;
};

/// `values_m`: the distinct depths of some images, in order.
[[nodiscard]] DepthSteps steps_of(const std::vector<float>& values_m);

} // namespace scanshade
