#include "apps/relief/ground_filter.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace scanshade::relief {

namespace {

/// Cells without a height get that of the nearest one with it, row by row from both sides and then by columns.
cv::Mat1f without_gaps(const cv::Mat1f& lowest) {
    cv::Mat1b gaps(lowest.size());
    for (int r = 0; r < lowest.rows; ++r)
        for (int c = 0; c < lowest.cols; ++c)
            gaps(r, c) = std::isnan(lowest(r, c)) ? 255 : 0;
    cv::Mat1f distance;
    cv::Mat1i label;
    cv::distanceTransform(gaps, distance, label, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
    std::vector<float> height_of; // by label
    for (int r = 0; r < lowest.rows; ++r)
        for (int c = 0; c < lowest.cols; ++c)
            if (gaps(r, c) == 0) {
                height_of.resize(std::max(height_of.size(), static_cast<std::size_t>(label(r, c)) + 1));
                height_of[static_cast<std::size_t>(label(r, c))] = lowest(r, c);
            }
    cv::Mat1f filled = lowest.clone();
    for (int r = 0; r < lowest.rows; ++r)
        for (int c = 0; c < lowest.cols; ++c)
            if (gaps(r, c) != 0)
                filled(r, c) = height_of[static_cast<std::size_t>(label(r, c))];
    return filled;
}

/// Heights with at most two of the 24 cells around them as low, give or take false_depth_m(), become NaN: a ditch or
/// the foot of a cliff goes on, a false return does not.
cv::Mat1f without_false_returns(const cv::Mat1f& lowest) {
    constexpr int reach = 2, most_as_low = 2, least_known = 8;
    cv::Mat1f kept = lowest.clone();
    for (int r = 0; r < lowest.rows; ++r)
        for (int c = 0; c < lowest.cols; ++c) {
            const cv::Rect around =
                cv::Rect(c - reach, r - reach, 2 * reach + 1, 2 * reach + 1) & cv::Rect(0, 0, lowest.cols, lowest.rows);
            int known = -1, as_low = -1; // itself
            for (int y = around.y; y < around.br().y; ++y)
                for (int x = around.x; x < around.br().x; ++x) {
                    known += !std::isnan(lowest(y, x));
                    as_low += lowest(y, x) < static_cast<double>(lowest(r, c)) + false_depth_m();
                }
            if (known >= least_known && as_low <= most_as_low)
                kept(r, c) = std::nanf("");
        }
    return kept;
}

} // namespace

cv::Mat1f opened_ground(const cv::Mat1f& lowest, double cell_m, double window_m) {
    constexpr double steepest = 1.0; // of terrain within a window
    constexpr double most_step_m = 2.5;
    cv::Mat1f surface = without_gaps(without_false_returns(lowest)), ground = surface.clone();
    const int last = std::max(1, static_cast<int>(window_m / cell_m / 2));
    for (int half = 1, before = 0;; half = std::min(2 * half, last)) {
        cv::Mat1f opened;
        const cv::Mat kernel = cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * half + 1, 2 * half + 1});
        cv::morphologyEx(surface, opened, cv::MORPH_OPEN, kernel);
        const double step = std::min(ground_tolerance_m() + steepest * (half - before) * cell_m, most_step_m);
        for (int r = 0; r < ground.rows; ++r)
            for (int c = 0; c < ground.cols; ++c)
                if (surface(r, c) - opened(r, c) > step)
                    ground(r, c) = std::min(ground(r, c), opened(r, c)); // taller than terrain can be here
        surface = cv::min(ground, surface);
        before = half;
        if (half == last)
            return ground;
    }
}

} // namespace scanshade::relief
