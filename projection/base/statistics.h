// Order statistics: median and quantiles.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>

namespace scanshade {

/// The value at index `rank` of the sorted values; `rank` must be below their number. Reorders the values.
template <class Values>
[[nodiscard]] typename Values::value_type ranked(Values& values, std::size_t rank) {
    const auto place = values.begin() + static_cast<std::ptrdiff_t>(rank);
    std::nth_element(values.begin(), place, values.end());
    return *place;
}

/// The median, the upper one of two; `none` for no values.
template <class Values>
[[nodiscard]] typename Values::value_type
median(Values values,
       typename Values::value_type none = std::numeric_limits<typename Values::value_type>::quiet_NaN()) {
    return values.empty() ? none : ranked(values, values.size() / 2);
}

/// The `share` quantile (0 .. 1) by the lower nearest rank; NaN for no values. Reorders the values.
template <class Values>
[[nodiscard]] typename Values::value_type quantile(Values& values, double share) {
    if (values.empty())
        return std::numeric_limits<typename Values::value_type>::quiet_NaN();
    return ranked(values, static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

/// Sigma of a Gaussian from the median of its absolute values.
inline constexpr double median_of_gaussian = 0.674;

} // namespace scanshade
