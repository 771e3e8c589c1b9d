// Whether a folder's storage does what jobs rely on: locks that processes see of each other, and renames.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace scanshade {

/// The system's calls, for tests to replace. They return as flock() and rename() do.
struct FolderCalls {
    std::function<int(int handle, int operation)> flock = {};
    std::function<int(const char* from, const char* to)> rename = {};
};

/// Which of the two does not work in the folder, and how it shows; empty = both do. Tries them on files of its own, the
/// locks between two processes. The caller must have no threads. Throws Outage where no file can be made.
[[nodiscard]] std::string renames_fail_in(const std::filesystem::path& folder, const FolderCalls& calls = {});
[[nodiscard]] std::string locks_fail_in(const std::filesystem::path& folder, const FolderCalls& calls = {});

/// Mount options by which locks hold on this machine only, as "local_lock=all"; empty = none is known.
/// `mounts`: as /proc/self/mountinfo.
[[nodiscard]] std::string local_locks_option(const std::filesystem::path& folder, const std::string& mounts);

/// Throws Misuse with the ways out where a job cannot live in the folder. Without `locks` only renames are needed.
/// Warns where locks hold on this machine only.
void require_job_folder(const std::filesystem::path& folder, bool locks);

} // namespace scanshade
