// The margin round charts: exact Euclidean distances in two sweeps (Felzenszwalb and Huttenlocher, "Distance Transforms
// of Sampled Functions", 2012), cut off where the margin ends.
#include "ao/texture/texture_ao.h"

#include <cmath>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

constexpr int far_away = 1 << 20;

/// Of each texel, how many rows up or down the nearest one of its column has a value; far_away where none is near.
cv::Mat1i rows_away(const cv::Mat1f& values, int margin) {
    cv::Mat1i away(values.size(), far_away);
    constexpr int block = 64; // columns, so that threads stay out of each other's cache lines
    tbb::parallel_for(0, (values.cols + block - 1) / block, [&](int part) {
        const int end = std::min(values.cols, (part + 1) * block);
        for (int y = 0; y < values.rows; ++y)
            for (int x = part * block; x < end; ++x) {
                const int above = y > 0 ? away(y - 1, x) : far_away;
                away(y, x) = !std::isnan(values(y, x)) ? 0 : above < margin ? above + 1 : far_away;
            }
        for (int y = values.rows - 2; y >= 0; --y)
            for (int x = part * block; x < end; ++x) {
                const int below = std::abs(away(y + 1, x)), down = away(y + 1, x) > 0 ? far_away : below;
                if (down < margin && down + 1 < away(y, x))
                    away(y, x) = -(down + 1); // negative: below
            }
    });
    return away;
}

} // namespace

void fill_margin(cv::Mat1f& values, int margin) {
    if (margin <= 0)
        return;
    const cv::Mat1i away = rows_away(values, margin);
    const cv::Mat1f given = values.clone();
    tbb::parallel_for(0, values.rows, [&](int y) {
        struct Parabola {
            int x;
            double from; ///< it is the lowest from here on
        };
        std::vector<Parabola> lowest;
        for (int x = 0; x < values.cols; ++x) {
            if (std::abs(away(y, x)) >= far_away)
                continue;
            const auto square = [](double d) { return d * d; };
            double from = -far_away;
            while (!lowest.empty()) {
                const int other = lowest.back().x;
                from = (square(away(y, x)) + square(x) - square(away(y, other)) - square(other)) / (2.0 * (x - other));
                if (from > lowest.back().from)
                    break;
                lowest.pop_back();
            }
            lowest.push_back({x, lowest.empty() ? -static_cast<double>(far_away) : from});
        }
        std::size_t at = 0;
        for (int x = 0; x < values.cols && !lowest.empty(); ++x) {
            while (at + 1 < lowest.size() && lowest[at + 1].from < x)
                ++at;
            const int column = lowest[at].x, rows = away(y, column);
            if (std::isnan(given(y, x)) && (x - column) * (x - column) + rows * rows <= margin * margin)
                values(y, x) = given(y - rows, column);
        }
    });
}

} // namespace scanshade
