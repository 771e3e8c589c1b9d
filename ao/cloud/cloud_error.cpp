#include "ao/cloud/cloud_error.h"

#include "projection/base/error.h"

#include "cloud_errors.inc"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sstream>

namespace scanshade {
namespace {

using Tables = CloudErrorTables;

/// A place between two knots.
struct Knot {
    int below;
    float past; ///< 0 = on the lower one, 1 = on the upper one
};
Knot knot_at(float place, int knots) {
    const float within = place > 0 ? std::min(place, static_cast<float>(knots - 1)) : 0.0F; // NaN is the first
    const int below = std::min(static_cast<int>(within), knots - 2);
    return {below, within - static_cast<float>(below)};
}

/// 0 .. 1, evenly in 1 - sqrt(1 - share): errors change fast towards 1.
float place_of_share(float share) { return 1 - std::sqrt(1 - std::clamp(share, 0.0F, 1.0F)); }
Knot knot_of_share(float share, int knots) {
    return knot_at(place_of_share(share) * static_cast<float>(knots - 1), knots);
}

/// Powers of two that make a number of 1 and more; in between it is linear. A tenth of the time of std::log2.
float doublings(float number) {
    constexpr float per_power = 0x1p-23F;
    constexpr int power_of_one = 127;
    const float from_one = number >= 1 ? number : 1.0F; // NaN is 1
    return static_cast<float>(std::bit_cast<std::int32_t>(from_one)) * per_power - power_of_one;
}

Knot knot_of_span(float span) { return knot_at(doublings(span), Tables::spans); }
Knot knot_of_repeat(float repeat) { return knot_at(doublings(1 + 64 * repeat), Tables::repeats); }
Knot knot_of_fold(float flatness) {
    return knot_at(doublings(1 + 30 * std::sqrt(std::max(1 - flatness, 0.0F))), Tables::folds);
}
Knot knot_of_rough(float rough) { return knot_at(doublings(1 + 64 * rough), Tables::roughs); }

float between(const float* row, const Knot& knot) {
    return row[knot.below] + knot.past * (row[knot.below + 1] - row[knot.below]);
}
float between(const float* grid, const Knot& down, const Knot& across, int columns) {
    const float* row = grid + down.below * columns;
    const float upper = between(row, across);
    return upper + down.past * (between(row + columns, across) - upper);
}

float of_folds_and_roughs(const CloudErrorSigns& signs, const float* folds) {
    return between(folds, knot_of_fold(signs.flatness)) + between(folds + Tables::folds, knot_of_rough(signs.rough));
}

/// Factors with their weights, added one after the other: the same sums for those who fit.
struct Adding {
    ErrorWeights weights{};
    std::size_t next = 0;

