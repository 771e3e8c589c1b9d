#include "apps/settings_file.h"

#include "io/shallow_json.h"
#include "projection/base/error.h"

#include <fmt/format.h>
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
        return shallow_json<json>(stream);
    } catch (const Error& failure) {
        throw Misuse(fmt::format("settings: {}", failure.what()));
    } catch (const json::exception& failure) {
        throw Misuse(fmt::format("settings: {}", failure.what()));
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
