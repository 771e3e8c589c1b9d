#include "tests/bench/error_fit.h"

#include "tests/bench/knot_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

KnotLayout layout_of_table() {
    using Order = KnotRow::Order;
    KnotLayout layout{.factors = shared::error_factors, .rows = {}, .groups = {}};
    for (int value = 0; value < shared::error_values; ++value)
        layout.rows.push_back({value, shared::error_shares, shared::error_values, Order::falling});
    for (int share = 0; share < shared::error_shares; ++share)
        layout.rows.push_back({share * shared::error_values, shared::error_values, 1, Order::any});
    layout.groups.emplace_back(0, shared::error_edges_at);
    layout.add_row(shared::error_edges_at, shared::error_rings + 1, Order::falling);
    layout.add_row(shared::error_holes_at, shared::error_rings + 1, Order::falling);
    layout.add_row(shared::error_reaches_at, shared::error_reaches, Order::any);
    layout.add_row(shared::error_noises_at, shared::error_noises, Order::rising);
    return layout;
}

double squared(const ErrorWeights& signs, const shared::ErrorTable& table) {
    float sum = 0;
    for (std::size_t i = 0; i < ErrorWeights::count; ++i)
        sum += signs.weight[i] * table.factors[signs.factor[i]];
    return static_cast<double>(std::exp2(std::min(sum, 0.0F)));
}

/// The last factor of distances, and the first of noise, becomes 0: the rest is in the first table.
void anchor(shared::ErrorTable& table) {
    const auto move = [&](int first, int count, int zero) {
        const float off = table.factors[first + zero];
        for (int i = 0; i < count; ++i)
            table.factors[first + i] -= off;
        for (int i = 0; i < shared::error_edges_at; ++i)
            table.factors[i] += off;
    };
    move(shared::error_edges_at, shared::error_rings + 1, shared::error_rings);
    move(shared::error_holes_at, shared::error_rings + 1, shared::error_rings);
    move(shared::error_reaches_at, shared::error_reaches, 3);
    move(shared::error_noises_at, shared::error_noises, 0);
}

} // namespace

shared::ErrorTable fitted_errors(std::span<const ErrorSample> samples, int without) {
    std::vector<KnotExample> examples;
    examples.reserve(samples.size());
    for (const ErrorSample& sample : samples)
        if (sample.scene != without)
            examples.push_back({sample.signs, static_cast<double>(sample.square)});
    shared::ErrorTable table{};
    const std::vector<double> fitted = fitted_knots(examples, layout_of_table());
    std::ranges::transform(fitted, table.factors, [](double factor) { return static_cast<float>(factor); });
    anchor(table);
    return table;
}

float factor_of(std::span<const ErrorSample> samples, const shared::ErrorTable& table, int without) {
    double found = 0, expects = 0;
    for (const ErrorSample& sample : samples) {
        if (sample.scene == without)
            continue;
        found += static_cast<double>(sample.square);
        expects += squared(sample.signs, table);
    }
    return found > 0 && expects > 0 ? static_cast<float>(std::log2(found / expects)) : 0;
}

Calibration::Bin Calibration::of(std::span<const Pair> some) {
    double expected = 0, found = 0;
    for (const auto& [expects, square] : some) {
        expected += static_cast<double>(expects * expects);
        found += static_cast<double>(square);
    }
    const auto count = static_cast<double>(std::max<std::size_t>(some.size(), 1));
    return {std::sqrt(expected / count), std::sqrt(found / count)};
}

std::array<Calibration::Bin, Calibration::bins> Calibration::in_bins() {
    std::ranges::sort(all_, {}, &Pair::first);
    std::array<Bin, bins> made;
    for (std::size_t i = 0; i < bins; ++i) {
        const std::size_t first = all_.size() * i / bins, end = all_.size() * (i + 1) / bins;
        made[i] = of(std::span(all_).subspan(first, end - first));
    }
    return made;
}

std::string text_of(const Calibration::Bin& bin) { return fmt::format("{:.3f}/{:.3f}", bin.expected, bin.found); }

std::string text_of_bins(Calibration& calibration) {
    std::string text;
    for (const Calibration::Bin& bin : calibration.in_bins())
        text += (text.empty() ? "" : " ") + text_of(bin);
    return text;
}

} // namespace scanshade
