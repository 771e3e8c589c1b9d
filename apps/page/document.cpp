#include "apps/page/document.h"

#include "apps/page/shell.h"
#include "apps/page/text.h"
#include "io/images/png_output.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace scanshade::page {
namespace {

// ---------------------------------------------------------------------------------------------------- axes

constexpr double width = 900, height = 430, left = 64, right = 290, top = 34,
                 bottom = 62; // px; the legend is on the right

/// Okabe and Ito's palette for all kinds of colour vision, its yellow darkened for white paper.
constexpr std::array<std::string_view, 8> colours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                  "#56b4e9", "#e69f00", "#b8a800", "#444444"};

struct Axis {
    double low = 0, high = 1, from = 0, to = 1; ///< values, and their pixels
    bool log = false;
    [[nodiscard]] double scale(double value) const { return log ? std::log10(value) : value; }
    [[nodiscard]] double at(double value) const {
        return from + (to - from) * (scale(value) - scale(low)) / (scale(high) - scale(low));
    }
};

bool drawn(const Plot& plot, const Point& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && (!plot.log_x || p.x > 0);
}

template <class Use>
void each_point(const Plot& plot, Use&& use) {
    for (const Series& series : plot.series)
        for (const Point& point : series.points)
            if (drawn(plot, point))
                use(point);
}

Axis x_axis(const Plot& plot) {
    Axis axis{1e300, -1e300, left, width - right, plot.log_x};
    each_point(plot, [&](const Point& p) {
        axis.low = std::min(axis.low, p.x);
        axis.high = std::max(axis.high, p.x);
    });
    if (!plot.categories.empty()) {
        axis.low = -0.4;
        axis.high = static_cast<double>(plot.categories.size()) - 0.6;
    } else if (axis.low > axis.high) {
        axis.low = plot.log_x ? 1 : 0;
        axis.high = 10;
    } else if (plot.log_x) {
        axis.low /= 1.3;
        axis.high *= 1.3;
    } else {
        const double margin = axis.high > axis.low ? 0.04 * (axis.high - axis.low) : 0.5;
        axis.low -= margin;
        axis.high += margin;
    }
    return axis;
}

Axis y_axis(const Plot& plot) {
    Axis axis{plot.y_from_zero ? 0.0 : 1e300, plot.y_from_zero ? 0.0 : -1e300, height - bottom, top};
    each_point(plot, [&](const Point& p) {
        axis.low = std::min(axis.low, p.y);
        axis.high = std::max(axis.high, p.y);
    });
    if (axis.low > axis.high)
        axis.low = axis.high = 0;
    const double margin = axis.high > axis.low ? 0.06 * (axis.high - axis.low) : 0.5;
    axis.high += margin;
    if (axis.low != 0)
        axis.low -= margin;
    return axis;
}

/// 1, 2 and 5 of each decade in range; only the decades if that makes more than eight ticks.
std::vector<double> log_ticks(double low, double high) {
    std::vector<double> ticks;
    for (const int steps : {3, 1}) {
        ticks.clear();
        for (int decade = static_cast<int>(std::floor(std::log10(low))); decade <= std::log10(high); ++decade)
            for (int i = 0; i < steps; ++i) {
                const double tick = std::array{1.0, 2.0, 5.0}[static_cast<std::size_t>(i)] * std::pow(10.0, decade);
                if (tick >= low && tick <= high)
                    ticks.push_back(tick);
            }
        if (ticks.size() <= 8)
            break;
    }
    return ticks;
}

// ---------------------------------------------------------------------------------------------------- drawing

std::string line(double x0, double y0, double x1, double y1, std::string_view css) {
    return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" class=\"{}\"/>\n", x0, y0, x1, y1,
                       css);
}

std::string text(double x, double y, std::string_view anchor, std::string_view words, std::string_view more = "") {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" {}>{}</text>\n", x, y, anchor, more,
                       escaped(words));
}

std::string frame(const Plot& plot, const Axis& x, const Axis& y) {
    std::string drawn = text(left, 20, "start", plot.title, "class=\"title\"");
    for (const double tick : round_ticks(y.low, y.high, 6)) {
        drawn += line(left, y.at(tick), width - right, y.at(tick), "grid");
        drawn += text(left - 6, y.at(tick) + 4, "end", fmt::format("{:g}", tick));
    }
    const auto tick_at = [&](double place, const std::string& words) {
        drawn += line(place, height - bottom, place, height - bottom + 4, "axis");
        drawn += text(place, height - bottom + 18, "middle", words);
    };
    for (std::size_t i = 0; i < plot.categories.size(); ++i)
        tick_at(x.at(static_cast<double>(i)), plot.categories[i]);
    if (plot.categories.empty())
        for (const double tick : x.log ? log_ticks(x.low, x.high) : round_ticks(x.low, x.high, 7))
            tick_at(x.at(tick), fmt::format("{:g}", tick));
    drawn += line(left, height - bottom, width - right, height - bottom, "axis");
    drawn += line(left, top, left, height - bottom, "axis");
    drawn += text((left + width - right) / 2, height - 18, "middle", plot.x_label);
    const double middle = (top + height - bottom) / 2;
    return drawn + text(16, middle, "middle", plot.y_label, fmt::format("transform=\"rotate(-90 16 {:.1f})\"", middle));
}

