// Settings kept in a file: what calibrate-look writes and `run --settings` takes; an earlier run's manifest.json
// serves, too.
#pragma once

#include "apps/json.h"

#include <CLI/CLI.hpp>

namespace scanshade {

/// The flag that names such a file, in every command that has a row of this name.
inline constexpr std::string_view settings_flag = "settings";

/// {"settings": {"method": {"method": "cacao"}, "method cacao": {"cacao.radius": 0.3, ...}}}: the method's stages as a
/// manifest has them; other stages (input, output) say where an earlier run's files lay and are left alone.
class SettingsFile final : public CLI::Config {
  public:
    /// Throws Misuse where it is no such JSON.
    [[nodiscard]] std::vector<CLI::ConfigItem> from_config(std::istream& stream) const override;
    /// Never asked for: the program's settings are written by write_manifest() and calibrate-look.
    [[nodiscard]] std::string to_config(const CLI::App*, bool, bool, std::string) const override { return {}; }
};

} // namespace scanshade
