// Any part of a large file, read when it is asked for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

namespace scanshade {

/// A descriptor, closed with its last user.
class OpenFile {
  public:
    explicit OpenFile(int descriptor) : descriptor_(descriptor) {}
    ~OpenFile();
    OpenFile(const OpenFile&) = delete;
    OpenFile& operator=(const OpenFile&) = delete;
    [[nodiscard]] int descriptor() const { return descriptor_; }

  private:
    int descriptor_;
};

/// Where a file's bytes are: in a file of its own, or in a part of one that holds others (io/tar_index.h).
struct StoredBytes {
    std::shared_ptr<const OpenFile> file;
    std::uint64_t at = 0, size = 0;
};

/// An open file. Several threads may read at once.
class FileBytes {
  public:
    /// The path may lead through a tar (io/files.h). Throws Error naming the file where it is missing or cannot be
    /// read, Outage as fail_to_read().
    explicit FileBytes(std::filesystem::path path);
    /// `path` stands for the bytes in messages.
    FileBytes(std::filesystem::path path, StoredBytes stored) : path_(std::move(path)), stored_(std::move(stored)) {}
    FileBytes(const FileBytes&) = delete;
    FileBytes& operator=(const FileBytes&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// When it was opened.
    [[nodiscard]] std::uint64_t size() const { return stored_.size; }
    /// Throws Error naming file and place where these bytes are not there, OutOfMemory where they do not fit.
    [[nodiscard]] std::string bytes(std::uint64_t at, std::uint64_t count) const;
    /// A part of this file as a file of its own. It must lie inside.
    [[nodiscard]] StoredBytes part(std::uint64_t at, std::uint64_t size) const;

  private:
    std::filesystem::path path_;
    StoredBytes stored_;
};

} // namespace scanshade
