// Writing without half files: writes to a temporary name in the target's folder, then renames it.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace scanshade {

/// Calls `write` with a new, empty file in target's folder (same extension, name starting with '.'), then syncs and
/// renames it to `target`. Neither follows a symbolic link: one in the target's place is replaced. On failure the
/// temporary file is removed and Outage names `target`. Missing parent folders are made.
void write_atomically(const std::filesystem::path& target,
                      const std::function<void(const std::filesystem::path&)>& write);
/// The same for bytes already in memory.
void write_atomically(const std::filesystem::path& target, std::string_view bytes);

/// The last step of it, for a file that takes long to write: syncs `temporary` and renames it to `target`, which is in
/// the same folder.
void publish(const std::filesystem::path& temporary, const std::filesystem::path& target);

/// While this lives, write_atomically() does not sync files below its folder: the same process passes them on, and
/// after a power cut nobody looks for them.
class UnsyncedFolder {
  public:
    explicit UnsyncedFolder(std::filesystem::path folder);
    ~UnsyncedFolder();
    UnsyncedFolder(const UnsyncedFolder&) = delete;
    UnsyncedFolder& operator=(const UnsyncedFolder&) = delete;

  private:
    std::filesystem::path folder_;
};

/// Throws Misuse, with the system's reason, where no file can be made in `folder`, or in the nearest folder above it
/// that exists. Throws Outage for a full disk and other trouble that passes. Leaves nothing behind.
void require_folder(const std::filesystem::path& folder);
/// The same for the folder of `file`; a folder in its place is refused, too.
void require_file(const std::filesystem::path& file);

/// The name if it has at most so many bytes, else its beginning and a hash of the whole. File systems take 255.
[[nodiscard]] std::string shortened(const std::string& name, std::size_t most_bytes);

/// Removes temporary files that a killed run left in `folder`: those that write_atomically made on the way to a target
/// whose stem is `ours`. The caller holds the lock under which these targets are written, so that no process
/// on any machine still writes them. Returns how many.
int remove_leftovers(const std::filesystem::path& folder, const std::function<bool(std::string_view stem)>& ours);

} // namespace scanshade