    void add(int factor, float weight) {
        weights.factor[next] = factor;
        weights.weight[next++] = weight;
    }
    void row(int first, const Knot& knot) {
        add(first + knot.below, 1 - knot.past);
        add(first + knot.below + 1, knot.past);
    }
    /// `across` varies fastest.
    void grid(const Knot& down, const Knot& across, int columns) {
        for (int row = 0; row < 2; ++row)
            for (int column = 0; column < 2; ++column)
                add((down.below + row) * columns + across.below + column,
                    (row ? down.past : 1 - down.past) * (column ? across.past : 1 - across.past));
    }
    /// Those behind a table of `first` factors.
    void surroundings(int first, const CloudErrorSigns& signs) {
        row(first, knot_of_span(signs.span));
        row(first + Tables::spans, knot_of_fold(signs.flatness));
        row(first + Tables::spans + Tables::folds, knot_of_rough(signs.rough));
    }
};

/// What the side adds to the square.
float turned_square(const Knot& value, float side, const Tables& tables) {
    if (side > 1)
        return 0;
    return std::exp2(between(tables.turned.data(), knot_of_share(side, Tables::sides), value, Tables::values));
}

float error_from(float square) { return std::sqrt(std::min(square, 1.0F)); }

template <std::size_t count>
void take_numbers(std::istringstream& words, std::array<float, count>& numbers) {
    for (float& number : numbers)
        if (!(words >> number) || !std::isfinite(number))
            throw Error(fmt::format("{} numbers expected", count));
    if (std::string more; words >> more)
        throw Error(fmt::format("'{}' is one word too many: {} numbers expected", more, count));
}

} // namespace

namespace {
// Of 20 merged clouds of five scenes 0.6 to 0.8 of the share of backs fits what is left; 0.7 was chosen on kitchen and
// attic.
constexpr float per_share = 0.7F;
} // namespace

float layers_square(float back) { return back > 0 ? per_share * per_share * back * back : 0.0F; }

// Of 18 simulated sweeps of eight rooms, 16 to 64 lasers, one and four stations.
float back_of_lines(double share) {
    constexpr double square = 0.0152; // of sweeps that are all lines, beyond what is expected of other clouds
    constexpr double anywhere = 0.05; // chance puts as many points on lines
    return static_cast<float>(std::sqrt(square * std::max(share - anywhere, 0.0))) / per_share;
}

ErrorWeights checked_weights(const CloudErrorSigns& signs) {
    Adding all;
    all.grid(knot_of_repeat(signs.repeat), knot_of_share(signs.visibility, Tables::values), Tables::values);
    all.surroundings(Tables::values * Tables::repeats, signs);
    return all.weights;
}

ErrorWeights unchecked_weights(const CloudErrorSigns& signs) {
    Adding all;
    all.grid(knot_of_span(signs.span), knot_of_share(signs.visibility, Tables::values), Tables::values);
    all.row(Tables::values * Tables::spans, knot_of_fold(signs.flatness));
    all.row(Tables::values * Tables::spans + Tables::folds, knot_of_rough(signs.rough));
    return all.weights;
}

ErrorWeights turned_weights(const CloudErrorSigns& signs) {
    Adding all;
    all.grid(knot_of_share(signs.side, Tables::sides), knot_of_share(signs.visibility, Tables::values), Tables::values);
    return all.weights;
}

float factor_of_surroundings(const CloudErrorSigns& signs, const CloudErrorTables& tables) {
    const float* spans = tables.checked.data() + Tables::values * Tables::repeats;
    return between(spans, knot_of_span(signs.span)) + of_folds_and_roughs(signs, spans + Tables::spans);
}

float checked_error(float factor_of_surroundings, const CloudErrorSigns& signs, const CloudErrorTables& tables) {
    const Knot value = knot_of_share(signs.visibility, Tables::values);
    const float factor = between(tables.checked.data(), knot_of_repeat(signs.repeat), value, Tables::values);
    return error_from(std::exp2(factor + factor_of_surroundings) + turned_square(value, signs.side, tables) +
                      layers_square(signs.back));
}

float expected_error(const CloudErrorSigns& signs, const CloudErrorTables& tables) {
    if (!std::isnan(signs.repeat))
        return checked_error(factor_of_surroundings(signs, tables), signs, tables);
    const Knot value = knot_of_share(signs.visibility, Tables::values);
    const float factor = between(tables.unchecked.data(), knot_of_span(signs.span), value, Tables::values) +
                         of_folds_and_roughs(signs, tables.unchecked.data() + Tables::values * Tables::spans);
    return error_from(std::exp2(factor) + turned_square(value, signs.side, tables) + layers_square(signs.back));
}

KeptSigns kept(const CloudErrorSigns& signs) {
    const float side = signs.side > 1 ? 255 : 254 * place_of_share(signs.side); // evenly between knots
    return {static_cast<std::uint8_t>(std::lround(side)), static_cast<std::uint8_t>(std::lround(255 * signs.back))};
}
float side_of(std::uint8_t byte) {
    const float past = 1 - static_cast<float>(byte) / 254.0F;
    return byte == 255 ? CloudErrorSigns::recorded : 1 - past * past;
}

CloudErrorTables cloud_error_tables_from(std::istream& text, const std::string& origin) {
    CloudErrorTables tables;
    std::vector<std::string> missing{"checked", "unchecked", "turned"};
    int number = 0;
    for (std::string line; std::getline(text, line);) {
        ++number;
        if (line.empty() || line[0] == '#')
            continue;
        during(fmt::format("{}, line {}", origin, number), [&] {
            std::istringstream words(line);
            std::string kind;
            words >> kind;
            std::erase(missing, kind);
            if (kind == "made_by")
                std::getline(words >> std::ws, tables.made_by);
            else if (kind == "checked")
                take_numbers(words, tables.checked);
            else if (kind == "unchecked")
                take_numbers(words, tables.unchecked);
            else if (kind == "turned")
                take_numbers(words, tables.turned);
            else
                throw Error(fmt::format("made_by, checked, unchecked or turned expected, found '{}'", kind));
        });
    }
    if (!missing.empty())
        throw Error(fmt::format("{}: a line '{} ...' expected, found none", origin, missing.front()));
    return tables;
}

std::string text_of(const CloudErrorTables& tables) {
    return fmt::format("# Expected errors of the points of clouds: binary logarithms of factors of the squared error, "
                       "in the order of\n# ao/cloud/cloud_error.h. Renew them by the command below.\n"
                       "made_by {}\nchecked {:.2f}\nunchecked {:.2f}\nturned {:.2f}\n",
                       tables.made_by, fmt::join(tables.checked, " "), fmt::join(tables.unchecked, " "),
                       fmt::join(tables.turned, " "));
}

const CloudErrorTables& shipped_cloud_errors() {
    static const CloudErrorTables tables = [] {
        std::istringstream text(cloud_errors_text);
        return cloud_error_tables_from(text, "ao/cloud/expected_errors.txt");
    }();
    return tables;
}

float error_once_checked(float factor_of_surroundings, float visibility, const KeptSigns& kept, float repeat) {
    const CloudErrorSigns signs{.visibility = visibility,
                                .side = side_of(kept.side),
                                .repeat = repeat,
                                .back = static_cast<float>(kept.back) / 255.0F};
    return checked_error(factor_of_surroundings, signs, shipped_cloud_errors());
}

void ErrorSum::add(float error) {
    if (std::isnan(error))
        return;
    squares_ += static_cast<double>(error) * static_cast<double>(error);
    ++count_;
}

std::optional<double> ErrorSum::rms() const {
    return count_ > 0 ? std::optional(std::sqrt(squares_ / static_cast<double>(count_))) : std::nullopt;
}

} // namespace scanshade
