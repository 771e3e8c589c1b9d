#include "io/compression/zip_archive.h"

#include "io/checksum.h"
#include "io/compression/inflate.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <optional>
#include <zlib.h>

namespace scanshade {

namespace {

constexpr std::uint64_t most_members = 1 << 22, member_header = 30, directory_row = 46, end_record = 22,
                        end_locator = 20, end_record_64 = 56, longest_comment = 1 << 16;
constexpr std::uint32_t in_zip64 = 0xffffffff;
enum Method : std::uint16_t { stored = 0, by_deflate = 8 };
enum Flag : std::uint16_t { encrypted = 1, sizes_follow = 8 };

template <class Number>
Number number_at(std::string_view bytes, std::uint64_t at) {
    Number value{};
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

/// The zip64 field replaces the sizes that are all ones, in this order.
void take_zip64(std::string_view extra, std::initializer_list<std::uint64_t*> numbers) {
    while (extra.size() >= 4) {
        const auto id = number_at<std::uint16_t>(extra, 0), size = number_at<std::uint16_t>(extra, 2);
        std::string_view field = extra.substr(4, size);
        extra.remove_prefix(std::min<std::size_t>(extra.size(), 4U + size));
        if (id != 1)
            continue;
        for (std::uint64_t* value : numbers)
            if (*value == in_zip64 && field.size() >= sizeof(std::uint64_t)) {
                *value = number_at<std::uint64_t>(field, 0);
                field.remove_prefix(sizeof(std::uint64_t));
            }
        return;
    }
}

struct Directory {
    std::uint64_t at = 0, bytes = 0, members = 0;
};

/// As the record at the file's end says.
std::optional<Directory> directory_of(const FileBytes& file) {
    const std::uint64_t tail = std::min(file.size(), end_record + longest_comment + end_locator);
    const std::string end = file.bytes(file.size() - tail, tail);
    const std::size_t at = end.rfind("PK\5\6");
    if (at == std::string::npos || end.size() - at < end_record)
        return std::nullopt;
    Directory directory{number_at<std::uint32_t>(end, at + 16), number_at<std::uint32_t>(end, at + 12),
                        number_at<std::uint16_t>(end, at + 10)};
    const std::uint64_t record_at = file.size() - tail + at;
    if (at >= end_locator && end.compare(at - end_locator, 4, "PK\6\7") == 0) {
        const auto far_at = number_at<std::uint64_t>(end, at - end_locator + 8);
        if (file.size() < end_record_64 || far_at > file.size() - end_record_64)
            return std::nullopt;
        const std::string far = file.bytes(far_at, end_record_64);
        if (!far.starts_with("PK\6\6"))
            return std::nullopt;
        directory = {number_at<std::uint64_t>(far, 48), number_at<std::uint64_t>(far, 40),
                     number_at<std::uint64_t>(far, 32)};
    }
    if (directory.at > record_at || directory.bytes > record_at - directory.at ||
        directory.members > directory.bytes / directory_row)
        return std::nullopt;
    return directory;
}

} // namespace

bool is_zip(std::string_view start) { return start.starts_with("PK\3\4"); }

ZipArchive::ZipArchive(const std::filesystem::path& path) : file_(path) {
    if (!list_by_directory()) {
        members_.clear();
        list_by_members();
    }
    for (std::size_t i = 0; i < members_.size(); ++i)
        by_name_.emplace(members_[i].name, i);
}

bool ZipArchive::list_by_directory() {
    const auto directory = directory_of(file_);
    if (!directory)
        return false;
    if (directory->members > most_members)
        throw Error(
            fmt::format("{}: {} members, expected at most {}", path().string(), directory->members, most_members));
    const std::string rows = file_.bytes(directory->at, directory->bytes);
    std::uint64_t at = 0;
    for (std::uint64_t i = 0; i < directory->members; ++i) {
        if (rows.size() - at < directory_row || rows.compare(at, 4, "PK\1\2") != 0)
            return false;
        const std::uint64_t name = number_at<std::uint16_t>(rows, at + 28),
                            extra = number_at<std::uint16_t>(rows, at + 30),
                            comment = number_at<std::uint16_t>(rows, at + 32);
        if (rows.size() - at - directory_row < name + extra + comment)
            return false;
        ZipMember member;
        member.flags = number_at<std::uint16_t>(rows, at + 8);
        member.method = number_at<std::uint16_t>(rows, at + 10);
        member.crc = number_at<std::uint32_t>(rows, at + 16);
        member.packed_bytes = number_at<std::uint32_t>(rows, at + 20);
        member.bytes = number_at<std::uint32_t>(rows, at + 24);
        member.header_at = number_at<std::uint32_t>(rows, at + 42);
        member.name = rows.substr(at + directory_row, name);
        take_zip64(std::string_view(rows).substr(at + directory_row + name, extra),
                   {&member.bytes, &member.packed_bytes, &member.header_at});
        members_.push_back(std::move(member));
        at += directory_row + name + extra + comment;
    }
    return true;
}

void ZipArchive::list_by_members() {
    damage_ = fmt::format("{}: the list of members at its end is missing or damaged; those that are whole are used",
                          path().string());
    std::uint64_t at = 0;
    while (file_.size() - at >= member_header && members_.size() < most_members) {
        const std::string header = file_.bytes(at, member_header);
        if (!header.starts_with("PK\3\4"))
            break;
        ZipMember member;
        member.header_at = at;
        member.flags = number_at<std::uint16_t>(header, 6);
        member.method = number_at<std::uint16_t>(header, 8);
        member.crc = number_at<std::uint32_t>(header, 14);
        member.packed_bytes = number_at<std::uint32_t>(header, 18);
        member.bytes = number_at<std::uint32_t>(header, 22);
        const std::uint64_t name = number_at<std::uint16_t>(header, 26), extra = number_at<std::uint16_t>(header, 28);
        if ((member.flags & sizes_follow) || file_.size() - at - member_header < name + extra)
            break;
        const std::string rest = file_.bytes(at + member_header, name + extra);
        member.name = rest.substr(0, name);
        take_zip64(std::string_view(rest).substr(name), {&member.bytes, &member.packed_bytes});
        const std::uint64_t left = file_.size() - at - member_header - name - extra;
        if (member.packed_bytes > left)
            break;
        at = file_.size() - left + member.packed_bytes;
        members_.push_back(std::move(member));
    }
}

const ZipMember* ZipArchive::find(const std::string& name) const {
    const auto found = by_name_.find(name);
    return found == by_name_.end() ? nullptr : &members_[found->second];
}

std::string ZipArchive::where(const ZipMember& member) const {
    return fmt::format("{}: {} at byte {}", path().string(), in_quotes(member.name), member.header_at);
}

std::uint64_t ZipArchive::data_at(const ZipMember& member) const {
    if (member.flags & encrypted)
        throw Error(where(member) + ": encrypted, expected a member that is not");
    if (member.method != stored && member.method != by_deflate)
        throw Error(
            fmt::format("{}: packed by method {}, expected 0 (stored) or 8 (deflated)", where(member), member.method));
    if (file_.size() < member_header || member.header_at > file_.size() - member_header)
        throw Error(fmt::format("{}: the file ends at byte {}", where(member), file_.size()));
    const std::string header = file_.bytes(member.header_at, member_header);
    if (!header.starts_with("PK\3\4"))
        throw Error(where(member) + ": no member begins there");
    const std::uint64_t at =
        member.header_at + member_header + number_at<std::uint16_t>(header, 26) + number_at<std::uint16_t>(header, 28);
    if (at > file_.size() || member.packed_bytes > file_.size() - at)
        throw Error(fmt::format("{}: {} expected, the file ends at byte {}", where(member),
                                counted(member.packed_bytes, "packed byte"), file_.size()));
    if (member.method == stored && member.packed_bytes != member.bytes)
        throw Error(
            fmt::format("{}: stored as {} of {}", where(member), counted(member.packed_bytes, "byte"), member.bytes));
    return at;
}

std::string ZipArchive::bytes(const ZipMember& member, std::uint64_t most) const {
    if (member.bytes > most)
        throw Error(fmt::format("{}: {}, expected at most {}", where(member), counted(member.bytes, "byte"), most));
    std::string all = file_.bytes(data_at(member), member.packed_bytes);
    if (member.method == by_deflate)
        all = during(where(member), [&] { return inflated(all, Inflate::raw, member.bytes); });
    if (all.size() != member.bytes)
        throw Error(fmt::format("{}: {}, expected {}", where(member), counted(all.size(), "byte"), member.bytes));
    uLong crc = crc32(0, nullptr, 0);
    for (std::size_t at = 0; at < all.size();) {
        const auto part = static_cast<uInt>(std::min<std::size_t>(all.size() - at, std::numeric_limits<uInt>::max()));
        crc = crc32(crc, reinterpret_cast<const Bytef*>(all.data() + at), part);
        at += part;
    }
    if (!sums_agree(static_cast<std::uint32_t>(crc), member.crc))
        throw Error(fmt::format("{}: checksum {:08x}, expected {:08x}", where(member), crc, member.crc));
    return all;
}

ZipMemberStream::ZipMemberStream(const ZipArchive& archive, const ZipMember& member)
    : archive_(archive), member_(member), data_at_(archive.data_at(member)) {
    if (member.method == stored) // parts are read as they are asked for, so its checksum is never known
        return;
    unpacked_ = std::make_unique<InflatedStream>(archive.file_, data_at_, member.packed_bytes, member.bytes);
    if (unpacked_->size() != member.bytes && unpacked_->damage().empty())
        throw Error(fmt::format("{}: {}, expected {}", archive.where(member), counted(unpacked_->size(), "byte"),
                                member.bytes));
    if (!unpacked_->damage().empty())
        throw Error(fmt::format("{}: {}", archive.where(member), unpacked_->damage()));
    if (!sums_agree(unpacked_->crc(), member.crc))
        throw Error(
            fmt::format("{}: checksum {:08x}, expected {:08x}", archive.where(member), unpacked_->crc(), member.crc));
}

std::string ZipMemberStream::bytes(std::uint64_t at, std::uint64_t count) const {
    if (unpacked_)
        return unpacked_->bytes(at, count);
    if (at > member_.bytes || count > member_.bytes - at)
        throw Error(fmt::format("{}: bytes {} to {} are not there, it has {}", archive_.where(member_), at, at + count,
                                member_.bytes));
    return archive_.file_.bytes(data_at_ + at, count);
}

} // namespace scanshade
