// A command of the program: words and flags bound to variables, and the work to do once they are set.
#pragma once

#include "projection/base/parameters.h"

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// The program's exit codes, for scripts.
enum ExitCode : int {
    all_well = 0,
    misuse = 1,
    some_failed = 2,  ///< some frames' input is bad (with --strict: or a result doubtful), the others are done. Trying
                      ///< again will not help
    nothing_done = 3, ///< nothing could be done
    unfinished = 4,   ///< interrupted, a device lost, a disk or memory full, a share gone: --resume continues
    internal_error = 5, ///< an error in the program, or a frame that crashed it
};

/// Flags of one stage of the walk, as the help groups them. Row "radius" is the flag --radius; row "out" is also -o.
struct Stage {
    std::string title; ///< "input", "output", "method cacao"
    std::vector<Parameter> rows;
    std::string topic{}; ///< shown by `help COMMAND TOPIC` only; empty = by the command's own help
};

/// The flag of a preset, in commands that have one: defaults of other flags.
inline constexpr std::string_view preset_flag = "preset";

/// The words on the command line without a flag: PATH...
struct Words {
    std::string name; ///< "PATH", as the help shows it
    std::string help;
    std::vector<std::string>* values = nullptr; ///< null = the command takes no words
    int at_least = 0, at_most = 0;
};

/// One command with its settings. The parser fills words() and stages(), then calls run().
class Command {
  public:
    virtual ~Command() = default;
    virtual Words words() { return {}; }
    virtual std::vector<Stage> stages() { return {}; }
    /// Changes defaults; called once the row preset_flag is set, before all other rows.
    virtual void take_preset() {}
    /// Does the work; returns an ExitCode. Throws Misuse for invalid settings, Error when nothing can be done.
    virtual int run() = 0;
};

/// A row of the table of commands in main.cpp.
struct CommandRow {
    std::string_view name;    ///< "run"
    std::string_view summary; ///< one line
    std::unique_ptr<Command> (*make)();
};

std::unique_ptr<Command> inspect_command();
std::unique_ptr<Command> run_command();
std::unique_ptr<Command> plan_command();
std::unique_ptr<Command> status_command();
std::unique_ptr<Command> merge_command();
std::unique_ptr<Command> view_command();
std::unique_ptr<Command> refine_command();
std::unique_ptr<Command> relief_command();
std::unique_ptr<Command> compare_command();
std::unique_ptr<Command> bench_command();
std::unique_ptr<Command> generate_command();
std::unique_ptr<Command> methods_command();
std::unique_ptr<Command> devices_command();

} // namespace scanshade
