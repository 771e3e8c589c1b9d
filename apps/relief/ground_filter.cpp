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

} // namespace

cv::Mat1f opened_ground(const cv::Mat1f& lowest, double cell_m, double window_m) {
    constexpr double steepest = 1.0; // of terrain within a window
    constexpr double most_step_m = 2.5;
    cv::Mat1f surface = without_gaps(lowest), ground = surface.clone();
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
