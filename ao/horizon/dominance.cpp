#include "ao/horizon/dominance.h"

#include "ao/horizon/padded.h"

#include <cmath>
#include <numbers>
#include <tbb/parallel_for.h>
#include <vector>

namespace scanshade::horizon {

namespace {

/// A place that a cell looks down at, from radius d: max(z0 + o - z, 0) (2 d + i) / d counts.
struct Look {
    std::ptrdiff_t at = 0; ///< of a cell, or of the north-west one of four
    float weight = 0;      ///< (2 d + i) / d
    float x = 0, y = 0;    ///< profile exact: between the four, to the east and to the south
};

std::vector<Look> nearest_cells(const Dominance& rows, std::ptrdiff_t stride) {
    std::vector<Look> looks;
    for (int d = rows.least; d <= rows.most; d += rows.step)
        for (int a = 0; a <= 359; a += rows.angle) {
            const double angle = a * (std::numbers::pi / 180); // as RVT rounds: ties follow the last bit
            const auto up = static_cast<int>(std::nearbyint(d * std::sin(angle)));
            // numpy's vectorized cosine of 300 degrees is a half exactly; the C library's is not.
            const double cosine = a == 300 ? 0.5 : std::cos(angle);
            const auto left = static_cast<int>(std::nearbyint(d * cosine));
            looks.push_back({-up * stride - left, static_cast<float>((2.0 * d + rows.step) / d)});
        }
    return looks;
}

std::vector<Look> places_between(const Dominance& rows, int directions, std::ptrdiff_t stride) {
    std::vector<Look> looks;
    for (int d = rows.least; d <= rows.most; d += rows.step)
        for (int k = 0; k < directions; ++k) {
            const double azimuth = (k + 0.5) * 2 * std::numbers::pi / directions;
            const double x = d * std::sin(azimuth), y = -d * std::cos(azimuth);
            const double column = std::floor(x), row = std::floor(y);
            looks.push_back({static_cast<std::ptrdiff_t>(row) * stride + static_cast<std::ptrdiff_t>(column),
                             static_cast<float>((2.0 * d + rows.step) / d), static_cast<float>(x - column),
                             static_cast<float>(y - row)});
        }
    return looks;
}

float between(const float* corner, std::ptrdiff_t stride, const Look& look) {
    const float north = corner[0] + look.x * (corner[1] - corner[0]);
    const float south = corner[stride] + look.x * (corner[stride + 1] - corner[stride]);
    return north + look.y * (south - north);
}

} // namespace

cv::Mat1f dominance_of(const HeightField& field, const Settings& settings, cv::Range rows) {
    const Dominance& radii = settings.dominance;
    const bool exact = settings.profile == Profile::exact;
    const Padded padded(field.z, radii.most + 2, exact ? Border::nothing : Border::repeated,
                        static_cast<float>(settings.exaggeration), 1);
    const std::ptrdiff_t stride = padded.stride();
    const std::vector<Look> looks =
        exact ? places_between(radii, settings.directions, stride) : nearest_cells(radii, stride);
    const auto observer = static_cast<float>(radii.observer);
    cv::Mat1f dominance(rows.size(), field.z.cols);
    tbb::parallel_for(rows.start, rows.end, [&](int r) {
        const int columns = field.z.cols;
        std::vector<double> sums(static_cast<std::size_t>(columns)), most(static_cast<std::size_t>(columns));
        const float* z = padded.at(r, 0);
        for (const Look& look : looks)
            for (int c = 0; c < columns; ++c) {
                const float there = exact ? between(z + c + look.at, stride, look) : z[c + look.at];
                // RVT adds the observer first.
                const float above = exact ? (z[c] - there) + observer : (z[c] + observer) - there;
                // Without data: nothing is added; RVT's divisor stays, ours does not count it.
                sums[static_cast<std::size_t>(c)] += above > 0 ? above * look.weight : 0;
                most[static_cast<std::size_t>(c)] += exact && std::isnan(there) ? 0 : observer * look.weight;
            }
        for (int c = 0; c < columns; ++c) {
            const double sum = sums[static_cast<std::size_t>(c)], whole = most[static_cast<std::size_t>(c)];
            // Where nothing is known around a cell, it is as high as that.
            dominance(r - rows.start, c) = std::isnan(z[c]) ? z[c]
                                           : whole == 0     ? 1.0F
                                                            : static_cast<float>(sum / whole);
        }
    });
    return dominance;
}

} // namespace scanshade::horizon
