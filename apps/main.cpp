// The program: the table of commands, their help, and the exit codes.
#include "apps/command.h"
#include "apps/settings_file.h"
#include "projection/error.h"

#include <algorithm>
#include <array>
#include <CLI/CLI.hpp>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <malloc.h>

namespace scanshade {
namespace {

const std::array commands = {
    CommandRow{"inspect", "what is in a capture: frames, sizes, depth range, holes, camera, poses", inspect_command},
    CommandRow{"run", "ambient occlusion for every frame: maps, shaded pictures, clouds, a report", run_command},
    CommandRow{"plan", "finds a dataset's captures and cuts them into tasks, for run on any number of machines",
               plan_command},
    CommandRow{"status", "how a planned job stands: tasks, frames, who is at work, failures by reason", status_command},
    CommandRow{"merge", "a planned job's reports in one", merge_command},
    CommandRow{"refine", "the camera, from pictures of a board, organised clouds or a recording, and how sure",
               refine_command},
    CommandRow{"compare", "two results, or a result and truth, as numbers and difference pictures", compare_command},
    CommandRow{"bench", "methods and settings against truth: milliseconds, errors, the front, as one page",
               bench_command},
    CommandRow{"calibrate-look", "fits a method's free settings to truth, judges them on other captures",
               calibrate_command},
    CommandRow{"generate", "a capture of a synthetic scene with exact truth", generate_command},
    CommandRow{"methods", "the ambient-occlusion methods there are", methods_command},
    CommandRow{"devices", "the Vulkan devices there are", devices_command},
};

const CommandRow& command_named(const std::string& name) {
    const auto row = std::ranges::find(commands, name, &CommandRow::name);
    if (row == commands.end())
        throw Misuse("'" + name + "' is no command; `scanshade help` lists them");
    return *row;
}

// ---------------------------------------------------------------------------------------------------- help

void print_overview() {
    fmt::print("scanshade {}: ambient occlusion for recorded depth images and point clouds\n\n", SCANSHADE_VERSION);
    for (const CommandRow& row : commands)
        fmt::print("  scanshade {:<14} {}\n", row.name, row.summary);
    fmt::print("  scanshade {:<14} {}\n  scanshade {:<14} {}\n", "help",
               "this, or the flags of one command: help COMMAND", "--version", "the version");
    fmt::print("\nExit code: 0 all well, 1 misuse, 2 some frames' input is bad (the others are done), 3 nothing could "
               "be done,\n"
               "           4 interrupted, device lost, disk full or share gone: try again, `run --resume` goes on, 5 "
               "internal error.\n");
}

std::string flag_names(const Parameter& row) { return row.name == "out" ? "-o,--out" : "--" + row.name; }

bool is_switch(const Parameter& row) { return std::holds_alternative<bool*>(row.value); }

/// "[default 0.5; m, 0 .. 100]"
std::string limits(const Parameter& row) {
    const std::string value = value_text(row), range = range_text(row);
    const std::string otherwise = value.empty() ? "" : "default " + value;
    const std::string allowed = is_switch(row) ? "" : range;
    return fmt::format("{}{}{}", otherwise, otherwise.empty() || allowed.empty() ? "" : "; ", allowed);
}

void print_help(const CommandRow& row) {
    const std::unique_ptr<Command> command = row.make();
    const Words words = command->words();
    fmt::print("scanshade {}{}{} [flags]\n  {}\n", row.name, words.values ? " " + words.name : "",
               words.at_most > 1 ? "..." : "", row.summary);
    if (words.values)
        fmt::print("\n  {:<28} {}\n", words.name, words.help);
    for (const Stage& stage : command->stages()) {
        fmt::print("\n{}:\n", stage.title);
        for (const Parameter& parameter : stage.rows) {
            fmt::print("  {:<28} {}\n", flag_names(parameter), parameter.help);
            if (const std::string about = limits(parameter); !about.empty())
                fmt::print("  {:<28} [{}]\n", "", about);
        }
    }
}

// ---------------------------------------------------------------------------------------------------- flags

/// A switch is given as --name or --name=false; everything else takes a value. --settings FILE gives others theirs,
/// unless they stand on the command line themselves.
void add_flag(CLI::App& parser, const Parameter& row) {
    const std::string names = flag_names(row);
    if (row.name == settings_flag)
        parser.set_config(names)->each([row](const std::string& text) { set(row, text); });
    else if (is_switch(row))
        parser.add_flag_function(names, [row](std::int64_t given) { set(row, given > 0 ? "true" : "false"); });
    else
        parser.add_option_function<std::string>(names, [row](const std::string& text) { set(row, text); });
}

/// Fills the command's words and rows; throws Misuse for what is unknown, missing or out of range.
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
    for (const Stage& stage : command.stages())
        for (const Parameter& row : stage.rows)
            add_flag(parser, row);
    std::ranges::reverse(arguments); // as CLI11 takes a vector
    try {
        parser.parse(arguments);
    } catch (const CLI::ParseError& error) {
        throw Misuse(error.what());
    }
}

bool asks_for_help(const std::string& word) { return word == "help" || word == "--help" || word == "-h"; }

int execute(const std::vector<std::string>& arguments) {
    if (arguments.empty()) {
        print_overview();
        return misuse;
    }
    const std::string& name = arguments[0];
    if (name == "--version") {
        fmt::print("scanshade {}\n", SCANSHADE_VERSION);
        return all_well;
    }
    if (asks_for_help(name)) {
        arguments.size() > 1 ? print_help(command_named(arguments[1])) : print_overview();
        return all_well;
    }
    const CommandRow& row = command_named(name);
    const std::vector<std::string> rest(arguments.begin() + 1, arguments.end());
    if (std::ranges::any_of(rest, [](const auto& word) { return word == "--help" || word == "-h"; })) {
        print_help(row);
        return all_well;
    }
    const std::unique_ptr<Command> command = row.make();
    during(name, [&] { parse(*command, rest); });
    return command->run();
}

} // namespace

} // namespace scanshade

int main(int count, char** words) {
    using namespace scanshade;
    // Images come and go by the megabyte: what one frame gives back the next one takes. By default each would ask the
    // system for fresh pages, which costs more than most of what is done with them.
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
    const std::vector<std::string> arguments(words + std::min(count, 1), words + count);
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
    } catch (const std::filesystem::filesystem_error& failure) { // a path of the command line leads nowhere
        fmt::print(stderr, "scanshade: {}\n", failure.what());
        return nothing_done;
    } catch (const std::exception& failure) {
        fmt::print(stderr, "scanshade: internal error: {}\n", failure.what());
        return internal_error;
    }
}
