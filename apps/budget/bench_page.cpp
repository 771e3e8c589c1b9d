// The bench's page: speed against error, where the errors are, pictures of them, and every setting.
#include "apps/budget/bench_results.h"
#include "apps/page/document.h"
#include "apps/picture.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

std::string heading_of(const BenchGroup& group) {
    return fmt::format("{} depth ({} {})", name_of(group.sensor), group.captures.size(),
                       group.captures.size() == 1 ? "capture" : "captures");
}

// ---------------------------------------------------------------------------------------------------- plots of speed

/// One series per method, its configurations from fast to slow. The Pareto front is ringed.
page::Plot speed_plot(const BenchGroup& group, bool wall) {
    page::Plot plot{fmt::format("Speed against error, {} depth", name_of(group.sensor)),
                    wall ? "milliseconds per frame, transfers included (median)"
                         : "device milliseconds per frame (median)",
                    "RMSE to the reference",
                    {},
                    true};
    for (std::size_t i = 0; i < group.measured.size(); ++i) {
        const Measured& m = group.measured[i];
        auto series = std::ranges::find(plot.series, m.configuration.method, &page::Series::name);
        if (series == plot.series.end()) {
            plot.series.push_back({m.configuration.method, {}, false});
            series = plot.series.end() - 1;
        }
        const double ms = median(wall ? m.wall_ms : m.device_ms), rms = m.difference().rms;
        series->points.push_back({ms, rms,
                                  fmt::format("{}: {:.3f} ms, RMSE {:.4f}", m.configuration.full_name(), ms, rms),
                                  !wall && group.on_front[i]});
    }
    return plot;
}

// ---------------------------------------------------------------------------------------------------- where errors are

/// Each method's most accurate configuration, most accurate first. Plots of errors show these.
std::vector<std::size_t> best_of_each_method(const BenchGroup& group) {
    std::vector<std::size_t> best;
    const auto rms = [&](std::size_t i) { return group.measured[i].difference().rms; };
    for (std::size_t i = 0; i < group.measured.size(); ++i) {
        if (!std::isfinite(rms(i)))
            continue;
        const auto same = std::ranges::find_if(best, [&](std::size_t j) {
            return group.measured[j].configuration.method == group.measured[i].configuration.method;
        });
        if (same == best.end())
            best.push_back(i);
        else if (rms(i) < rms(*same))
            *same = i;
    }
    std::ranges::stable_sort(best, {}, rms);
    return best;
}

page::Plot plot_by_capture(const BenchGroup& group, const std::vector<std::size_t>& shown) {
    page::Plot plot{"Error by capture", "", "RMSE to the reference", {}};
    for (const BenchCapture* capture : group.captures)
        plot.categories.push_back(capture->name);
    for (const std::size_t i : shown) {
        page::Series series{group.measured[i].configuration.full_name(), {}};
        for (std::size_t k = 0; k < group.captures.size(); ++k) {
            const double rms = group.captures[k]->measured[i].difference().rms;
            series.points.push_back({static_cast<double>(k), rms, fmt::format("{}: {:.4f}", series.name, rms)});
        }
        plot.series.push_back(series);
    }
    return plot;
}

page::Plot plot_by_class(const BenchGroup& group, const std::vector<std::size_t>& shown, ErrorBy by) {
    page::Plot plot{fmt::format("Error by {}", name_of(by)), std::string(name_of(by)), "RMSE to the reference", {}};
    if (shown.empty())
        return plot;
    const ErrorByClass& first = group.measured[shown.front()].errors[by];
    std::vector<std::size_t> filled;
    for (std::size_t i = 0; i < first.names().size(); ++i)
        if (first.pixels(i) > 0) {
            plot.categories.push_back(first.names()[i]);
            filled.push_back(i);
        }
    for (const std::size_t i : shown) {
        const Measured& m = group.measured[i];
        page::Series series{m.configuration.full_name(), {}};
        for (std::size_t k = 0; k < filled.size(); ++k) {
            const double rms = m.errors[by].rms(filled[k]), pixels = m.errors[by].pixels(filled[k]);
            series.points.push_back(
                {static_cast<double>(k), rms, fmt::format("{}: {:.4f} over {:.0f} pixels", series.name, rms, pixels)});
        }
        plot.series.push_back(series);
    }
    return plot;
}

// ---------------------------------------------------------------------------------------------------- tables, pictures

