#include "projection/sensor/pixel_locking.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <Eigen/Core>
#include <iterator>
#include <numbers>
#include <span>

namespace scanshade {
namespace {

/// The mean of exp(2 pi i q / period): 0 where fractions of the period are even, its length 1 where all are the same.
std::complex<double> preference(std::span<const float> inverse_m, double period) {
    const Eigen::Map<const Eigen::ArrayXf> q(inverse_m.data(), std::ssize(inverse_m));
    const Eigen::ArrayXf phases = q * static_cast<float>(2 * std::numbers::pi / period);
    return {static_cast<double>(phases.cos().mean()), static_cast<double>(phases.sin().mean())};
}

/// How strong it is off the period, where a narrow range of disparities makes it strong, too.
double preference_nearby(std::span<const float> inverse_m, double period) {
    std::vector<double> others;
    for (const double factor : {0.7, 0.74, 0.78, 0.82, 0.86, 1.16, 1.22, 1.28, 1.34, 1.4})
        others.push_back(std::abs(preference(inverse_m, factor * period)));
    return median(std::move(others));
}

/// Whether pixels near, far and between prefer the same disparities: whole ones. Walls prefer those that they are at.
bool is_everywhere(std::vector<float> inverse_m, double period) {
    constexpr std::size_t parts = 4, enough = 2;
    constexpr double least_periods = 2, least = 0.2, same_phase = 0.12; // in periods
    std::ranges::sort(inverse_m);
    std::size_t telling = 0;
    for (std::size_t part = 0; part < parts; ++part) {
        const std::size_t first = part * inverse_m.size() / parts, end = (part + 1) * inverse_m.size() / parts;
        const auto some = std::span<const float>(inverse_m).subspan(first, end - first);
        if (static_cast<double>(some.back() - some.front()) < least_periods * period)
            continue;
        const std::complex<double> preferred = preference(some, period);
        if (std::abs(preferred) < least || std::abs(std::arg(preferred)) > 2 * std::numbers::pi * same_phase)
            return false;
        ++telling;
    }
    return telling >= enough;
}

/// The deviation of the share of smaller fractions from the fraction, in periods.
double unevenness(std::span<const float> inverse_m, double period) {
    const double phase = std::arg(preference(inverse_m, period)) / (2 * std::numbers::pi);
    std::vector<double> fractions;
    for (const float q : inverse_m) {
        const double periods = static_cast<double>(q) / period - phase + 0.5; // the preferred one is in the middle
        fractions.push_back(periods - std::floor(periods));
    }
    std::ranges::sort(fractions);
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < fractions.size(); ++i) {
        const double off = (static_cast<double>(i) + 0.5) / static_cast<double>(fractions.size()) - fractions[i];
        sum += off, squares += off * off;
    }
    const double count = static_cast<double>(fractions.size()), mean = sum / count;
    return std::sqrt(std::max(squares / count - mean * mean, 0.0));
}

} // namespace

double locking_of(const std::vector<float>& inverse_m, double step_per_m) {
    constexpr std::size_t enough = 1000;
    constexpr double least = 0.25, least_times = 2.5; // what is found nearby
    if (inverse_m.size() < enough)
        return 0;
    double period = 0, strongest = 0;
    for (const int steps : {8, 16, 32})
        for (double off = -0.06; off <= 0.06; off += 0.002) { // a step is not told more exactly
            const double tried = steps * step_per_m * (1 + off), found = std::abs(preference(inverse_m, tried));
            if (found > strongest)
                strongest = found, period = tried;
        }
    if (strongest < least || strongest < least_times * preference_nearby(inverse_m, period) ||
        !is_everywhere(inverse_m, period))
        return 0;
    return unevenness(inverse_m, period) * period;
}

} // namespace scanshade
