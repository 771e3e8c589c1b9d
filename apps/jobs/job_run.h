// Runs a shard of a job, task by task, then the tasks that other shards have left.
#pragma once

#include "apps/jobs/job.h"
#include "apps/jobs/worker.h"
#include "apps/walk/progress.h"

#include <atomic>
#include <functional>

namespace scanshade {

/// Calls `run_task` for every task of the shard, `at_once` at a time. Then it calls it for tasks of other shards that
/// are neither complete nor held, so that a dead machine's tasks are done. `run_task` returns an exit code and throws
/// Busy for a task that another process holds. Without `takes_over`, tasks of other shards are left alone. Other
/// failures are printed and count as nothing_done (an Outage as unfinished). Prints progress and remaining time after
/// each task. At last, `help` is called for tasks with clouds that other processes still hold; what it throws is
/// printed. A task that is held no more and not complete after that is run. Returns the worst exit code.
[[nodiscard]] int work_through(const std::filesystem::path& job, const Plan& plan, const Shard& shard,
                               const std::atomic<bool>& stop, std::size_t at_once, bool takes_over,
                               const std::function<int(const Task&, OrderedOutput&)>& run_task,
                               const std::function<void(const Task&)>& help = {});

} // namespace scanshade
