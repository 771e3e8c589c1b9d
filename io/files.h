// The door to input files. A path may lead through an uncompressed tar, as if that were a folder:
// `recording.tar/depth/000001.png`. Members are read in place; nothing is unpacked.
#pragma once

#include "io/file_bytes.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

namespace scanshade {

/// Whether there is anything, a regular file, a folder. A tar is both of these. False for what cannot be looked at.
[[nodiscard]] bool is_there(const std::filesystem::path& path);
[[nodiscard]] bool is_file(const std::filesystem::path& path);
[[nodiscard]] bool is_folder(const std::filesystem::path& path);
/// Of a regular file; nothing where there is none.
[[nodiscard]] std::optional<std::uint64_t> size_of_file(const std::filesystem::path& path);

/// What lies in a folder. Links stand for what they lead to.
struct FolderItem {
    enum class Kind { file, folder, other };
    std::string name;
    Kind kind = Kind::other;
};
/// In no particular order, hidden ones too. `trouble` is set where the folder cannot be listed.
[[nodiscard]] std::vector<FolderItem> items_in(const std::filesystem::path& folder, std::error_code& trouble);

/// Whether this is a regular file that begins as a tar does. A tar within a tar is none.
[[nodiscard]] bool is_tar(const std::filesystem::path& path);
/// Sentences about members of the tar at `path`, or above it, that are left out or damaged; none for other paths.
[[nodiscard]] std::vector<std::string> oddities_of_tar(const std::filesystem::path& path);

/// A member's bytes; nothing where the path leads through no tar, or to no file in it. Throws Error naming the file
/// where the tar or this member is damaged.
[[nodiscard]] std::optional<StoredBytes> stored_in_tar(const std::filesystem::path& path);
/// As stamp_of(): of the member and its tar; "" where there is none.
[[nodiscard]] std::string stamp_in_tar(const std::filesystem::path& path);

} // namespace scanshade
