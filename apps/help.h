// What the program tells about its commands and flags, for people and as JSON.
#pragma once

#include "apps/command.h"

#include <span>
#include <string>

namespace scanshade {

/// "--radius"
[[nodiscard]] std::string flag_of(const Parameter& row);
/// The flag's name, with its short form if it has one: "-o,--out".
[[nodiscard]] std::string flag_names(const Parameter& row);
/// Whether the flag stands alone.
[[nodiscard]] bool is_switch(const Parameter& row);

void print_overview(std::span<const CommandRow> commands);
/// `topic`: empty, "all", or that of a stage. Throws Misuse for any other.
void print_help(const CommandRow& row, const std::string& topic);
/// All formats that are read and written, as tables; as Markdown, those of the READMEs.
void print_formats(bool as_markdown);
/// All commands, words, flags, formats and exit codes as one JSON document; man pages and completions are made of it.
void print_json(std::span<const CommandRow> commands);

} // namespace scanshade