/// Colours are attributes, for files of their own; in a page the style's classes win, which know light and dark.
std::string dot(const Point& p, const Axis& x, const Axis& y, std::size_t series) {
    const std::string ring =
        p.marked ? fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"7\" class=\"ring\"/>\n", x.at(p.x), y.at(p.y))
                 : "";
    return ring + fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.5\" class=\"dot series-{}\" fill=\"{}\">"
                              "<title>{}</title></circle>\n",
                              x.at(p.x), y.at(p.y), series, colours[series], escaped(p.label));
}

std::string drawn_series(const Plot& plot, const Series& series, const Axis& x, const Axis& y, std::size_t number) {
    std::string path, dots;
    for (const Point& p : series.points) {
        if (!drawn(plot, p))
            continue;
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : " L", x.at(p.x), y.at(p.y));
        dots += dot(p, x, y, number);
    }
    if (!series.joined || path.empty())
        return dots;
    return fmt::format("<path d=\"{}\" class=\"line series-{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>\n{}",
                       path, number, colours[number], dots);
}

std::string legend(const Plot& plot) {
    std::string drawn;
    double place = top + 8;
    for (std::size_t i = 0; i < plot.series.size(); ++i, place += 18) {
        drawn += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" class=\"dot series-{}\" fill=\"{}\"/>\n",
                             width - right + 18, place - 4, i % colours.size(), colours[i % colours.size()]);
        drawn += text(width - right + 28, place, "start", plot.series[i].name);
    }
    return drawn;
}

std::string everything(const Plot& plot) {
    const Axis x = x_axis(plot), y = y_axis(plot);
    std::string drawn = frame(plot, x, y);
    for (std::size_t i = 0; i < plot.series.size(); ++i)
        drawn += drawn_series(plot, plot.series[i], x, y, i % colours.size());
    return drawn + legend(plot);
}

constexpr int figure_width = 340; ///< px, as the style has it: a page of fifty pictures stays below some megabytes

/// What a plot looks like as a file of its own, on white.
constexpr std::string_view plot_style = R"css(
svg text { font: 12px system-ui, sans-serif; fill: #333; }
svg .title { font-weight: 600; font-size: 14px; } .grid { stroke: #e4e4e4; } .axis { stroke: #777; }
.ring { fill: none; stroke: #222; stroke-width: 1.2; }
)css";

std::string row(const std::vector<std::string>& cells, std::string_view tag, bool marked) {
    std::string html = marked ? "<tr class=\"marked\">" : "<tr>";
    for (const std::string& cell : cells)
        html += fmt::format("<{0}>{1}</{0}>", tag, escaped(cell));
    return html + "</tr>\n";
}

} // namespace

std::vector<double> round_ticks(double low, double high, int wanted) {
    if (!(high > low) || wanted < 1)
        return {low};
    const double rough = (high - low) / wanted, decade = std::pow(10.0, std::floor(std::log10(rough)));
    double step = 10 * decade;
    for (const double factor : {5.0, 2.0, 1.0})
        if (factor * decade >= 0.75 * rough)
            step = factor * decade;
    std::vector<double> ticks;
    for (auto i = std::llround(std::ceil(low / step - 1e-9)); static_cast<double>(i) * step <= high + 1e-9 * step; ++i)
        ticks.push_back(static_cast<double>(i) * step);
    return ticks;
}

std::string svg(const Plot& plot) {
    return fmt::format(
        "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" aria-label=\"{3}\">\n{2}</svg>\n",
        width, height, everything(plot), escaped(plot.title));
}

std::string svg_file(const Plot& plot) {
    return fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\">\n"
        "<style>{2}</style>\n<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n{3}</svg>\n",
        width, height, plot_style, everything(plot));
}

std::string table(const std::vector<std::string>& heads, const std::vector<std::vector<std::string>>& rows,
                  const std::vector<bool>& marked) {
    std::string html = "<div class=\"wide\"><table>\n<thead>\n" + row(heads, "th", false) + "</thead>\n<tbody>\n";
    for (std::size_t i = 0; i < rows.size(); ++i)
        html += row(rows[i], "td", i < marked.size() && marked[i]);
    return html + "</tbody>\n</table></div>\n";
}

std::string figure(const cv::Mat3b& picture, std::string_view caption) {
    cv::Mat3b shown = picture;
    if (picture.cols > figure_width)
        cv::resize(picture, shown, {figure_width, std::max(1, picture.rows * figure_width / picture.cols)}, 0, 0,
                   cv::INTER_AREA);
    return fmt::format("<figure><img alt=\"\" src=\"data:image/png;base64,{}\"><figcaption>{}</figcaption></figure>\n",
                       base64(encoded_png(shown)), escaped(caption));
}

std::string paragraph(std::string_view text) { return fmt::format("<p>{}</p>\n", escaped(text)); }

std::string document(std::string_view title, const std::vector<Section>& sections) {
    std::string html;
    for (const Section& section : sections)
        html += fmt::format("<h2>{}</h2>\n{}", escaped(section.heading), section.html);
    return document_shell(title, html);
}

} // namespace scanshade::page
