#include "apps/measure/error_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace scanshade {
namespace {

constexpr int factors = shared::error_factors;
using Sums = std::array<double, factors>;

/// A row of knots, `stride` apart, whose factors may only rise or fall.
struct KnotRow {
    int first, count, stride;
    enum class Order { any, falling, rising } order;
};

std::vector<KnotRow> rows_of_knots() {
    using Order = KnotRow::Order;
    std::vector<KnotRow> rows;
    for (int value = 0; value < shared::error_values; ++value)
        rows.push_back({value, shared::error_shares, shared::error_values, Order::falling});
    for (int share = 0; share < shared::error_shares; ++share)
        rows.push_back({share * shared::error_values, shared::error_values, 1, Order::any});
    rows.push_back({shared::error_edges_at, shared::error_rings + 1, 1, Order::falling});
    rows.push_back({shared::error_holes_at, shared::error_rings + 1, 1, Order::falling});
    rows.push_back({shared::error_reaches_at, shared::error_reaches, 1, Order::any});
    rows.push_back({shared::error_noises_at, shared::error_noises, 1, Order::rising});
    return rows;
}

double squared(const ErrorWeights& signs, const shared::ErrorTable& table) {
    float sum = 0;
    for (std::size_t i = 0; i < ErrorWeights::count; ++i)
        sum += signs.weight[i] * table.factors[signs.factor[i]];
    return static_cast<double>(std::exp2(std::min(sum, 0.0F)));
}

/// Pools neighbours that are in the wrong order (isotonic regression, weighted).
void put_in_order(const KnotRow& row, const Sums& counts, shared::ErrorTable& table) {
    if (row.order == KnotRow::Order::any)
        return;
    const double sign = row.order == KnotRow::Order::rising ? 1 : -1;
    struct Pool {
        double mean, weight;
        int size;
    };
    std::vector<Pool> pools;
    for (int i = 0; i < row.count; ++i) {
        const int at = row.first + i * row.stride;
        pools.push_back({sign * static_cast<double>(table.factors[at]), counts[at] + 1, 1});
        while (pools.size() > 1 && pools[pools.size() - 2].mean > pools.back().mean) {
            const Pool last = pools.back();
            pools.pop_back();
            Pool& before = pools.back();
            const double weight = before.weight + last.weight;
            before = {(before.mean * before.weight + last.mean * last.weight) / weight, weight,
                      before.size + last.size};
        }
    }
    int i = 0;
    for (const Pool& pool : pools)
        for (int k = 0; k < pool.size; ++k, ++i)
            table.factors[row.first + i * row.stride] = static_cast<float>(sign * pool.mean);
}

/// Knots with few samples follow their neighbours in the row.
void draw_to_neighbours(const std::vector<KnotRow>& rows, const Sums& counts, shared::ErrorTable& table) {
    constexpr double few = 400;
    Sums sum{}, neighbours{};
    for (const KnotRow& row : rows)
        for (int i = 0; i + 1 < row.count; ++i) {
            const int a = row.first + i * row.stride, b = a + row.stride;
            const double of_a = counts[a] + 1, of_b = counts[b] + 1;
            sum[a] += of_b * static_cast<double>(table.factors[b]);
            neighbours[a] += of_b;
            sum[b] += of_a * static_cast<double>(table.factors[a]);
            neighbours[b] += of_a;
        }
    for (int k = 0; k < factors; ++k)
        if (neighbours[k] > 0) {
            const double own = counts[k] / (counts[k] + few);
            table.factors[k] =
                static_cast<float>(own * static_cast<double>(table.factors[k]) + (1 - own) * sum[k] / neighbours[k]);
        }
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
    constexpr int rounds = 80;
    constexpr double step = 0.6; // knots of one pixel share its ratio
    shared::ErrorTable table{};
    Sums counts{};
    double square = 0, number = 0;
    for (const ErrorSample& sample : samples)
        if (sample.scene != without) {
            square += static_cast<double>(sample.square);
            ++number;
            for (std::size_t i = 0; i < ErrorWeights::count; ++i)
                counts[sample.signs.factor[i]] += static_cast<double>(sample.signs.weight[i]);
        }
    if (number == 0 || square == 0)
        return table;
    for (int k = 0; k < shared::error_edges_at; ++k)
        table.factors[k] = static_cast<float>(std::log2(square / number));
    const std::vector<KnotRow> rows = rows_of_knots();
    // One group of knots after the other: each pixel's weights in a group add up to 1.
    const std::array<int, 6> groups{
        0, shared::error_edges_at, shared::error_holes_at, shared::error_reaches_at, shared::error_noises_at, factors};
    for (int round = 0; round < rounds; ++round) {
        Sums found{}, expected{};
        for (const ErrorSample& sample : samples) {
            if (sample.scene == without)
                continue;
            const double expects = squared(sample.signs, table);
            for (std::size_t i = 0; i < ErrorWeights::count; ++i) {
                const auto weight = static_cast<double>(sample.signs.weight[i]);
                found[sample.signs.factor[i]] += weight * static_cast<double>(sample.square);
                expected[sample.signs.factor[i]] += weight * expects;
            }
        }
        const std::size_t group = static_cast<std::size_t>(round) % (groups.size() - 1);
        for (int k = groups[group]; k < groups[group + 1]; ++k)
            if (expected[k] > 0 && found[k] > 0)
                table.factors[k] += static_cast<float>(step * std::log2(found[k] / expected[k]));
        for (const KnotRow& row : rows)
            put_in_order(row, counts, table);
        draw_to_neighbours(rows, counts, table);
    }
    anchor(table);
    const float off = [&] {
        double expects = 0;
        for (const ErrorSample& sample : samples)
            expects += sample.scene == without ? 0 : squared(sample.signs, table);
        return static_cast<float>(std::log2(square / expects));
    }();
    for (int k = 0; k < shared::error_edges_at; ++k)
        table.factors[k] += off;
    return table;
}

float factor_of(std::span<const ErrorSample> samples, const shared::ErrorTable& table) {
    double found = 0, expects = 0;
    for (const ErrorSample& sample : samples) {
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

} // namespace scanshade
