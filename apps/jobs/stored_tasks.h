// Tasks whose input hooks fetch, and whose results hooks deliver: fetch, compute, deliver, journal, clear.
#pragma once

#include "apps/jobs/job.h"
#include "apps/jobs/scratch.h"

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>

namespace scanshade {

/// Where a task's capture is, and where its results go.
struct TaskFolders {
    std::filesystem::path capture, results;
};

/// What the steps of this machine's tasks need. Safe to use from several threads, a task in each.
class StoredTasks {
  public:
    /// `siblings`: names of the journals of a capture's blocks, by its folder. `scratch`, `limit_gb`: as typed, "" and
    /// 0 where not. `retry`: tasks that ended without all their frames are done again.
    StoredTasks(std::filesystem::path job, const Plan& plan,
                const std::map<std::filesystem::path, std::set<std::string>>& siblings, const std::string& scratch,
                double limit_gb, bool retry, const std::atomic<bool>& stop);

    /// Does the task and returns its exit code; does nothing for one that has ended. `compute` writes all results of
    /// the capture and returns an exit code; it throws Error where the capture cannot be computed at all.
    ///
    /// Whatever is killed, a task is journalled as ended only after its delivery has ended well. A run that is killed
    /// between the two delivers the same files again.
    [[nodiscard]] int run(const Task& task, const std::function<int(const TaskFolders&, Journal&)>& compute);

  private:
    struct Work; // on one task
    void fetch(Work& work);
    int compute(Work& work, const std::function<int(const TaskFolders&, Journal&)>& compute);
    void deliver(Work& work);
    /// The next tasks may take as much.
    void expect(std::uint64_t bytes);
    /// Waits before another try; throws Outage when the run is stopped.
    void back_off(int attempt) const;

    std::filesystem::path job_;
    const Plan& plan_;
    const std::map<std::filesystem::path, std::set<std::string>>& siblings_;
    bool retry_;
    const std::atomic<bool>& stop_;
    Scratch scratch_;
    std::atomic<std::uint64_t> largest_ = 0; ///< bytes that a task has taken so far: expected of the next
};

} // namespace scanshade
