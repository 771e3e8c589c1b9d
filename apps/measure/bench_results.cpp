#include "apps/measure/bench_results.h"
#include "apps/csv.h"

#include "apps/measure/error_figures.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>
#include <tbb/parallel_for_each.h>

namespace scanshade {
namespace {

std::string ms_text(double ms) { return std::isnan(ms) ? "-" : fmt::format("{:.3f}", ms); }

json number(double value) { return std::isfinite(value) ? json(std::round(value * 1e6) / 1e6) : json(); }

std::string csv_row(const std::string& sensor, const std::string& capture, const Measured& m, bool front) {
    const auto ms = [](double value) { return std::isnan(value) ? std::string() : fmt::format("{:.4f}", value); };
    return fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", sensor, csv_field(capture), m.configuration.method,
                       csv_field(m.configuration.name), ms(median(m.device_ms)), ms(least(m.device_ms)),
                       ms(median(m.wall_ms)), ms(least(m.wall_ms)), front ? "yes" : "", figure_csv(m.difference()),
                       csv_field(m.settings), csv_field(m.why));
}

json errors_json(const Measured& m) {
    json text = json::object();
    for (std::size_t by = 0; by < error_by_count; ++by) {
        json& classes = text[std::string(name_of(static_cast<ErrorBy>(by)))] = json::array();
        for (std::size_t i = 0; i < m.errors[by].names().size(); ++i)
            classes.push_back({{"class", m.errors[by].names()[i]},
                               {"pixels", m.errors[by].pixels(i)},
                               {"rms", number(m.errors[by].rms(i))}});
    }
    return text;
}

json measured_json(const Measured& m) {
    json text{{"method", m.configuration.method}, {"name", m.configuration.name}, {"settings", m.settings}};
    if (!m.why.empty())
        text["why"] = m.why;
    text["device_ms"] = {{"median", number(median(m.device_ms))}, {"least", number(least(m.device_ms))}};
    text["wall_ms"] = {{"median", number(median(m.wall_ms))}, {"least", number(least(m.wall_ms))}};
    text["difference"] = to_json(m.difference());
    text["errors"] = errors_json(m);
    return text;
}

/// "scanshade 0.1.0 bench, 2026-11-21: office, staircase; 640x480, 24 frames"
std::string made_by(const BenchReport& report, const BenchGroup& group) {
    std::string names;
    std::size_t frames = 0;
    for (const BenchCapture* capture : group.captures) {
        names += (names.empty() ? "" : ", ") + capture->name;
        frames += capture->frames.size();
    }
    const cv::Size size = group.captures.front()->size;
    return fmt::format("scanshade {} bench, {}: {}; {}x{}, {} frames", report.version, report.date, names, size.width,
                       size.height, frames);
}

} // namespace

std::string_view name_of(ErrorBy by) {
    switch (by) {
    case edge_distance:
        return "distance from depth edges";
    case grazing_angle:
        return "angle to the surface's normal";
    case range:
        return "range";
    case error_by_count:
        break;
    }
    return "";
}

void Measured::add(const Measured& other) {
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    append(images, other.images);
    append(device_ms, other.device_ms);
    append(wall_ms, other.wall_ms);
    append(ns_per_pixel, other.ns_per_pixel);
    pairs.add(other.pairs);
    for (std::size_t by = 0; by < error_by_count; ++by)
        errors[by].add(other.errors[by]);
    if (why.empty())
        why = other.why;
}

double least(const std::vector<double>& values) {
    return values.empty() ? std::numeric_limits<double>::quiet_NaN() : *std::ranges::min_element(values);
}

BenchmarkPoint benchmark_point(const Measured& measured) {
    // A configuration that failed on a capture has no point: its error would be that of the easier captures.
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    const bool whole = measured.why.empty();
    return {measured.configuration, whole ? median(measured.ns_per_pixel) : unknown,
            whole ? measured.difference().rms : unknown};
}

