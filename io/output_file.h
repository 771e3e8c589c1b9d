// Writing without half files: writes to a temporary name in the target's folder, then renames it.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

namespace scanshade {

/// Calls `write` with a temporary path in target's folder (same extension, name starting with '.'), then syncs and
/// renames it to `target`. On failure the temporary file is removed and Outage names `target`. Missing parent folders
/// are made.
void write_atomically(const std::filesystem::path& target,
                      const std::function<void(const std::filesystem::path&)>& write);
/// The same for bytes already in memory.
void write_atomically(const std::filesystem::path& target, std::string_view bytes);

/// Removes temporary files that a killed run left in `folder`: those that write_atomically made on the way to a target
/// whose stem is `ours`. The caller holds the lock under which these targets are written, so that no process
/// on any machine still writes them. Returns how many.
int remove_leftovers(const std::filesystem::path& folder, const std::function<bool(std::string_view stem)>& ours);

} // namespace scanshade
