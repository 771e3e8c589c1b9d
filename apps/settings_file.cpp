#include "apps/settings_file.h"

#include "io/captures/listing/layouts.h"
#include "projection/base/error.h"

#include <fmt/format.h>
#include <iterator>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

/// A setting's value as typed on the command line.
std::string typed(const std::string& name, const json& value) {
    if (value.is_string())
        return value.get<std::string>();
    if (value.is_boolean() || value.is_number())
        return value.dump();
    throw Misuse(fmt::format("settings: {}: a number, true, false or text expected, found {}", name, value.dump()));
}

json parsed(std::istream& stream) {
    try {
        return parsed_json({std::istreambuf_iterator<char>(stream), {}}, "settings");
    } catch (const Error& failure) {
        throw Misuse(failure.what());
    }
}

} // namespace

std::vector<CLI::ConfigItem> SettingsFile::from_config(std::istream& stream) const {
    const json text = parsed(stream);
    if (!text.is_object() || !text.contains("settings") || !text["settings"].is_object())
        throw Misuse("settings: JSON with an object \"settings\" expected, as run's manifest.json has");
    std::vector<CLI::ConfigItem> given;
    for (const auto& [stage, rows] : text["settings"].items())
        if (stage.starts_with("method") && rows.is_object())
            for (const auto& [name, value] : rows.items())
                if (const std::string word = typed(name, value); !word.empty() && name != settings_flag)
                    given.push_back({{}, name, {word}});
    return given;
}

} // namespace scanshade
