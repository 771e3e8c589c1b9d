// A job: many captures cut into tasks, in a folder that every machine sees. plan.json holds the settings,
// tasks.jsonl lists the tasks, results/NAME holds a capture's results and the journals of its tasks.
#pragma once

#include "apps/jobs/hook.h"
#include "apps/results/journal.h"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace scanshade {

/// A capture, or a block of its frames.
struct Task {
    std::filesystem::path capture;  ///< or a source, as the fetching hook knows it
    std::string name;               ///< unique in the job: results/NAME
    std::size_t first = 0;          ///< index among the capture's frames in the plan
    std::size_t frames = 0;         ///< number of frames; 0 = not known before it is fetched
    std::size_t of = 0;             ///< all frames of the capture in the plan
    double cost = 0;                ///< about megapixels or million points; shards get equal sums of it
    std::uint64_t listed_bytes = 0; ///< of a source, if its list has them
    bool clouds = false;            ///< frames are clouds: processes that have nothing else to do help with large ones

    /// "" for a whole capture, else "0-500": the end is not included.
    [[nodiscard]] std::string block() const;
};

/// The settings and captures of a job. Settings are those that differ from their defaults, as typed.
struct Plan {
    std::vector<std::pair<std::string, std::string>> settings;
    std::vector<Task> tasks;
    std::vector<std::string> refused;          ///< captures that could not be opened, and why
    std::vector<std::string> passed_over = {}; ///< folders that hold no capture to compute, and why; not read back
    Hooks hooks = {};
};

/// Which of N equal parts of a job: 1 .. of.
struct Shard {
    int index = 1, of = 1;
};

[[nodiscard]] bool is_job(const std::filesystem::path& folder);
/// Atomic; plan.json last.
void write_plan(const std::filesystem::path& job, const Plan& plan);
/// Throws Error naming file and line.
[[nodiscard]] Plan read_plan(const std::filesystem::path& job);

[[nodiscard]] std::filesystem::path results_of(const std::filesystem::path& job, const Task& task);

/// "2/8"; empty = SLURM_ARRAY_TASK_ID, _MIN, _COUNT and _STEP, else JOB_COMPLETION_INDEX and JOB_COMPLETIONS, else
/// all of it. Throws Misuse.
[[nodiscard]] Shard shard_from(const std::string& text);

/// The tasks of each shard, by index into `tasks`: the costliest first, each to the shard with the least to do. Equal
/// plans are cut equally on every machine.
[[nodiscard]] std::vector<std::vector<std::size_t>> cut(const std::vector<Task>& tasks, int shards);

} // namespace scanshade
