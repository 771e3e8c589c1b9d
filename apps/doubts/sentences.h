// What the rules of this room share.
#pragma once

#include "projection/base/statistics.h"

#include <string>
#include <vector>

namespace scanshade {

/// The values below which 1 % and 99 % lie, and the median.
struct Spread {
    double low = 0, middle = 0, high = 0;
};

/// Reorders the values.
inline Spread spread_of(std::vector<double>& values) {
    return {quantile(values, 0.01), quantile(values, 0.5), quantile(values, 0.99)};
}

} // namespace scanshade
