// A shard of a job, task by task; and, once its own are done, what other shards have left lying.
#pragma once

#include "apps/jobs/job.h"
#include "apps/jobs/worker.h"
#include "apps/walk/progress.h"

#include <atomic>
#include <functional>

namespace scanshade {

/// Calls `run_task` for every task of the shard, `at_once` of them at a time, then for those of other shards that
/// nobody holds and nobody has completed: a machine that died is stood in for. `run_task` returns an exit code and
/// throws Busy for a task that another process is at; other failures are told and make the task nothing_done
/// (unfinished where an Outage was). Tells after each task how far the shard is and how long it will take. Returns the
/// exit code that tells most.
[[nodiscard]] int work_through(const std::filesystem::path& job, const Plan& plan, const Shard& shard,
                               const std::atomic<bool>& stop, std::size_t at_once,
                               const std::function<int(const Task&, Turn&)>& run_task);

} // namespace scanshade
