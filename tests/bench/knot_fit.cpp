#include "tests/bench/knot_fit.h"

#include <algorithm>
#include <cmath>

namespace scanshade {
namespace {

using Numbers = std::vector<double>;

double squared(const ErrorWeights& weights, const Numbers& factors) {
    double sum = 0;
    for (std::size_t i = 0; i < ErrorWeights::count; ++i)
        sum += static_cast<double>(weights.weight[i]) * factors[static_cast<std::size_t>(weights.factor[i])];
    return std::exp2(std::min(sum, 0.0));
}

/// Pools neighbours that are in the wrong order (isotonic regression, weighted).
void put_in_order(const KnotRow& row, const Numbers& counts, Numbers& factors) {
    if (row.order == KnotRow::Order::any)
        return;
    const double sign = row.order == KnotRow::Order::rising ? 1 : -1;
    struct Pool {
        double mean, weight;
        int size;
    };
    std::vector<Pool> pools;
    for (int i = 0; i < row.count; ++i) {
        const auto at = static_cast<std::size_t>(row.first + i * row.stride);
        pools.push_back({sign * factors[at], counts[at] + 1, 1});
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
            factors[static_cast<std::size_t>(row.first + i * row.stride)] = sign * pool.mean;
}

/// Knots with few samples follow their neighbours in the row.
void draw_to_neighbours(const KnotLayout& layout, const Numbers& counts, Numbers& factors) {
    Numbers sum(factors.size()), neighbours(factors.size());
    for (const KnotRow& row : layout.rows)
        for (int i = 0; i + 1 < row.count; ++i) {
            const auto a = static_cast<std::size_t>(row.first + i * row.stride),
                       b = static_cast<std::size_t>(row.first + (i + 1) * row.stride);
            sum[a] += (counts[b] + 1) * factors[b];
            neighbours[a] += counts[b] + 1;
            sum[b] += (counts[a] + 1) * factors[a];
            neighbours[b] += counts[a] + 1;
        }
    for (std::size_t k = 0; k < factors.size(); ++k)
        if (neighbours[k] > 0) {
            const double own = counts[k] / (counts[k] + layout.few);
            factors[k] = own * factors[k] + (1 - own) * sum[k] / neighbours[k];
        }
}

} // namespace

void KnotLayout::add_row(int first, int count, KnotRow::Order order) {
    rows.push_back({first, count, 1, order});
    groups.emplace_back(first, first + count);
}

std::vector<double> fitted_knots(std::span<const KnotExample> examples, const KnotLayout& layout) {
    constexpr int rounds = 80;
    constexpr double step = 0.6; // knots of one example share its ratio
    constexpr double most = 2;   // a knot without errors is not infinitely good
    const auto count = static_cast<std::size_t>(layout.factors);
    Numbers factors(count), counts(count);
    double square = 0;
    for (const KnotExample& example : examples) {
        square += example.square;
        for (std::size_t i = 0; i < ErrorWeights::count; ++i)
            counts[static_cast<std::size_t>(example.weights.factor[i])] +=
                static_cast<double>(example.weights.weight[i]);
    }
    if (!(square > 0))
        return factors;
    const double mean = std::log2(square / static_cast<double>(examples.size()));
    std::fill_n(factors.begin(), layout.groups[0].second, mean);
    for (int round = 0; round < rounds; ++round) {
        Numbers found(count), expected(count);
        for (const KnotExample& example : examples) {
            const double expects = squared(example.weights, factors);
            for (std::size_t i = 0; i < ErrorWeights::count; ++i) {
                const auto at = static_cast<std::size_t>(example.weights.factor[i]);
                found[at] += static_cast<double>(example.weights.weight[i]) * example.square;
                expected[at] += static_cast<double>(example.weights.weight[i]) * expects;
            }
        }
        const auto [first, end] = layout.groups[static_cast<std::size_t>(round) % layout.groups.size()];
        for (auto k = static_cast<std::size_t>(first); k < static_cast<std::size_t>(end); ++k)
            if (expected[k] > 0)
                factors[k] += step * std::clamp(std::log2(std::max(found[k], 1e-9) / expected[k]), -most, most);
        for (const KnotRow& row : layout.rows)
            put_in_order(row, counts, factors);
        draw_to_neighbours(layout, counts, factors);
    }
    double expects = 0;
    for (const KnotExample& example : examples)
        expects += squared(example.weights, factors);
    for (int k = 0; k < layout.groups[0].second; ++k)
        factors[static_cast<std::size_t>(k)] += std::log2(square / expects);
    return factors;
}

} // namespace scanshade
