// Any part of a large file, read when it is asked for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace scanshade {

/// An open file. Several threads may read at once.
class FileBytes {
  public:
    /// Throws Error naming the file where it is missing or cannot be read, Outage as fail_to_read().
    explicit FileBytes(std::filesystem::path path);
    ~FileBytes();
    FileBytes(const FileBytes&) = delete;
    FileBytes& operator=(const FileBytes&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// When it was opened.
    [[nodiscard]] std::uint64_t size() const { return size_; }
    /// Throws Error naming file and place where these bytes are not there, OutOfMemory where they do not fit.
    [[nodiscard]] std::string bytes(std::uint64_t at, std::uint64_t count) const;

  private:
    std::filesystem::path path_;
    int descriptor_ = -1;
    std::uint64_t size_ = 0;
};

} // namespace scanshade
