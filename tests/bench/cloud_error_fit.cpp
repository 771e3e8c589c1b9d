#include "tests/bench/cloud_error_fit.h"

#include "tests/bench/knot_fit.h"

#include <algorithm>
#include <cmath>
#include <tbb/parallel_invoke.h>
#include <tuple>
#include <vector>

namespace scanshade {
namespace {

using Tables = CloudErrorTables;
using Order = KnotRow::Order;

KnotLayout empty_layout(std::size_t factors) {
    constexpr double few = 100; // points of many clouds: they are hardly related
    return {.factors = static_cast<int>(factors), .rows = {}, .groups = {}, .few = few};
}

/// `lines` rows of visibilities, and how errors go from line to line.
void add_grid(KnotLayout& layout, int lines, Order order) {
    for (int value = 0; value < Tables::values; ++value)
        layout.rows.push_back({value, lines, Tables::values, order});
    for (int line = 0; line < lines; ++line)
        layout.rows.push_back({line * Tables::values, Tables::values, 1, Order::any});
    layout.groups.emplace_back(0, lines * Tables::values);
}

KnotLayout layout_of_checked() {
    KnotLayout layout = empty_layout(std::tuple_size_v<decltype(Tables::checked)>);
    add_grid(layout, Tables::repeats, Order::rising);
    const int first = Tables::values * Tables::repeats;
    layout.add_row(first, Tables::spans, Order::falling);
    layout.add_row(first + Tables::spans, Tables::folds, Order::any);
    layout.add_row(first + Tables::spans + Tables::folds, Tables::roughs, Order::any);
    return layout;
}

/// Spans are in the grid.
KnotLayout layout_of_unchecked() {
    KnotLayout layout = empty_layout(std::tuple_size_v<decltype(Tables::unchecked)>);
    add_grid(layout, Tables::spans, Order::falling);
    const int first = Tables::values * Tables::spans;
    layout.add_row(first, Tables::folds, Order::any);
    layout.add_row(first + Tables::folds, Tables::roughs, Order::any);
    return layout;
}

KnotLayout layout_of_turned() {
    KnotLayout layout = empty_layout(std::tuple_size_v<decltype(Tables::turned)>);
    add_grid(layout, Tables::sides, Order::falling);
    return layout;
}

template <std::size_t count>
void fit(const std::vector<KnotExample>& examples, const KnotLayout& layout, std::array<float, count>& table) {
    std::ranges::transform(fitted_knots(examples, layout), table.begin(),
                           [](double factor) { return static_cast<float>(factor); });
}

} // namespace

CloudErrorTables fitted_cloud_errors(std::span<const CloudErrorSample> samples, int without) {
    std::vector<KnotExample> checked, unchecked, turned;
    for (const CloudErrorSample& sample : samples) {
        if (sample.scene == without)
            continue;
        const auto square = static_cast<double>(sample.square);
        const double layers = layers_square(sample.signs.back);
        const double upright = sample.turned ? 0 : std::max(square - layers, 0.0); // the rest is the turned table's
        if (!std::isnan(sample.signs.repeat))
            checked.push_back({checked_weights(sample.signs), upright});
        unchecked.push_back({unchecked_weights(sample.signs), upright});
        if (sample.signs.side <= 1)
            turned.push_back({turned_weights(sample.signs), square - upright});
    }
    CloudErrorTables tables;
    tbb::parallel_invoke([&] { fit(checked, layout_of_checked(), tables.checked); },
                         [&] { fit(unchecked, layout_of_unchecked(), tables.unchecked); },
                         [&] { fit(turned, layout_of_turned(), tables.turned); });
    constexpr float never = -30;
    if (!samples.empty() && std::ranges::none_of(turned, [](const KnotExample& each) { return each.square > 0; }))
        tables.turned.fill(never);
    return tables;
}

} // namespace scanshade
