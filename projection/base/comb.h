// Numbers that are all at the same place between whole multiples of something, such as pixels.
#pragma once

#include <cmath>
#include <complex>
#include <numbers>
#include <span>

namespace scanshade {

/// per_unit * value is a whole number plus `place`, -0.5 .. 0.5, for most values.
struct Comb {
    double per_unit = 0, place = 0;
    double alike = 0; ///< how many: 1 = all are at that place, 0 = anywhere
};

[[nodiscard]] inline Comb comb_at(std::span<const double> values, double per_unit) {
    std::complex<double> sum = 0;
    for (const double value : values)
        sum += std::polar(1.0, 2 * std::numbers::pi * per_unit * value);
    return {per_unit, std::arg(sum) / (2 * std::numbers::pi), std::abs(sum) / static_cast<double>(values.size())};
}

} // namespace scanshade
