// Fits factors of squared errors, which are interpolated between knots, to examples whose true error is known.
#pragma once

#include "projection/sensor/expected_error.h"

#include <span>
#include <utility>
#include <vector>

namespace scanshade {

/// A row of knots, `stride` apart, whose factors may only rise or fall.
struct KnotRow {
    enum class Order { any, falling, rising };
    int first, count, stride;
    Order order;
};

/// The factors of one table.
struct KnotLayout {
    int factors = 0;
    std::vector<KnotRow> rows;
    std::vector<std::pair<int, int>> groups; ///< first and end. Each example's weights within a group add up to 1
    double few = 400; ///< a knot with so many examples follows itself and its neighbours in equal parts

    /// A row that is a group.
    void add_row(int first, int count, KnotRow::Order order);
};

struct KnotExample {
    ErrorWeights weights;
    double square = 0;
};

/// Binary logarithms of factors whose expected squares have the examples' sums over every knot: Bailey's minimum bias,
/// which is maximum likelihood of a gamma distribution's mean with logarithmic link. Nothing but zeros where all
/// squares are zero.
[[nodiscard]] std::vector<double> fitted_knots(std::span<const KnotExample> examples, const KnotLayout& layout);

} // namespace scanshade
