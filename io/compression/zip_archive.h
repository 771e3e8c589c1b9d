// Zip archives: their members, unpacked one by one or in parts.
#pragma once

#include "io/compression/inflated_stream.h"
#include "io/file_bytes.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace scanshade {

struct ZipMember {
    std::string name;
    std::uint64_t header_at = 0, packed_bytes = 0, bytes = 0;
    std::uint32_t crc = 0;
    std::uint16_t method = 0, flags = 0;
};

[[nodiscard]] bool is_zip(std::string_view start);

/// Several threads may read at once. Source: PKWARE's APPNOTE 6.3, sections 4.3 to 4.5 (zip64 included).
class ZipArchive {
  public:
    /// Reads the list of members; where that is missing, because the file was cut, the members one after the other.
    /// Throws Error naming the file for damage, and for more than 2^22 members.
    explicit ZipArchive(const std::filesystem::path& path);

    [[nodiscard]] const std::filesystem::path& path() const { return file_.path(); }
    [[nodiscard]] const std::vector<ZipMember>& members() const { return members_; }
    /// Null where there is none.
    [[nodiscard]] const ZipMember* find(const std::string& name) const;
    /// Why the list of members had to be made from the members; empty = it did not.
    [[nodiscard]] const std::string& damage() const { return damage_; }

    /// A whole member. Throws Error naming file, member and place for damage, and for more than `most` bytes.
    [[nodiscard]] std::string bytes(const ZipMember& member, std::uint64_t most) const;

  private:
    friend class ZipMemberStream;
    [[nodiscard]] std::string where(const ZipMember& member) const;
    /// Where its packed bytes begin. Throws Error where they cannot be unpacked here.
    [[nodiscard]] std::uint64_t data_at(const ZipMember& member) const;
    bool list_by_directory();
    void list_by_members();

    FileBytes file_;
    std::vector<ZipMember> members_;
    std::unordered_map<std::string, std::size_t> by_name_;
    std::string damage_;
};

/// A long member of which parts are read. Several threads may read at once.
class ZipMemberStream {
  public:
    /// A packed member is unpacked once, to check it. `archive` must outlive this. Throws Error as bytes() does.
    ZipMemberStream(const ZipArchive& archive, const ZipMember& member);
    [[nodiscard]] std::uint64_t size() const { return member_.bytes; }
    [[nodiscard]] std::string bytes(std::uint64_t at, std::uint64_t count) const;

  private:
    const ZipArchive& archive_;
    const ZipMember member_;
    std::uint64_t data_at_;
    std::unique_ptr<InflatedStream> unpacked_; ///< null: stored
};

} // namespace scanshade
