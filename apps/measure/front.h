// The speed-error front: which configurations nothing beats in both, and the measured table of them that budgets read.
#pragma once

#include "apps/json.h"
#include "apps/measure/trial.h"

#include <map>

namespace scanshade {

/// What a configuration costs and how far it is from truth, on depth of one sensor class.
struct Priced {
    Configuration configuration;
    double ns_per_pixel = 0; ///< on the device, transfers left out, plane fits included
    double rms = 0;          ///< to truth

    /// Expected for an image of so many pixels on the device it was measured on.
    [[nodiscard]] double ms(double pixels) const { return ns_per_pixel * pixels * 1e-6; }
};

/// Whether each point is on the front: none other is at least as fast and as accurate, and better in one of the two. Of
/// equal points the first one counts. Points that are not finite are never on it.
[[nodiscard]] std::vector<bool> on_front(const std::vector<Priced>& points);

/// What looking at a recording's frames together was measured to bring.
struct SequenceGain {
    std::string made_by;
    Configuration configuration;
    double alone_rms = 0, together_rms = 0;
    double times_as_long = 0; ///< 0 = not measured
};

/// The front of each sensor class, cheapest first, and what it was measured with.
struct Front {
    std::string device;
    std::map<SensorClass, std::string> made_by;
    std::map<SensorClass, std::vector<Priced>> points;
    std::map<SensorClass, std::vector<Priced>> others; ///< measured along with the front, but not on it
    std::map<SensorClass, SequenceGain> sequences;     ///< measured apart, on recordings

    /// Takes over what `other` has of its classes. Throws Error where it was measured on another device.
    void replace_with(const Front& other);
};

/// The front's JSON: {"device", "clean": {"made_by", "points": [{"method", "name", "settings": {...}, "ns_per_pixel",
/// "rms"}], "others": [...], "sequence": {"made_by", "method", "name", "settings", "alone_rms", "together_rms",
/// "times_as_long"}}, "structured light": ...}. "others" and "sequence" may be missing.
[[nodiscard]] json to_json(const Front& front);
/// Throws Error naming `origin` and what was expected there.
[[nodiscard]] Front front_from(const json& text, const std::string& origin);

/// The one this program was built with (apps/measure/front.json, made by `bench --front`).
[[nodiscard]] const Front& shipped_front();

} // namespace scanshade
