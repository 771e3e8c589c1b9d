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

/// A switch stands alone or takes a word that joined() put behind a '='; everything else takes a value. --settings FILE
/// gives others theirs, unless the command line gives them itself.
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

/// Whether a word is the flag, long or short.
bool names(const std::string& word, const Parameter& row) {
    return word == flag_of(row) || flag_names(row) == word + "," + flag_of(row);
}

/// The arguments, with "--overwrite no" as "--overwrite=no": a switch takes a next word of these four and no other,
/// which may be a path.
std::vector<std::string> joined(const std::vector<std::string>& arguments, const std::vector<Parameter>& rows) {
    const auto is_the_switch = [&](const std::string& word) {
        return std::ranges::any_of(rows, [&](const Parameter& row) { return is_switch(row) && names(word, row); });
    };
    std::vector<std::string> words;
    for (const std::string& argument : arguments)
        if (!words.empty() && is_the_switch(words.back()) &&
            (argument == "yes" || argument == "no" || argument == "true" || argument == "false"))
            words.back() += "=" + argument;
        else
            words.push_back(argument);
    return words;
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

/// CLI11's message about a count begins with the name of what was counted.
[[noreturn]] void refuse_count(const std::string& message, const std::vector<std::string>& arguments,
                               const std::vector<Parameter>& rows, const Words& words) {
    const std::string name = message.substr(0, message.find(':'));
    if (name == words.name)
        throw Misuse(fmt::format("{} {} expected at most, more are given", words.at_most, name));
    const auto row = std::ranges::find_if(rows, [&](const Parameter& each) { return flag_of(each) == name; });
    const std::string range = row == rows.end() ? "" : range_text(*row);
    const auto given = row == rows.end() ? 0 : std::ranges::count_if(arguments, [&](const std::string& word) {
        return names(word.substr(0, word.find('=')), *row);
    });
    if (given == 1)
        throw Misuse(fmt::format("{} needs a value{}{}", name, range.empty() ? "" : ": ", range));
    throw Misuse(fmt::format("{} is given more than once", name));
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
    arguments = joined(arguments, rows);
    try {
        parser.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend())); // as CLI11 takes a vector
    } catch (const CLI::ConfigError& error) {
        refuse_unknown_setting(error.what(), rows);
    } catch (const CLI::FileError&) {
        throw Misuse("settings: the file is missing or cannot be read");
    } catch (const CLI::RequiredError&) {
        refuse_unknown_flag(parser.remaining(), rows);
        throw Misuse(fmt::format("{} is missing: {}", words.name, words.help));
    } catch (const CLI::ArgumentMismatch& error) {
        refuse_unknown_flag(parser.remaining(), rows);
        refuse_count(error.what(), arguments, rows, words);
    } catch (const CLI::ParseError&) {
        refuse_unknown_flag(parser.remaining(), rows);
        throw Misuse(parser.remaining().empty() ? "flags and words in an order that makes no sense"
                                                : fmt::format("'{}' is one word too many", parser.remaining().front()));
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
