#include "apps/budget/bench_results.h"
#include "apps/csv.h"

#include "apps/compare/error_figures.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>
#include <tbb/parallel_for.h>
#include <tbb/parallel_for_each.h>

namespace scanshade {
namespace {

std::string rms_text(double rms) { return std::isnan(rms) ? "-" : fmt::format("{:.4f}", rms); }

std::string ms_text(double ms) { return std::isnan(ms) ? "-" : fmt::format("{:.3f}", ms); }

json number(double value) { return std::isfinite(value) ? json(std::round(value * 1e6) / 1e6) : json(); }

std::string csv_row(const std::string& sensor, const std::string& capture, const Measured& m, bool front) {
    const auto known = [](double value) { return std::isnan(value) ? std::string() : fmt::format("{:.6f}", value); };
    const auto ms = [](double value) { return std::isnan(value) ? std::string() : fmt::format("{:.4f}", value); };
    return fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{}\n", sensor, csv_field(capture), m.configuration.method,
                       csv_field(m.configuration.name), ms(median(m.device_ms)), ms(least(m.device_ms)),
                       ms(median(m.wall_ms)), ms(least(m.wall_ms)), front ? "yes" : "", figure_csv(m.difference()),
                       known(m.held_out.rms), csv_field(m.settings), csv_field(m.why));
}

json errors_json(const Measured& m) {
    json text = json::object();
    for (std::size_t by = 0; by < error_by_count; ++by) {
        json& classes = text[std::string(name_of(static_cast<ErrorBy>(by)))] = json::array();
        for (std::size_t i = 0; i < m.errors[by].names().size(); ++i) {
            classes.push_back({{"class", m.errors[by].names()[i]},
                               {"pixels", m.errors[by].pixels(i)},
                               {"rms", number(m.errors[by].rms(i))},
                               {"bias", number(m.errors[by].bias(i))}});
            if (by == place && !m.held_out.rms_by_place.empty())
                classes.back()["held_out_rms"] = number(m.held_out.rms_by_place[i]);
        }
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
    text["held_out"] = {{"rms", number(m.held_out.rms)}, {"bias", number(m.held_out.bias)}};
    if (!m.picture.empty())
        text["picture"] = m.picture;
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
    case place:
        return "place";
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
    append(places, other.places);
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

namespace {

/// Sums of squares and of differences over any number of pairs, with a curve of their own each.
class CurvedErrors {
  public:
    void add(const PairSums& pairs, const ToneCurve& curve) {
        if (pairs.count() == 0)
            return;
        const auto n = static_cast<double>(pairs.count());
        n_ += n;
        squares_ += n * std::pow(pairs.rms(curve), 2);
        apart_ += n * pairs.bias(curve);
    }
    [[nodiscard]] double rms() const { return std::sqrt(squares_ / n_); } // NaN without pairs
    [[nodiscard]] double bias() const { return apart_ / n_; }

  private:
    double n_ = 0, squares_ = 0, apart_ = 0;
};

/// The errors of rows of captures, with one curve for each of them.
HeldOut held_out(const std::vector<const Measured*>& rows, const std::vector<ToneCurve>& curves) {
    HeldOut result;
    CurvedErrors all;
    std::array<CurvedErrors, place_count> by_place;
    for (std::size_t k = 0; k < rows.size(); ++k) {
        all.add(rows[k]->pairs, curves[k]);
        for (const PlacePairs& pairs : rows[k]->places)
            for (std::size_t p = 0; p < place_count; ++p)
                by_place[p].add(pairs[p], curves[k]);
    }
    result.curve = curves.front();
    result.rms = all.rms();
    result.bias = all.bias();
    for (const CurvedErrors& errors : by_place)
        result.rms_by_place.push_back(errors.rms());
    return result;
}

/// Fits configuration i's curve to all captures but one, for each of them.
void leave_each_out(BenchGroup& group, const std::vector<BenchCapture*>& captures, std::size_t i) {
    std::vector<const Measured*> rows;
    std::vector<ToneCurve> curves;
    for (BenchCapture* capture : captures) {
        PairSums others;
        for (const BenchCapture* other : captures)
            if (other != capture)
                others.add(other->measured[i].pairs);
        Measured& own = capture->measured[i];
        if (others.count() == 0 || own.pairs.count() == 0)
            continue;
        curves.push_back(others.best_curve());
        rows.push_back(&own);
        own.held_out = held_out({&own}, {curves.back()});
    }
    if (!rows.empty())
        group.measured[i].held_out = held_out(rows, curves);
}

} // namespace

std::vector<BenchGroup> grouped(BenchReport& report) {
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
        std::vector<BenchCapture*> captures;
        for (BenchCapture& capture : report.captures)
            if (capture.sensor == group.sensor)
                captures.push_back(&capture);
        tbb::parallel_for(std::size_t{0}, group.measured.size(),
                          [&](std::size_t i) { leave_each_out(group, captures, i); });
        std::vector<BenchmarkPoint> points;
        std::ranges::transform(group.measured, std::back_inserter(points), benchmark_point);
        group.on_front = on_pareto_front(points);
    }
    return groups;
}

std::string bench_table(const BenchReport& report) {
    std::string text;
    for (const BenchGroup& group : report.groups) {
        text += fmt::format("{}, {} captures\n{:<34}{:>12}{:>12}{:>12}{:>9}{:>9}{:>9}{:>9}{:>9}  front\n",
                            name_of(group.sensor), group.captures.size(), "configuration", "device ms", "least",
                            "wall ms", "RMSE", "calib.", "others'", "bias", "SSIM");
        for (std::size_t i = 0; i < group.measured.size(); ++i) {
            const Measured& m = group.measured[i];
            const Difference d = m.difference();
            text += fmt::format("{:<34}{:>12}{:>12}{:>12}{:>9.4f}{:>9.4f}{:>9}{:>9.4f}{:>9.4f}  {}{}\n",
                                m.configuration.full_name(), ms_text(median(m.device_ms)), ms_text(least(m.device_ms)),
                                ms_text(median(m.wall_ms)), d.rms, d.calibrated_rms, rms_text(m.held_out.rms), d.bias,
                                d.ssim, group.on_front[i] ? "*" : "", m.why.empty() ? "" : "failed: " + m.why);
        }
        text += "\n";
    }
    return text;
}

std::string bench_csv(const BenchReport& report) {
    std::string text =
        "sensor,capture,method,configuration,device_ms_median,device_ms_least,wall_ms_median,wall_ms_least,"
        "front," +
        figure_csv_heads() + ",held_out_rms,settings,why\n";
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
    json text{{"program", "scanshade"},          {"version", report.version},
              {"command_line", report.command},  {"date", report.date},
              {"device", report.device},         {"driver", report.driver},
              {"processors", report.processors}, {"rounds", report.rounds},
              {"groups", json::array()},         {"captures", json::array()}};
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
        for (const Measured& m : capture.measured) {
            rows.push_back(measured_json(m));
            if (std::isfinite(m.held_out.rms))
                rows.back()["held_out"].update(
                    {{"strength", number(m.held_out.curve.strength)}, {"power", number(m.held_out.curve.power)}});
        }
        text["captures"].push_back({{"name", capture.name},
                                    {"path", capture.path},
                                    {"sensor", name_of(capture.sensor)},
                                    {"depth_noise", capture.noise},
                                    {"reference", capture.reference},
                                    {"radius_m", capture.radius_m},
                                    {"size", {capture.size.width, capture.size.height}},
                                    {"frames", capture.frames},
                                    {"picture", capture.picture},
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