std::string figures_table(const BenchGroup& group) {
    std::vector<std::vector<std::string>> rows;
    const auto fixed = [](double value, int digits) {
        return std::isnan(value) ? std::string("-") : fmt::format("{:.{}f}", value, digits);
    };
    for (const Measured& m : group.measured) {
        const Difference d = m.difference();
        rows.push_back({m.configuration.full_name() + (m.why.empty() ? "" : " (failed: " + m.why + ")"),
                        fixed(median(m.device_ms), 3), fixed(least(m.device_ms), 3), fixed(median(m.wall_ms), 2),
                        fixed(d.rms, 4), fixed(d.calibrated_rms, 4), fixed(m.held_out.rms, 4), fixed(d.mae, 4),
                        fixed(d.bias, 4), fixed(d.percentile_95, 3), fixed(d.worst, 3), fixed(d.ssim, 3),
                        fixed(d.correlation, 3)});
    }
    return page::table({"configuration", "device ms", "least", "wall ms", "RMSE", "calibrated", "others' curve", "MAE",
                        "bias", "95 %", "worst", "SSIM", "corr."},
                       rows, group.on_front);
}

std::string pictures(const BenchGroup& group, const std::vector<std::size_t>& shown) {
    constexpr double scale = 0.5;
    std::string html = page::paragraph(
        "First frame of each capture. Differences: blue is too dark, red too bright, white right; full colour at 0.5.");
    for (const BenchCapture* capture : group.captures) {
        html += page::figure(visibility_picture(capture->truth), fmt::format("{}: reference", capture->name));
        for (const std::size_t i : shown) {
            const cv::Mat1f& map = capture->visibilities[i];
            if (map.empty())
                continue;
            cv::Mat1f apart;
            cv::subtract(map, capture->truth, apart);
            html += page::figure(difference_picture(apart, scale),
                                 fmt::format("{}: {}, RMSE {:.4f}", capture->name,
                                             capture->measured[i].configuration.full_name(),
                                             capture->measured[i].images.front().rms));
        }
        html += "<br>\n";
    }
    return html;
}

std::string captures_table(const BenchReport& report) {
    std::vector<std::vector<std::string>> rows;
    for (const BenchCapture& c : report.captures)
        rows.push_back({c.name, std::string(name_of(c.sensor)), c.noise,
                        fmt::format("{}x{}", c.size.width, c.size.height), fmt::format("{}", c.frames.size()),
                        fmt::format("{:g} m", c.radius_m), c.reference, c.path});
    return page::table({"capture", "sensor", "depth noise", "size", "frames", "radius", "reference", "path"}, rows);
}

std::string settings_table(const BenchReport& report) {
    std::vector<std::vector<std::string>> rows;
    for (const Measured& m : report.captures.front().measured)
        rows.push_back({m.configuration.full_name(), m.settings});
    return page::paragraph("As used on the first capture; elsewhere the radius is the capture's.") +
           page::table({"configuration", "settings"}, rows);
}

} // namespace

std::string bench_plot(const BenchGroup& group) { return page::svg_file(speed_plot(group, false)); }

std::string bench_page(const BenchReport& report) {
    std::vector<page::Section> sections;
    sections.push_back(
        {"What was measured", page::paragraph(fmt::format("{} ({}), {}, version {}: {}", report.device, report.driver,
                                                          report.date, report.version, report.command)) +
                                  page::paragraph(fmt::format("Configurations were timed in {} rounds over all frames, "
                                                              "in turns, so that a busy minute slows all alike. "
                                                              "Device milliseconds are the device's own time stamps "
                                                              "of all passes, plane fits included, transfers left out.",
                                                              report.rounds)) +
                                  captures_table(report)});
    for (const BenchGroup& group : report.groups) {
        const std::vector<std::size_t> shown = best_of_each_method(group);
        std::string where = page::svg(plot_by_capture(group, shown));
        for (std::size_t by = 0; by < error_by_count; ++by)
            where += page::svg(plot_by_class(group, shown, static_cast<ErrorBy>(by)));
        sections.push_back(
            {heading_of(group), page::paragraph("The Pareto front is ringed, and marked in the table. No "
                                                "other configuration is both as fast and as accurate.") +
                                    page::svg(speed_plot(group, false)) + page::svg(speed_plot(group, true)) +
                                    figures_table(group)});
        sections.push_back({"Where the errors are: " + heading_of(group),
                            page::paragraph("Each method's most accurate configuration.") + where});
        sections.push_back({"Pictures: " + heading_of(group), pictures(group, shown)});
    }
    sections.push_back({"Settings", settings_table(report)});
    return page::document("Ambient occlusion: speed against error", sections);
}

} // namespace scanshade
