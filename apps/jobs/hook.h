// Hooks: commands of the user that fetch a task's input and deliver its results. What moves the data, and its
// credentials, stay outside the program.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace scanshade {

/// The hooks of a job, as `plan` got them; a text is empty where there is no such hook.
struct Hooks {
    std::string fetch;   ///< a shell's command with {source} and {dir}: fills the empty folder {dir}
    std::string deliver; ///< with {out} and {task}: copies the folder {out} to where the results of {task} belong
    int limit_s = 3600;  ///< a hook that takes longer is ended, with every process it started
    int tries = 5;
    double wait_s = 1;        ///< before the second try; doubled before each further one
    double scratch_limit = 0; ///< GB on each machine; 0 = half of what is free

    [[nodiscard]] bool any() const { return !fetch.empty() || !deliver.empty(); }
};

constexpr double most_wait_s = 3600, most_scratch_gb = 1e6;

/// check_hook() of both.
void check_hooks(const Hooks& hooks);
/// Throws Misuse unless the command has each placeholder, none of `foreign`, and none within quotes: they are quoted
/// already. `flag` is named in the message.
void check_hook(const std::string& flag, std::string_view command, const std::vector<std::string>& placeholders,
                const std::vector<std::string>& foreign);

/// The command with each "{name}" as a shell's quoted variable. Values never become part of the shell's text, so that
/// no name can change the command.
[[nodiscard]] std::string shell_text(std::string_view command, const std::vector<std::string>& placeholders);

/// The end of one run of a hook.
struct HookEnd {
    int exit_code = 0;         ///< 128 + signal of a killed one
    std::string ended_because; ///< by us: "no end after 60 s"; empty = it ended by itself
    std::string stderr_tail;   ///< the last 4 KiB
    double took_s = 0;

    [[nodiscard]] bool well() const { return exit_code == 0 && ended_because.empty(); }
    /// "exit code 7: no such bucket": one line.
    [[nodiscard]] std::string reason() const;
};

/// Who may run a hook for how long.
struct HookWatch {
    double limit_s = 3600;
    /// Called about every `every_s`; a text ends the hook, for that reason.
    std::function<std::string()> ends_because = {};
    double every_s = 0.2;
    int lock = -1; ///< a file whose lock holds until the last process of the hook is gone, even if ours is killed
};

/// Runs `sh -c` with `values` for the placeholders; standard input is empty, standard output goes nowhere. The hook has
/// a process group of its own, which ends with it: whether it ends, is ended, or this process is killed. Throws Outage
/// where no process can be started, Error for a value that a command would take for an option.
[[nodiscard]] HookEnd run_hook(std::string_view command, const std::vector<std::pair<std::string, std::string>>& values,
                               const HookWatch& watch);

} // namespace scanshade
