// Space on one machine for what a job's hooks have fetched and not yet delivered.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>

namespace scanshade {

/// A folder that the job's runs on this machine share, with a folder in it for each task. Whoever holds a task's
/// journal owns the task's folder. Folders that nobody owns are remains of killed runs.
class Scratch {
  public:
    /// `root`: empty = the system's temporary folder. `limit_bytes`: 0 = half of what is free. Removes remains of tasks
    /// that have ended. Throws Misuse where the folder is another user's or cannot be made.
    Scratch(const std::filesystem::path& root, const std::filesystem::path& job, std::uint64_t limit_bytes);

    /// Where a task's folder is or will be.
    [[nodiscard]] std::filesystem::path path_of(const std::string& task) const;
    /// The task's folder, made if missing. The caller holds the journal.
    [[nodiscard]] std::filesystem::path folder_of(const std::string& task, const std::filesystem::path& journal) const;
    /// Removes it.
    static void remove(const std::filesystem::path& folder);

    [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
    [[nodiscard]] std::uint64_t limit() const { return limit_; }
    /// Bytes on disk of all tasks' folders, or of one of them.
    [[nodiscard]] std::uint64_t used() const { return used_by(folder_); }
    [[nodiscard]] static std::uint64_t used_by(const std::filesystem::path& folder);

    /// The right to fetch: one fetch at a time on this machine, so that none waits for space that another half has.
    class Turn {
      public:
        /// Waits; throws Outage when `stop` is set.
        Turn(Scratch& scratch, const std::atomic<bool>& stop);
        ~Turn();
        Turn(const Turn&) = delete;
        Turn& operator=(const Turn&) = delete;

      private:
        std::unique_lock<std::timed_mutex> lock_;
        int handle_;
    };
    /// Waits until `bytes` more fit, or until no other task is in work; removes remains of killed runs first. Throws
    /// Outage when `stop` is set. Called in turn; `own` is the caller's folder.
    void make_room(std::uint64_t bytes, const std::filesystem::path& own, const std::atomic<bool>& stop);
    /// Where a task's input is once it is complete.
    [[nodiscard]] static std::filesystem::path input_in(const std::filesystem::path& folder) { return folder / "in"; }
    /// Whether another task than `own` has its input here and is in work. Those that wait for theirs free no space.
    [[nodiscard]] bool others_at_work(const std::filesystem::path& own) const;

  private:
    /// Removes folders that nobody owns; `ended_only`: just those whose task has ended. Not `own`.
    void remove_remains(bool ended_only, const std::filesystem::path& own = {}) const;

    std::filesystem::path folder_;
    std::uint64_t limit_ = 0;
    std::timed_mutex turn_;
};

} // namespace scanshade
