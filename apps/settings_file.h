// Settings in a file, which `run --settings` reads: an earlier run's manifest.json, or the developers' fit of them.
#pragma once

#include "apps/json.h"

#include <CLI/CLI.hpp>

namespace scanshade {

/// The flag that names such a file, in every command that has a row of this name.
inline constexpr std::string_view settings_flag = "settings";

/// {"settings": {"method": {"method": "cacao"}, "method cacao": {"cacao.radius": 0.3, ...}}}: the method's stages as a
/// manifest has them; other stages (input, output) hold an earlier run's paths and are ignored.
class SettingsFile final : public CLI::Config {
  public:
    /// Throws Misuse if it is not such JSON.
    [[nodiscard]] std::vector<CLI::ConfigItem> from_config(std::istream& stream) const override;
    /// Never called: write_manifest() writes the program's settings.
    [[nodiscard]] std::string to_config(const CLI::App*, bool, bool, std::string) const override { return {}; }
};

} // namespace scanshade
