#include "ao/cloud/sides/side_score.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace scanshade {

SideFeatures side_features(const SideSigns& signs) {
    const auto beyond = [](double value, double knot) { return std::max(value - knot, 0.0); };
    const double boxed = std::min(signs.boxed, 0.6), no_walls = 1 - 10 * std::min(signs.boxed, 0.1),
                 round_and_closed = beyond(signs.fronts, 0.6) / 0.4 * signs.afar * no_walls,
                 size = std::max(signs.smallest_m, 1e-6);
    // As high as rooms are, within a factor of 1.6; and too low for one.
    const double heights = std::log(size / 3) / 0.5, as_rooms = std::exp(-0.5 * heights * heights),
                 too_low = std::clamp(std::log(1.5 / size), 0.0, 1.5);
    return {1,
            signs.inner_cover - signs.outer_cover,
            std::clamp((signs.outer_stations - signs.inner_stations) / 10, -1.0, 1.0),
            signs.inner_meets,
            signs.outer_meets,
            beyond(signs.fronts, 0.6),
            beyond(signs.fronts, 0.9),
            signs.afar,
            std::max(signs.within, 0.0),
            boxed,
            as_rooms * boxed,
            signs.up_known ? signs.rise : 0,
            std::abs(signs.rise),
            too_low,
            round_and_closed,
            beyond(std::abs(signs.rise), 0.6),
            beyond(signs.fronts, 0.6) * std::max(signs.within, 0.0),
            beyond(signs.fronts, 0.6) * too_low};
}

double inner_probability(const SideSigns& signs) {
    constexpr SideFeatures weights{25.76, 2.02, 1.32, -8.62, 8.38,  2.39,  73.09, -25.34, 0.02,
                                   5.32,  2.30, 3.91, -5.16, -1.98, -5.40, 12.63, 15.01,  -6.42};
    const SideFeatures features = side_features(signs);
    const double sum = std::inner_product(features.begin(), features.end(), weights.begin(), 0.0);
    return 1 / (1 + std::exp(-sum));
}

} // namespace scanshade
