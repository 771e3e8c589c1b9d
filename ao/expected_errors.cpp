#include "ao/expected_errors.h"

#include "projection/base/error.h"

#include "expected_errors.inc"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <optional>
#include <span>
#include <sstream>

namespace scanshade {
namespace {

constexpr std::array classes{SensorClass::clean, SensorClass::structured_light, SensorClass::time_of_flight,
                             SensorClass::interpolated};

std::string word_of(SensorClass sensor) {
    std::string word(name_of(sensor));
    std::ranges::replace(word, ' ', '_');
    return word;
}

std::optional<SensorClass> class_from(const std::string& word) {
    for (const SensorClass sensor : classes)
        if (word_of(sensor) == word)
            return sensor;
    return std::nullopt;
}

ChosenSettings settings_from(const std::string& text) {
    ChosenSettings settings;
    std::istringstream list(text);
    for (std::string each; std::getline(list, each, ',');) {
        const std::size_t equals = each.find('=');
        if (equals == std::string::npos)
            throw Error(fmt::format("NAME=VALUE expected, found '{}'", each));
        settings.emplace_back(each.substr(0, equals), each.substr(equals + 1));
    }
    return settings;
}

std::string text_of(const ChosenSettings& settings) {
    std::vector<std::string> all;
    for (const auto& [name, value] : settings)
        all.push_back(fmt::format("{}={}", name, value));
    return fmt::format("{}", fmt::join(all, ","));
}

float number_in(std::istringstream& words) {
    float number = 0;
    if (!(words >> number) || !std::isfinite(number))
        throw Error("a number expected");
    return number;
}

void take_line(const std::string& line, ErrorTables& tables) {
    std::istringstream words(line);
    std::string kind, method, sensor;
    words >> kind;
    if (kind == "made_by") {
        std::getline(words >> std::ws, tables.made_by);
        return;
    }
    words >> method >> sensor;
    const std::optional<SensorClass> of = class_from(sensor);
    if (!of)
        throw Error(fmt::format("a class of sensors expected, found '{}'", sensor));
    MethodErrors& errors = tables.methods[{method, *of}];
    if (kind == "table") {
        for (float& factor : errors.table.factors)
            factor = number_in(words);
    } else if (kind == "together") {
        errors.together = number_in(words);
    } else if (kind == "spread") {
        errors.spread = number_in(words);
        if (!(errors.spread > 0))
            throw Error("a number above 0 expected");
    } else if (kind == "variant") {
        ErrorVariant variant{{}, number_in(words)};
        std::string settings;
        words >> settings;
        variant.settings = settings_from(settings);
        errors.variants.push_back(std::move(variant));
    } else {
        throw Error(fmt::format("made_by, table, together, spread or variant expected, found '{}'", kind));
    }
    if (std::string more; words >> more)
        throw Error(fmt::format("'{}' is one word too many", more));
}

bool holds(const ChosenSettings& settings, const std::pair<std::string, std::string>& wanted) {
    return std::ranges::find(settings, wanted) != settings.end();
}

const MethodErrors* known(const ErrorTables& tables, const std::string& method, SensorClass sensor) {
    const auto found = tables.methods.find({method, sensor});
    return found == tables.methods.end() ? nullptr : &found->second;
}

} // namespace

ErrorTables error_tables_from(std::istream& text, const std::string& origin) {
    ErrorTables tables;
    int number = 0;
    for (std::string line; std::getline(text, line);) {
        ++number;
        if (!line.empty() && line[0] != '#')
            during(fmt::format("{}, line {}", origin, number), [&] { take_line(line, tables); });
    }
    return tables;
}

std::string text_of(const ErrorTables& tables) {
    std::string text =
        "# Expected errors of visibility: binary logarithms of factors of the squared error, in the order "
        "of\n# shaders/shared/expected_error.h. Renew them by the command below.\n";
    text += fmt::format("made_by {}\n", tables.made_by);
    for (const auto& [key, errors] : tables.methods) {
        const std::string head = fmt::format("{} {}", key.first, word_of(key.second));
        text += fmt::format("table {} {:.2f}\n", head, fmt::join(std::span(errors.table.factors), " "));
        if (errors.together != 0)
            text += fmt::format("together {} {:.2f}\n", head, errors.together);
        if (errors.spread > 0)
            text += fmt::format("spread {} {:.2f}\n", head, errors.spread);
        for (const ErrorVariant& variant : errors.variants)
            text += fmt::format("variant {} {:.2f} {}\n", head, variant.factor, text_of(variant.settings));
    }
    return text;
}

const ErrorTables& shipped_error_tables() {
    static const ErrorTables tables = [] {
        std::istringstream text(expected_errors_text);
        return error_tables_from(text, "ao/expected_errors.txt");
    }();
    return tables;
}

shared::ErrorTable errors_of(const ErrorTables& tables, const std::string& method, const ChosenSettings& settings,
                             SensorClass sensor, double together) {
    const MethodErrors* errors = known(tables, method, sensor);
    if (!errors)
        errors = known(tables, method, SensorClass::structured_light);
    if (!errors)
        errors = known(tables, "cacao", sensor);
    if (!errors)
        return {};
    float factor = static_cast<float>(together) * errors->together;
    std::size_t most = 0;
    float of_variant = 0;
    for (const ErrorVariant& variant : errors->variants)
        if (variant.settings.size() > most &&
            std::ranges::all_of(variant.settings, [&](const auto& each) { return holds(settings, each); })) {
            most = variant.settings.size();
            of_variant = variant.factor;
        }
    factor += of_variant;
    return scaled(errors->table, factor);
}

shared::ErrorTable scaled(shared::ErrorTable table, float factor) {
    for (int i = 0; i < shared::error_edges_at; ++i) // every pixel's sum holds one of these with weights of sum 1
        table.factors[i] += factor;
    return table;
}

double spread_of(const ErrorTables& tables, const std::string& method, SensorClass sensor) {
    if (const MethodErrors* errors = known(tables, method, sensor); errors && errors->spread > 0)
        return static_cast<double>(errors->spread);
    float of_class = 0, of_all = 1;
    for (const auto& [key, errors] : tables.methods) {
        of_all = std::max(of_all, errors.spread);
        if (key.second == sensor)
            of_class = std::max(of_class, errors.spread);
    }
    return static_cast<double>(of_class > 0 ? of_class : of_all);
}

} // namespace scanshade
