// The Pareto front of time against error, and the measured table of it that budgets read.
#pragma once

#include "apps/budget/trial.h"
#include "apps/json.h"

#include <map>

namespace scanshade {

/// Time and error of a configuration, on depth of one sensor class.
struct BenchmarkPoint {
    Configuration configuration;
    double ns_per_pixel = 0; ///< on the device, transfers left out, plane fits included
    double rms = 0;          ///< to truth

    /// Expected milliseconds for an image of so many pixels, on the device of the measurement.
    [[nodiscard]] double ms(double pixels) const { return ns_per_pixel * pixels * 1e-6; }
};

/// Whether each point is on the Pareto front: no other point is at least as fast and as accurate, and better in one of
/// the two. Of equal points the first one counts. Points that are not finite are never on it.
[[nodiscard]] std::vector<bool> on_pareto_front(const std::vector<BenchmarkPoint>& points);

/// The measured gain of computing a recording's frames together.
struct SequenceGain {
    std::string made_by;
    Configuration configuration;
    double alone_rms = 0, together_rms = 0;
    double times_as_long = 0; ///< 0 = not measured
};

/// The Pareto front of each sensor class, cheapest first, and what it was measured with.
struct ParetoFront {
    std::string device;
    std::map<SensorClass, std::string> made_by;
    std::map<SensorClass, std::vector<BenchmarkPoint>> points;
    std::map<SensorClass, std::vector<BenchmarkPoint>> others; ///< measured too, but not on the front
    std::map<SensorClass, SequenceGain> sequences;             ///< measured separately, on recordings

    /// Replaces the classes that `other` has. Throws Error where that was measured on another device.
    void replace_with(const ParetoFront& other);
};

/// The front's JSON: {"device", "clean": {"made_by", "points": [{"method", "name", "settings": {...}, "ns_per_pixel",
/// "rms"}], "others": [...], "sequence": {"made_by", "method", "name", "settings", "alone_rms", "together_rms",
/// "times_as_long"}}, "structured light": ...}. "others" and "sequence" may be missing.
[[nodiscard]] json to_json(const ParetoFront& front);
/// Throws Error naming `origin` and what was expected there.
[[nodiscard]] ParetoFront front_from(const json& text, const std::string& origin);

/// The one this program was built with (apps/budget/front.json, made by `bench --front`).
[[nodiscard]] const ParetoFront& shipped_front();

} // namespace scanshade
