// Ranks of values: the median and its relatives, for every room.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>

namespace scanshade {

/// The value that `rank` others precede in order; `rank` must be below their number. Reorders the values.
template <class Values>
[[nodiscard]] typename Values::value_type ranked(Values& values, std::size_t rank) {
    const auto place = values.begin() + static_cast<std::ptrdiff_t>(rank);
    std::nth_element(values.begin(), place, values.end());
    return *place;
}

/// The middle value, the upper one of two; `none` where there are no values.
template <class Values>
[[nodiscard]] typename Values::value_type
median(Values values,
       typename Values::value_type none = std::numeric_limits<typename Values::value_type>::quiet_NaN()) {
    return values.empty() ? none : ranked(values, values.size() / 2);
}

/// The value that a `share` of 0 .. 1 of the values stays below, by the lower nearest rank; NaN where there are none.
/// Reorders the values.
template <class Values>
[[nodiscard]] typename Values::value_type quantile(Values& values, double share) {
    if (values.empty())
        return std::numeric_limits<typename Values::value_type>::quiet_NaN();
    return ranked(values, static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

/// Sigma of a Gaussian from the median of its absolute values.
inline constexpr double median_of_gaussian = 0.674;

} // namespace scanshade
