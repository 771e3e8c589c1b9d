// Values that both the manifest and `inspect --json` contain.
#include "apps/json.h"

#include "io/shallow_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace scanshade {

json to_json(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    json text{{"fx", fx}, {"fy", fy}, {"cx", cx}, {"cy", cy}, {"width", size.width}, {"height", size.height}};
    if (const Distortion& d = camera.distortion; d.model == LensModel::kannala_brandt)
        text["fisheye"] = coefficients(d);
    else if (d.any())
        text["distortion"] = coefficients(d);
    text["origin"] = camera.origin;
    return text;
}

json to_json(const ColourCamera& colour) {
    json text = to_json(colour.camera);
    const Eigen::Matrix4d matrix = colour.colour_from_depth.matrix();
    for (int row = 0; row < 4; ++row)
        text["colour_from_depth"].push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
    return text;
}

std::string_view name_of(Registration registration) {
    switch (registration) {
    case Registration::yes:
        return "yes";
    case Registration::no:
        return "no";
    case Registration::unknown:
        return "unknown";
    }
    return "";
}

json value_json(const Parameter& row) {
    return std::visit(
        [&]<class Target>(const Target& target) -> json {
            if constexpr (std::is_same_v<Target, float*>)
                return parsed_json(value_text(row)); // the number as typed: 0.1, not 0.10000000149011612
            else if constexpr (std::is_same_v<Target, OneOf> || std::is_same_v<Target, std::optional<double>*>)
                return value_text(row);
            else
                return *target;
        },
        row.value);
}

json parameter_json(const Parameter& row) {
    json one{{"name", row.name}, {"help", row.help}, {"default", value_json(row)}, {"unit", row.unit}};
    if (std::isfinite(row.low))
        one["low"] = row.low;
    if (std::isfinite(row.high))
        one["high"] = row.high;
    if (const std::vector<std::string> choices = choices_of(row); !choices.empty())
        one["choices"] = choices;
    return one;
}

std::size_t count_at(const json& object, const std::string& key) {
    const json& value = object.at(key);
    if (!value.is_number_unsigned())
        throw Error("\"" + key + "\" is no whole number");
    return value.get<std::size_t>();
}

void rethrow_as_error() {
    try {
        throw;
    } catch (const json::exception& failure) {
        throw Error(json_problem(failure.id, failure.what()));
    }
}

json parsed_json(std::string_view text) { return json::parse(text); }

json parsed_or_discarded(std::string_view text) { return json::parse(text, nullptr, false); }

std::string json_line(const json& value) { return value.dump(-1, ' ', false, json::error_handler_t::replace); }

std::string text_of(const json& value) { return value.dump(2, ' ', false, json::error_handler_t::replace); }

} // namespace scanshade
