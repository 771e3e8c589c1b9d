// Statistics that several rooms need.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

namespace scanshade {

/// The middle value; of an even count the upper one of the two in the middle. NaN where there are no values.
template <class Number>
[[nodiscard]] Number median(std::vector<Number> values) {
    if (values.empty())
        return std::numeric_limits<Number>::quiet_NaN();
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Sigma of a Gaussian from the median of its absolute values.
inline constexpr double median_of_gaussian = 0.674;

} // namespace scanshade
