// A tar, written member by member: the same members give the same bytes on any machine.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace scanshade {

/// ustar; a pax header goes before a member whose name or size ustar does not hold. Times, users and groups are 0,
/// modes 0644.
class TarOutput {
  public:
    /// Creates the file, or replaces it. Throws Outage naming it, as all functions here do.
    explicit TarOutput(std::filesystem::path file);
    ~TarOutput();
    TarOutput(const TarOutput&) = delete;
    TarOutput& operator=(const TarOutput&) = delete;

    [[nodiscard]] const std::filesystem::path& file() const { return file_; }
    void add(std::string_view name, std::string_view bytes);
    /// Ends the archive, syncs it, and renames it to `target`, whose folder must be there.
    void finish(const std::filesystem::path& target);

  private:
    void write(std::string_view bytes);

    std::filesystem::path file_;
    int handle_;
    std::uint64_t written_ = 0;
};

} // namespace scanshade
