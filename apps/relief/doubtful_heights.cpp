#include "apps/relief/doubtful_heights.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace scanshade::relief {

namespace {

/// Deeper than any sea but the trenches, and exact: no survey measures them.
constexpr std::array sentinels{-9999.0, -32767.0, -32768.0, -99999.0};
/// Land that comes down to 0 has cells between 0 and this.
constexpr double gap = 20;

} // namespace

void DoubtfulHeights::add(const cv::Mat1f& z, double base) {
    const auto zero = static_cast<float>(-base), least = static_cast<float>(sentinels.front() - base);
    for (int r = 0; r < z.rows; ++r) {
        const float* row = z[r];
        int zeros = 0, known = 0, low = 0;
        float nearest = 1e30F;
        for (int c = 0; c < z.cols; ++c) {
            const float from_zero = std::abs(row[c] - zero);
            zeros += from_zero == 0;
            known += row[c] == row[c];
            low += row[c] <= least;
            nearest = from_zero > 0 && from_zero < nearest ? from_zero : nearest;
        }
        zeros_ += zeros, others_ += known - zeros;
        nearest_to_zero_ = std::min(nearest_to_zero_, static_cast<double>(nearest));
        for (int c = 0; low > 0 && c < z.cols; ++c)
            if (const double height = row[c] + base; std::ranges::find(sentinels, height) != sentinels.end())
                ++sentinels_[height];
    }
}

std::vector<std::string> DoubtfulHeights::notes() const {
    std::vector<std::string> notes;
    const auto add = [&](std::int64_t cells, double height, const std::string& why) {
        notes.push_back(
            fmt::format("{} cells have a height of {:g}{}: probably no data that the file does not declare. "
                        "Cells around them are wrong. Declare it (`gdal_edit.py -a_nodata {:g}`), or use NaN.",
                        cells, height, why, height));
    };
    for (const auto& [height, cells] : sentinels_)
        add(cells, height, "");
    if (zeros_ > 0 && others_ > 0 && nearest_to_zero_ > gap)
        add(zeros_, 0, fmt::format(", all others are {:.4g} from it or more", nearest_to_zero_));
    return notes;
}

} // namespace scanshade::relief
