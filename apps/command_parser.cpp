// Words and flags as typed -> the variables of a command's rows.
#include "apps/command_parser.h"

#include "apps/help.h"
#include "apps/settings_file.h"
#include "projection/base/error.h"
#include "projection/base/nearest_word.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <memory>
#include <utility>

namespace scanshade {
namespace {

/// Flags from the command line and the settings file, as they are read.
using Given = std::vector<std::pair<Parameter, std::string>>;

/// A switch is given as --name or --name=false; everything else takes a value. --settings FILE gives others theirs,
/// unless the command line gives them itself.
void add_flag(CLI::App& parser, const Parameter& row, Given& given) {
    const std::string names = flag_names(row);
    const auto take = [&given, row](const std::string& text) { given.emplace_back(row, text); };
    if (row.name == settings_flag)
        parser.set_config(names)->each(take);
    else if (is_switch(row))
        parser.add_flag(names)->each(take);
    else
        parser.add_option_function<std::string>(names, take);
}

std::vector<std::string> flags_of(const std::vector<Parameter>& rows) {
    std::vector<std::string> flags;
    for (const Parameter& row : rows)
        flags.push_back(flag_of(row));
    return flags;
}

/// The first word that the parser did not know, if it looks like a flag: with the flag that was meant.
void refuse_unknown_flag(const std::vector<std::string>& unknown, const std::vector<Parameter>& rows) {
    for (const std::string& word : unknown)
        if (const std::string flag = word.substr(0, word.find('=')); flag.starts_with('-'))
            throw Misuse(fmt::format("{}: no such flag{}", flag, suggestion(flag, flags_of(rows))));
}

/// CLI11's message about a settings file ends with the setting that it did not know.
[[noreturn]] void refuse_unknown_setting(const std::string& message, const std::vector<Parameter>& rows) {
    const std::string flag = "--" + message.substr(message.rfind(' ') + 1);
    throw Misuse(fmt::format("settings: {}: no such flag{}", flag, suggestion(flag, flags_of(rows))));
}

} // namespace

void parse(Command& command, std::vector<std::string> arguments) {
    CLI::App parser;
    parser.set_help_flag();
    parser.config_formatter(std::make_shared<SettingsFile>());
    parser.allow_config_extras(CLI::config_extras_mode::error);
    const Words words = command.words();
    if (words.values)
        parser.add_option(words.name, *words.values)
            ->expected(words.at_least, words.at_most)
            ->required(words.at_least > 0);
    Given given;
    std::vector<Parameter> rows;
    for (const Stage& stage : command.stages())
        rows.insert(rows.end(), stage.rows.begin(), stage.rows.end());
    for (const Parameter& row : rows)
        add_flag(parser, row, given);
    std::ranges::reverse(arguments); // as CLI11 takes a vector
    try {
        parser.parse(arguments);
    } catch (const CLI::ConfigError& error) {
        refuse_unknown_setting(error.what(), rows);
    } catch (const CLI::ParseError& error) {
        refuse_unknown_flag(parser.remaining(), rows);
        throw Misuse(error.what());
    }
    const auto take = [](const auto& each) { set(each.first, each.second); };
    const auto rest = std::stable_partition(given.begin(), given.end(),
                                            [](const auto& each) { return each.first.name == preset_flag; });
    std::for_each(given.begin(), rest, take);
    if (rest != given.begin())
        command.take_preset();
    std::for_each(rest, given.end(), take);
}

} // namespace scanshade
