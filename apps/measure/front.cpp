#include "apps/measure/front.h"

#include "front.inc"
#include "projection/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

constexpr std::array sensor_classes{SensorClass::clean, SensorClass::structured_light, SensorClass::time_of_flight};

bool beats(const Priced& a, const Priced& b) {
    return a.ns_per_pixel <= b.ns_per_pixel && a.rms <= b.rms && (a.ns_per_pixel < b.ns_per_pixel || a.rms < b.rms);
}
bool equal(const Priced& a, const Priced& b) { return a.ns_per_pixel == b.ns_per_pixel && a.rms == b.rms; }
bool finite(const Priced& point) { return std::isfinite(point.ns_per_pixel) && std::isfinite(point.rms); }

json point_json(const Priced& point) {
    json settings = json::object();
    for (const auto& [name, value] : point.configuration.settings)
        settings[name] = value;
    return {{"method", point.configuration.method},
            {"name", point.configuration.name},
            {"settings", settings},
            {"ns_per_pixel", point.ns_per_pixel},
            {"rms", point.rms}};
}

Priced point_from(const json& text) {
    Priced point{{text.at("method"), text.at("name"), {}}, text.at("ns_per_pixel"), text.at("rms")};
    for (const auto& [name, value] : text.at("settings").items())
        point.configuration.settings.emplace_back(name, value.get<std::string>());
    if (!(point.ns_per_pixel > 0 && point.rms >= 0))
        throw Error(fmt::format("{}: a time above zero and an error of zero or more expected",
                                point.configuration.full_name()));
    return point;
}

} // namespace

std::vector<bool> on_front(const std::vector<Priced>& points) {
    std::vector<bool> front(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        front[i] = finite(points[i]);
        for (std::size_t j = 0; j < points.size() && front[i]; ++j)
            if (finite(points[j]) && (beats(points[j], points[i]) || (j < i && equal(points[j], points[i]))))
                front[i] = false;
    }
    return front;
}

json to_json(const Front& front) {
    json text{{"device", front.device}};
    for (const auto& [sensor, points] : front.points) {
        const auto made_by = front.made_by.find(sensor);
        json& own = text[std::string(name_of(sensor))];
        own = {{"made_by", made_by == front.made_by.end() ? "" : made_by->second}, {"points", json::array()}};
        for (const Priced& point : points)
            own["points"].push_back(point_json(point));
    }
    return text;
}

Front front_from(const json& text, const std::string& origin) {
    return reading_json(origin, [&] {
        Front front{text.at("device"), {}, {}};
        for (const SensorClass sensor : sensor_classes)
            if (const auto own = text.find(name_of(sensor)); own != text.end()) {
                front.made_by[sensor] = own->at("made_by");
                for (const json& point : own->at("points"))
                    front.points[sensor].push_back(point_from(point));
            }
        if (front.points.empty())
            throw Error("no points of any sensor class (clean, structured light, time of flight)");
        for (auto& [sensor, points] : front.points)
            std::ranges::stable_sort(points, {}, &Priced::ns_per_pixel);
        return front;
    });
}

void Front::replace_with(const Front& other) {
    if (device != other.device)
        throw Error(fmt::format("the front was measured on {}, this one on {}: times of two devices do not go together",
                                device, other.device));
    for (const auto& [sensor, own] : other.points) {
        points[sensor] = own;
        made_by[sensor] = other.made_by.at(sensor);
    }
}

const Front& shipped_front() {
    static const Front front = front_from(json::parse(shipped_front_text), "apps/measure/front.json");
    return front;
}

} // namespace scanshade
