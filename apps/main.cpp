// The program: the table of commands, their help, and the exit codes.
#include "apps/command.h"
#include "apps/help.h"
#include "apps/settings_file.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/nearest_word.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <malloc.h>
#include <sstream>

namespace scanshade {
namespace {

const std::array commands = {
    CommandRow{"inspect", "shows what a capture contains: frames, sizes, depth range, holes, camera, poses",
               inspect_command},
    CommandRow{"run", "computes ambient occlusion for every frame: maps, shaded pictures, clouds, a report",
               run_command},
    CommandRow{"plan", "finds a dataset's captures and cuts them into tasks, for run on any number of machines",
               plan_command},
    CommandRow{"status", "shows the progress of a planned job: tasks, frames, processes at work, failures by reason",
               status_command},
    CommandRow{"merge", "joins a planned job's reports into one, and makes a page of all its captures", merge_command},
    CommandRow{"view", "opens the page of results in a browser, or makes it first", view_command},
    CommandRow{"refine",
               "finds the camera and its uncertainty from pictures of a board, organised clouds or a recording",
               refine_command},
    CommandRow{"compare", "compares two results, or a result and truth: numbers and difference pictures",
               compare_command},
    CommandRow{"bench", "measures methods and settings against truth: time, error and the Pareto front, as a page",
               bench_command},
    CommandRow{"calibrate-look", "fits a method's free settings to truth, and judges them on other captures",
               calibrate_command},
    CommandRow{"generate", "generates a capture of a synthetic scene with exact truth", generate_command},
    CommandRow{"methods", "lists the ambient-occlusion methods", methods_command},
    CommandRow{"devices", "lists the Vulkan devices", devices_command},
};

const CommandRow& command_named(const std::string& name) {
    const auto row = std::ranges::find(commands, name, &CommandRow::name);
    if (row != commands.end())
        return *row;
    std::vector<std::string> known;
    for (const CommandRow& each : commands)
        known.emplace_back(each.name);
    throw Misuse(fmt::format("{}: no such command{}", name, suggestion(name, known)));
}

// ---------------------------------------------------------------------------------------------------- flags

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
        parser.add_flag_function(names, [take](std::int64_t count) { take(count > 0 ? "true" : "false"); });
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

/// Fills the command's words and rows, a preset first; throws Misuse for what is unknown, missing or out of range.
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

/// Refuses outputs that cannot be written before anything is computed for them.
void check_outputs(Command& command) {
    for (const Stage& stage : command.stages())
        for (const Parameter& row : stage.rows) {
            const std::string path = row.writes == Writes::nothing ? "" : value_text(row);
            if (!path.empty())
                row.writes == Writes::file ? require_file(path) : require_folder(path);
        }
}

bool asks_for_help(const std::string& word) { return word == "help" || word == "--help" || word == "-h"; }

int execute(const std::vector<std::string>& arguments) {
    if (arguments.empty()) {
        print_overview(commands);
        return misuse;
    }
    const std::string& name = arguments[0];
    if (name == "--version") {
        fmt::print("scanshade {}\n", SCANSHADE_VERSION);
        return all_well;
    }
    if (asks_for_help(name)) {
        if (arguments.size() > 1 && arguments[1] == "--json")
            print_json(commands);
        else if (arguments.size() > 1 && arguments[1] == "formats")
            print_formats(arguments.size() > 2 && arguments[2] == "--markdown");
        else if (arguments.size() > 1)
            print_help(command_named(arguments[1]), arguments.size() > 2 ? arguments[2] : "");
        else
            print_overview(commands);
        return all_well;
    }
    const CommandRow& row = command_named(name);
    const std::vector<std::string> rest(arguments.begin() + 1, arguments.end());
    if (std::ranges::any_of(rest, [](const auto& word) { return word == "--help" || word == "-h"; })) {
        print_help(row, "");
        return all_well;
    }
    const std::unique_ptr<Command> command = row.make();
    during(name, [&] { parse(*command, rest); });
    check_outputs(*command);
    return command->run();
}

int exit_code_of(const std::vector<std::string>& arguments) {
    try {
        return execute(arguments);
    } catch (const Misuse& failure) {
        fmt::print(stderr, "scanshade: {}\n  `scanshade help` lists the commands, `scanshade help COMMAND` its flags\n",
                   failure.what());
        return misuse;
    } catch (const Outage& failure) {
        fmt::print(stderr, "scanshade: {}\n", failure.what());
        return unfinished;
    } catch (const Error& failure) {
        fmt::print(stderr, "scanshade: {}\n", failure.what());
        return nothing_done;
    } catch (const std::filesystem::filesystem_error& failure) { // a path on the command line cannot be used
        fmt::print(stderr, "scanshade: {}\n", failure.what());
        return nothing_done;
    } catch (const std::exception& failure) {
        if (std::ferror(stdout) != 0) // printing threw; printed_all() says so
            return unfinished;
        if (const auto no_memory = failed_allocation(failure)) {
            fmt::print(stderr, "scanshade: {}\n", *no_memory);
            return unfinished;
        }
        fmt::print(stderr, "scanshade: internal error: {}\n", failure.what());
        return internal_error;
    }
}

/// Whether all that was printed has arrived. A full disk shows only when the buffer is emptied.
bool printed_all() {
    const bool failed_before = std::ferror(stdout) != 0;
    if (std::fflush(stdout) == 0 && !failed_before)
        return true;
    fmt::print(stderr, "scanshade: results could not be printed to standard output: {}\n", std::strerror(errno));
    return false;
}

} // namespace

} // namespace scanshade

int main(int count, char** words) {
    using namespace scanshade;
    // Keeps freed memory for the next frame's images. By default each image would get fresh pages from the system,
    // which costs more than most of the work on it.
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
    const std::vector<std::string> arguments(words + std::min(count, 1), words + count);
    const int code = exit_code_of(arguments);
    return printed_all() ? code : unfinished;
}