std::vector<BenchGroup> grouped(const BenchReport& report) {
    std::vector<BenchGroup> groups;
    for (const BenchCapture& capture : report.captures) {
        auto group = std::ranges::find(groups, capture.sensor, &BenchGroup::sensor);
        if (group == groups.end()) {
            groups.push_back({capture.sensor, {}, {}, {}});
            group = groups.end() - 1;
        }
        group->captures.push_back(&capture);
        for (std::size_t i = 0; i < capture.measured.size(); ++i)
            if (i < group->measured.size())
                group->measured[i].add(capture.measured[i]);
            else
                group->measured.push_back(capture.measured[i]);
    }
    for (BenchGroup& group : groups) {
        tbb::parallel_for_each(group.measured, [](Measured& m) { m.sum_up(); });
        std::vector<BenchmarkPoint> points;
        std::ranges::transform(group.measured, std::back_inserter(points), benchmark_point);
        group.on_front = on_pareto_front(points);
    }
    return groups;
}

std::string bench_table(const BenchReport& report) {
    std::string text;
    for (const BenchGroup& group : report.groups) {
        text += fmt::format("{}, {} captures\n{:<34}{:>12}{:>12}{:>12}{:>9}{:>9}{:>9}{:>9}  front\n",
                            name_of(group.sensor), group.captures.size(), "configuration", "device ms", "least",
                            "wall ms", "RMSE", "calib.", "bias", "SSIM");
        for (std::size_t i = 0; i < group.measured.size(); ++i) {
            const Measured& m = group.measured[i];
            const Difference d = m.difference();
            text += fmt::format("{:<34}{:>12}{:>12}{:>12}{:>9.4f}{:>9.4f}{:>9.4f}{:>9.4f}  {}{}\n",
                                m.configuration.full_name(), ms_text(median(m.device_ms)), ms_text(least(m.device_ms)),
                                ms_text(median(m.wall_ms)), d.rms, d.calibrated_rms, d.bias, d.ssim,
                                group.on_front[i] ? "*" : "", m.why.empty() ? "" : "failed: " + m.why);
        }
        text += "\n";
    }
    return text;
}

std::string bench_csv(const BenchReport& report) {
    std::string text =
        "sensor,capture,method,configuration,device_ms_median,device_ms_least,wall_ms_median,wall_ms_least,"
        "front," +
        figure_csv_heads() + ",settings,why\n";
    for (const BenchGroup& group : report.groups) {
        const std::string sensor(name_of(group.sensor));
        for (std::size_t i = 0; i < group.measured.size(); ++i)
            text += csv_row(sensor, "all", group.measured[i], group.on_front[i]);
        for (const BenchCapture* capture : group.captures)
            for (const Measured& m : capture->measured)
                text += csv_row(sensor, capture->name, m, false);
    }
    return text;
}

json bench_json(const BenchReport& report) {
    json text{{"program", "scanshade"},  {"version", report.version}, {"command_line", report.command},
              {"date", report.date},     {"device", report.device},   {"driver", report.driver},
              {"rounds", report.rounds}, {"groups", json::array()},   {"captures", json::array()}};
    for (const BenchGroup& group : report.groups) {
        json rows = json::array();
        for (std::size_t i = 0; i < group.measured.size(); ++i) {
            json row = measured_json(group.measured[i]);
            row["front"] = static_cast<bool>(group.on_front[i]);
            rows.push_back(row);
        }
        text["groups"].push_back({{"sensor", name_of(group.sensor)}, {"configurations", rows}});
    }
    for (const BenchCapture& capture : report.captures) {
        json rows = json::array();
        for (const Measured& m : capture.measured)
            rows.push_back(measured_json(m));
        text["captures"].push_back({{"name", capture.name},
                                    {"path", capture.path},
                                    {"sensor", name_of(capture.sensor)},
                                    {"depth_noise", capture.noise},
                                    {"reference", capture.reference},
                                    {"radius_m", capture.radius_m},
                                    {"size", {capture.size.width, capture.size.height}},
                                    {"frames", capture.frames},
                                    {"configurations", rows}});
    }
    return text;
}

ParetoFront front_of(const BenchReport& report) {
    ParetoFront front{report.device, {}, {}, {}, {}};
    for (const BenchGroup& group : report.groups) {
        front.made_by[group.sensor] = made_by(report, group);
        std::vector<BenchmarkPoint>& points = front.points[group.sensor];
        for (std::size_t i = 0; i < group.measured.size(); ++i)
            if (const BenchmarkPoint point = benchmark_point(group.measured[i]); group.on_front[i])
                points.push_back(point);
            else if (std::isfinite(point.rms) && std::isfinite(point.ns_per_pixel))
                front.others[group.sensor].push_back(point);
        std::ranges::stable_sort(points, {}, &BenchmarkPoint::ns_per_pixel);
    }
    return front;
}

} // namespace scanshade
