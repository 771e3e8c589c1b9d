// Measured numbers as one HTML file that needs no other file: SVG plots, tables, embedded pictures.
#pragma once

#include "apps/page/text.h"

#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::page {

/// One measured point. Pointing at it shows `label`; `marked` points have a ring.
struct Point {
    double x = 0, y = 0;
    std::string label = {};
    bool marked = false;
};

/// Points of one colour, joined by a line in their order, or dots alone.
struct Series {
    std::string name;
    std::vector<Point> points;
    bool joined = true;
};

/// Axes and what is drawn in them. Points with a coordinate that is not finite (or, on a logarithmic axis, not
/// positive) are left out.
struct Plot {
    std::string title, x_label, y_label;
    std::vector<Series> series;
    bool log_x = false;
    bool y_from_zero = true;
    std::vector<std::string> categories = {}; ///< names of the positions 0, 1, 2 ... in place of a numeric x axis
};

/// Tick positions of even, round steps (1, 2 or 5 times a power of ten) that lie in [low, high], about `wanted` of
/// them.
[[nodiscard]] std::vector<double> round_ticks(double low, double high, int wanted);

[[nodiscard]] std::string svg(const Plot& plot);
/// The plot as a file of its own, on white.
[[nodiscard]] std::string svg_file(const Plot& plot);
/// Cells of the first column are aligned left, others right. `marked` rows (by index) stand out.
[[nodiscard]] std::string table(const std::vector<std::string>& heads,
                                const std::vector<std::vector<std::string>>& rows,
                                const std::vector<bool>& marked = {});
/// The picture inside the page, as PNG, made smaller where it is wider than the page shows it.
[[nodiscard]] std::string figure(const cv::Mat3b& picture, std::string_view caption);
[[nodiscard]] std::string paragraph(std::string_view text);

struct Section {
    std::string heading, html;
};
/// A whole document: heading, sections, the style of all of it.
[[nodiscard]] std::string document(std::string_view title, const std::vector<Section>& sections);

} // namespace scanshade::page
