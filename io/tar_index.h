// The members of an uncompressed tar and their places in it: ustar, pax, GNU's long names, and those before ustar.
#pragma once

#include "io/file_bytes.h"
#include "io/files.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// Whether a file with these first bytes is a tar: its first header has the right checksum.
[[nodiscard]] bool begins_as_tar(std::string_view start);

/// Made once by reading every header; members stay where they are. It takes 32 bytes and its name for each member.
/// Of members with one name the last counts. Hard and symbolic links stand for files inside the tar that they lead to.
class TarIndex {
  public:
    /// Damage is an oddity: what lies before it can be read. Throws Error naming the file where it cannot be read, and
    /// for more than 2^24 members.
    explicit TarIndex(const std::filesystem::path& file);

    struct Member {
        bool folder = false;
        std::uint64_t at = 0, size = 0;
        std::string trouble; ///< why its bytes cannot be read; empty = they can
    };
    /// `name`: without "." or empty parts; "" = the root. Folders are there without a header of their own.
    [[nodiscard]] std::optional<Member> find(std::string_view name) const;
    [[nodiscard]] std::vector<FolderItem> items_in(std::string_view folder) const;
    /// Throws Error for a member with trouble.
    [[nodiscard]] StoredBytes bytes_of(const Member& member, const std::filesystem::path& path) const;

    /// Sentences naming the file.
    [[nodiscard]] const std::vector<std::string>& oddities() const { return oddities_; }
    [[nodiscard]] std::size_t members() const { return entries_.size(); }

  private:
    enum class Kind : std::uint8_t { file, folder, sparse, cut, hard_link, symbolic_link };
    struct Entry {
        std::uint64_t at, size; ///< of links, until they are resolved: of their target in names_
        std::uint64_t name_at : 40, name_bytes : 16, kind : 8;
    };
    static_assert(sizeof(Entry) == 24);
    class Reader;
    friend class Reader;

    [[nodiscard]] std::string_view name_of(const Entry& entry) const {
        return std::string_view(names_).substr(entry.name_at, entry.name_bytes);
    }
    [[nodiscard]] const Entry* entry_of(std::string_view name) const;
    [[nodiscard]] std::vector<Entry>::const_iterator first_below(const std::string& folder_with_slash) const;
    void sort();
    void resolve_links();

    FileBytes file_;
    std::string names_;          ///< one after another
    std::vector<Entry> entries_; ///< in the order of names, '/' before every other character
    std::vector<std::string> oddities_;
};

} // namespace scanshade
