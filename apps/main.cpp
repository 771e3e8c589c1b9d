// The program: the table of commands, their help, and the exit codes.
#include "apps/command.h"
#include "apps/command_parser.h"
#include "apps/doubts/checks.h"
#include "apps/help.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/nearest_word.h"

#include <algorithm>
#include <array>
#include <cerrno>
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
    CommandRow{"relief", "makes maps of sky view, openness and ambient occlusion from DEMs and points of surveys",
               relief_command},
    CommandRow{"compare", "compares two results, or a result and truth: numbers and difference pictures",
               compare_command},
    CommandRow{"bench", "measures methods and settings against truth: time, error and the Pareto front, as a page",
               bench_command},
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
        else if (arguments.size() > 1 && arguments[1] == "checks")
            fmt::print("{}", arguments.size() > 2 && arguments[2] == "--markdown" ? checks_markdown() : checks_text());
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
