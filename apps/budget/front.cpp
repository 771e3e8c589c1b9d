#include "apps/budget/front.h"

#include "front.inc"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

constexpr std::array sensor_classes{SensorClass::clean, SensorClass::structured_light, SensorClass::time_of_flight};

bool beats(const BenchmarkPoint& a, const BenchmarkPoint& b) {
    return a.ns_per_pixel <= b.ns_per_pixel && a.rms <= b.rms && (a.ns_per_pixel < b.ns_per_pixel || a.rms < b.rms);
}
bool equal(const BenchmarkPoint& a, const BenchmarkPoint& b) {
    return a.ns_per_pixel == b.ns_per_pixel && a.rms == b.rms;
}
bool finite(const BenchmarkPoint& point) { return std::isfinite(point.ns_per_pixel) && std::isfinite(point.rms); }

json to_json(const Configuration& configuration) {
    json settings = json::object();
    for (const auto& [name, value] : configuration.settings)
        settings[name] = value;
    return {{"method", configuration.method}, {"name", configuration.name}, {"settings", settings}};
}

Configuration configuration_from(const json& text) {
    Configuration configuration{text.at("method"), text.at("name"), {}};
    for (const auto& [name, value] : text.at("settings").items())
        configuration.settings.emplace_back(name, value.get<std::string>());
    return configuration;
}

json to_json(const std::vector<BenchmarkPoint>& points) {
    json list = json::array();
    for (const BenchmarkPoint& point : points) {
        json& row = list.emplace_back(to_json(point.configuration));
        row["ns_per_pixel"] = point.ns_per_pixel;
        row["rms"] = point.rms;
    }
    return list;
}

BenchmarkPoint point_from(const json& text) {
    BenchmarkPoint point{configuration_from(text), text.at("ns_per_pixel"), text.at("rms")};
    if (!(point.ns_per_pixel > 0 && point.rms >= 0))
        throw Error(fmt::format("{}: a time above zero and an error of zero or more expected",
                                point.configuration.full_name()));
    return point;
}

json to_json(const SequenceGain& gain) {
    json text{{"made_by", gain.made_by}};
    text.update(to_json(gain.configuration));
    text["alone_rms"] = gain.alone_rms;
    text["together_rms"] = gain.together_rms;
    if (gain.times_as_long > 0)
        text["times_as_long"] = gain.times_as_long;
    return text;
}

SequenceGain gain_from(const json& text) {
    return {text.at("made_by"), configuration_from(text), text.at("alone_rms"), text.at("together_rms"),
            text.value("times_as_long", 0.0)};
}

} // namespace

std::vector<bool> on_pareto_front(const std::vector<BenchmarkPoint>& points) {
    std::vector<bool> front(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        front[i] = finite(points[i]);
        for (std::size_t j = 0; j < points.size() && front[i]; ++j)
            if (finite(points[j]) && (beats(points[j], points[i]) || (j < i && equal(points[j], points[i]))))
                front[i] = false;
    }
    return front;
}

json to_json(const ParetoFront& front) {
    json text{{"device", front.device}};
    for (const auto& [sensor, points] : front.points) {
        const auto made_by = front.made_by.find(sensor);
        json& own = text[std::string(name_of(sensor))];
        own = {{"made_by", made_by == front.made_by.end() ? "" : made_by->second}, {"points", to_json(points)}};
        if (const auto others = front.others.find(sensor); others != front.others.end())
            own["others"] = to_json(others->second);
        if (const auto gain = front.sequences.find(sensor); gain != front.sequences.end())
            own["sequence"] = to_json(gain->second);
    }
    return text;
}

ParetoFront front_from(const json& text, const std::string& origin) {
    return reading_json(origin, [&] {
        ParetoFront front{text.at("device"), {}, {}, {}, {}};
        for (const SensorClass sensor : sensor_classes)
            if (const auto own = text.find(name_of(sensor)); own != text.end()) {
                front.made_by[sensor] = own->at("made_by");
                for (const json& point : own->at("points"))
                    front.points[sensor].push_back(point_from(point));
                if (own->contains("others"))
                    for (const json& point : own->at("others"))
                        front.others[sensor].push_back(point_from(point));
                if (own->contains("sequence"))
                    front.sequences[sensor] = gain_from(own->at("sequence"));
            }
        if (front.points.empty())
            throw Error("no points of any sensor class (clean, structured light, time of flight)");
        for (auto& [sensor, points] : front.points)
            std::ranges::stable_sort(points, {}, &BenchmarkPoint::ns_per_pixel);
        return front;
    });
}

void ParetoFront::replace_with(const ParetoFront& other) {
    if (device != other.device)
        throw Error(
            fmt::format("the Pareto front was measured on {}, this one on {}: times of two devices do not compare",
                        device, other.device));
    for (const auto& [sensor, own] : other.points) {
        points[sensor] = own;
        made_by[sensor] = other.made_by.at(sensor);
        others.erase(sensor);
        if (const auto theirs = other.others.find(sensor); theirs != other.others.end())
            others[sensor] = theirs->second;
    }
}

const ParetoFront& shipped_front() {
    static const ParetoFront front = front_from(parsed_json(shipped_front_text), "apps/budget/front.json");
    return front;
}

} // namespace scanshade
