// A tar's headers, walked once. Formats: POSIX.1-2001 (ustar, pax), GNU tar's manual, "Basic Tar Format".
#include "io/tar_index.h"

#include "io/checksum.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <numeric>

namespace scanshade {

namespace {

constexpr std::uint64_t block_bytes = 512;
constexpr std::size_t longest_member_name = 4096;
constexpr std::uint64_t longest_extension = 1 << 20; // of a pax header or a long name
constexpr std::size_t most_members = 1 << 24;

struct Field {
    std::size_t at, bytes;
};
constexpr Field name_field{0, 100}, size_field{124, 12}, checksum_field{148, 8}, link_field{157, 100},
    magic_field{257, 5}, prefix_field{345, 155};
constexpr std::size_t kind_at = 156, more_sparse_at = 482, more_sparse_in_next_at = 504;

std::string_view in(std::string_view block, Field field) { return block.substr(field.at, field.bytes); }

/// Up to the first NUL.
std::string_view text_in(std::string_view block, Field field) {
    const std::string_view whole = in(block, field);
    return whole.substr(0, whole.find('\0'));
}

/// Octal digits, or base 256 where the first bit is set. Nothing for what is no number below 2^63.
std::optional<std::uint64_t> number_in(std::string_view field) {
    std::uint64_t value = 0;
    if (const auto first = static_cast<unsigned char>(field[0]); first & 0x80) {
        value = first & 0x7f; // 0x40 is the sign
        for (const char c : field.substr(1)) {
            if (value >> 55 != 0)
                return std::nullopt;
            value = value << 8 | static_cast<unsigned char>(c);
        }
        return value;
    }
    const std::string_view digits = trimmed(field.substr(0, field.find('\0')));
    for (const char c : digits) {
        if (c < '0' || c > '7' || value >> 60 != 0)
            return std::nullopt;
        value = value << 3 | static_cast<std::uint64_t>(c - '0');
    }
    return value;
}

bool is_zero(std::string_view block) {
    return std::ranges::all_of(block, [](char c) { return c == 0; });
}

/// Of 512 bytes. The checksum counts its own field as blanks; some programs added signed bytes.
bool is_header(std::string_view block) {
    const auto stated = number_in(in(block, checksum_field));
    if (!stated || block[0] == 0)
        return false;
    std::uint64_t sum = 0;
    std::int64_t signed_sum = 0;
    for (std::size_t i = 0; i < block.size(); ++i) {
        const char c = i >= checksum_field.at && i < checksum_field.at + checksum_field.bytes ? ' ' : block[i];
        sum += static_cast<unsigned char>(c);
        signed_sum += static_cast<signed char>(c);
    }
    return sums_agree(sum, *stated) || static_cast<std::int64_t>(*stated) == signed_sum;
}

/// '/' before every other character, so that a folder's content follows it at once.
bool path_less(std::string_view a, std::string_view b) {
    const auto [left, right] = std::mismatch(a.begin(), a.end(), b.begin(), b.end());
    if (left == a.end() || right == b.end())
        return left == a.end() && right != b.end();
    const auto rank = [](char c) { return c == '/' ? 0 : 1 + static_cast<unsigned char>(c); };
    return rank(*left) < rank(*right);
}

/// Without "." and empty parts. Nothing for names that lead out of the archive, or that no file can have.
std::optional<std::string> clean_name(std::string_view name) {
    if (name.starts_with('/') || name.find('\0') != std::string_view::npos)
        return std::nullopt;
    std::string clean;
    clean.reserve(name.size());
    for (std::size_t at = 0; at < name.size();) {
        const std::size_t end = std::min(name.find('/', at), name.size());
        const std::string_view part = name.substr(at, end - at);
        at = end + 1;
        if (part.empty() || part == ".")
            continue;
        if (part == "..")
            return std::nullopt;
        if (!clean.empty())
            clean += '/';
        clean += part;
    }
    if (clean.size() > longest_member_name)
        return std::nullopt;
    return clean;
}

/// What extended headers say of the member that follows them.
struct Extension {
    std::optional<std::string> name, link;
    std::optional<std::uint64_t> size;
    bool sparse = false;
    bool damaged = false;
    void take_pax(std::string_view records);
};

/// Records "LENGTH KEY=VALUE\n"; the length counts all of it.
void Extension::take_pax(std::string_view records) {
    while (!records.empty()) {
        const std::size_t blank = records.find(' ');
        const auto length = whole_number(records.substr(0, blank));
        if (blank == std::string_view::npos || !length || *length > records.size() || *length < blank + 3 ||
            records[*length - 1] != '\n') {
            damaged = true;
            return;
        }
        const std::string_view record = records.substr(blank + 1, *length - blank - 2);
        records.remove_prefix(*length);
        const std::size_t equals = record.find('=');
        if (equals == std::string_view::npos) {
            damaged = true;
            return;
        }
        const std::string_view key = record.substr(0, equals), value = record.substr(equals + 1);
        if (key == "path" && !sparse)
            name = value;
        else if (key == "linkpath")
            link = value;
        else if (key == "size") {
            size = whole_number(value);
            damaged = damaged || !size;
        } else if (key.starts_with("GNU.sparse.")) {
            sparse = true;
            if (key == "GNU.sparse.name")
                name = value;
        }
    }
}

/// Members of one sort, told in one sentence.
struct Sort {
    std::size_t count = 0;
    std::string first;
    void add(std::string_view name) {
        if (count++ == 0)
            first = in_quotes(name);
    }
    [[nodiscard]] std::string described() const {
        return count == 1 ? first : fmt::format("{} and {} more", first, count - 1);
    }
};

} // namespace

bool begins_as_tar(std::string_view start) {
    return start.size() >= block_bytes && is_header(start.substr(0, block_bytes));
}

/// The walk through the headers.
class TarIndex::Reader {
  public:
    explicit Reader(TarIndex& index) : index_(index), file_(index.file_) {}

    void read() {
        while (file_.size() - at_ >= block_bytes && read_member())
            ;
        if (const std::uint64_t left = at_ < file_.size() ? file_.size() - at_ : 0;
            left > 0 && left < block_bytes && !is_zero(file_.bytes(at_, left)))
            stop("the end of the archive within a header");
        tell();
    }

  private:
    /// 512 bytes; valid until the next call.
    std::string_view block(std::uint64_t at) {
        if (at < window_at_ || at + block_bytes > window_at_ + window_.size()) {
            // Headers of small members lie close together; large members are passed without being read.
            const std::uint64_t wanted = close_ ? 1 << 18 : 1 << 10;
            window_ = file_.bytes(at, std::min(wanted, file_.size() - at));
            window_at_ = at;
        }
        return std::string_view(window_).substr(at - window_at_, block_bytes);
    }

    /// To the first block after one of zeros that is none. Tars end with two, filled up to a record of any size;
    /// another tar may follow, as `cat` joins them.
    bool pass_zeros() {
        constexpr std::uint64_t most = 1 << 21;
        for (const std::uint64_t end = at_ + std::min(most, file_.size() - at_); end - at_ >= block_bytes;
             at_ += block_bytes)
            if (!is_zero(block(at_)))
                return true;
        return false;
    }

    bool stop(const std::string& why) {
        index_.oddities_.push_back(
            fmt::format("{}: {} at byte {}; what follows is not read.", file_.path().string(), why, at_));
        return false;
    }

    bool read_member() {
        std::string_view header = block(at_);
        if (header[0] == 0 && is_zero(header)) {
            if (!pass_zeros())
                return false;
            header = block(at_);
        }
        if (!is_header(header))
            return stop("no header of a tar");
        const auto stated = number_in(in(header, size_field));
        if (!stated)
            return stop("a size that is no number");
        const char kind = header[kind_at];
        std::uint64_t data_at = at_ + block_bytes;
        if (kind == 'x' || kind == 'g' || kind == 'L' || kind == 'K')
            return read_extension(kind, *stated, data_at);

        Extension known = std::exchange(next_, {});
        std::string name = known.name ? *std::move(known.name) : plain_name(header);
        const std::string link = known.link ? *std::move(known.link) : std::string(text_in(header, link_field));
        std::uint64_t size = known.size.value_or(*stated);
        if (kind == 'S') { // its map of holes may need further blocks
            known.sparse = true;
            for (bool more = header[more_sparse_at] != 0; more; data_at += block_bytes) {
                if (file_.size() - data_at < block_bytes)
                    return stop("a map of holes that is cut");
                more = block(data_at)[more_sparse_in_next_at] != 0;
            }
        }
        const bool is_folder = kind == '5' || ((kind == 0 || kind == '0') && name.ends_with('/'));
        if (is_folder || kind == '2' || kind == '3' || kind == '4' || kind == '6' ||
            (kind == '1' && file_.size() - data_at >= block_bytes && is_header(block(data_at))))
            size = 0; // whatever is stated: no data follow

        const auto clean = known.damaged ? std::nullopt : clean_name(name);
        const std::uint64_t left = file_.size() - data_at;
        if (!clean)
            left_out_.add(name);
        else if (is_folder && !clean->empty())
            add(*clean, Kind::folder, 0, 0);
        else if (clean->empty()) // "./"
            ;
        else if (kind == '1' || kind == '2')
            add_link(*clean, kind == '1' ? Kind::hard_link : Kind::symbolic_link, link);
        else if (kind == 0 || kind == '0' || kind == '7' || kind == 'S')
            add(*clean, known.sparse ? Kind::sparse : size > left ? Kind::cut : Kind::file, data_at, size);
        else
            others_.add(*clean);
        if (size > left) {
            index_.oddities_.push_back(fmt::format("{}: it ends in {}, which has {} of {} bytes; it is cut, or damaged "
                                                   "at byte {}.",
                                                   file_.path().string(), in_quotes(name), left, size, at_));
            return false;
        }
        return go_on(data_at, size);
    }

    [[nodiscard]] static std::string plain_name(std::string_view header) {
        const bool ustar = in(header, magic_field) == "ustar", gnu = ustar && header[magic_field.at + 5] == ' ';
        const std::string_view prefix = ustar && !gnu ? text_in(header, prefix_field) : std::string_view();
        return prefix.empty() ? std::string(text_in(header, name_field))
                              : fmt::format("{}/{}", prefix, text_in(header, name_field));
    }

    bool read_extension(char kind, std::uint64_t size, std::uint64_t data_at) {
        if (size > longest_extension || size > file_.size() - data_at)
            return stop(fmt::format("an extended header of {} bytes, expected at most {}", size,
                                    std::min(longest_extension, file_.size() - data_at)));
        const std::string bytes = file_.bytes(data_at, size);
        const auto text = [&] { return bytes.substr(0, bytes.find('\0')); };
        if (kind == 'x')
            next_.take_pax(bytes);
        else if (kind == 'L')
            next_.name = text();
        else if (kind == 'K')
            next_.link = text();
        return go_on(data_at, size);
    }

    bool go_on(std::uint64_t data_at, std::uint64_t size) {
        close_ = size < 1 << 16;
        at_ = data_at + (size + block_bytes - 1) / block_bytes * block_bytes;
        return at_ <= file_.size();
    }

    void add(std::string_view name, Kind kind, std::uint64_t at, std::uint64_t size) {
        auto& entries = index_.entries_;
        if (entries.size() == most_members)
            throw Error(fmt::format("{}: more than {} members", file_.path().string(), most_members));
        if (entries.size() == entries.capacity())
            require_memory(2 * (entries.size() * sizeof(Entry) + index_.names_.size()),
                           file_.path().string() + ": the list of its members");
        Entry entry{at, size, 0, 0, 0};
        entry.name_at = index_.names_.size() & ((std::uint64_t(1) << 40) - 1);
        entry.name_bytes = name.size() & 0xffff;
        entry.kind = static_cast<std::uint8_t>(kind);
        index_.names_ += name;
        entries.push_back(entry);
    }

    /// A hard link names a member; a symbolic one begins in its own folder.
    void add_link(const std::string& name, Kind kind, const std::string& link) {
        std::optional<std::string> target;
        if (kind == Kind::hard_link)
            target = clean_name(link);
        else if (!link.starts_with('/'))
            target = (std::filesystem::path(name).parent_path() / link).lexically_normal().string();
        if (!target || target->empty() || *target == ".." || target->starts_with("../") ||
            target->size() > longest_member_name) {
            links_out_.add(name);
            return;
        }
        const std::uint64_t at = index_.names_.size();
        index_.names_ += *target;
        add(name, kind, at, target->size());
    }

    void tell() {
        const std::string file = file_.path().string();
        if (left_out_.count > 0)
            index_.oddities_.push_back(fmt::format("{}: {} left out: {} would lie outside, or has a name that no file "
                                                   "can have.",
                                                   file, counted(left_out_.count, "member"), left_out_.described()));
        if (links_out_.count > 0)
            index_.oddities_.push_back(fmt::format("{}: {} that lead out of it, left out: {}.", file,
                                                   counted(links_out_.count, "link"), links_out_.described()));
        if (others_.count > 0)
            index_.oddities_.push_back(fmt::format("{}: {} that are neither files, folders nor links, left out: {}.",
                                                   file, counted(others_.count, "member"), others_.described()));
    }

    TarIndex& index_;
    const FileBytes& file_;
    std::uint64_t at_ = 0;
    std::string window_;
    std::uint64_t window_at_ = 0;
    bool close_ = true; ///< the next header
    Extension next_;
    Sort left_out_, links_out_, others_;
};

TarIndex::TarIndex(const std::filesystem::path& file) : file_(file) {
    Reader(*this).read();
    sort();
    resolve_links();
    names_.shrink_to_fit();
    entries_.shrink_to_fit();
}

/// Of equal names the last stays.
void TarIndex::sort() {
    const auto less = [&](const Entry& a, const Entry& b) {
        const std::string_view left = name_of(a), right = name_of(b);
        return left == right ? a.name_at > b.name_at : path_less(left, right);
    };
    if (!std::ranges::is_sorted(entries_, less)) // most programs write them in order
        std::ranges::sort(entries_, less);
    Sort twice;
    std::string_view last;
    const auto repeated = [&](const Entry& entry) {
        const bool same = !last.empty() && name_of(entry) == last;
        if (same && static_cast<Kind>(entry.kind) != Kind::folder)
            twice.add(last);
        last = name_of(entry);
        return same;
    };
    entries_.erase(std::remove_if(entries_.begin(), entries_.end(), repeated), entries_.end());
    if (twice.count > 0)
        oddities_.push_back(fmt::format("{}: members of one name, of which the last counts: {}.", file_.path().string(),
                                        twice.described()));
}

/// Links get the place of their file. Those that lead to none are removed.
void TarIndex::resolve_links() {
    const auto is_link = [](const Entry& entry) {
        return static_cast<Kind>(entry.kind) == Kind::hard_link || static_cast<Kind>(entry.kind) == Kind::symbolic_link;
    };
    Sort lost;
    for (Entry& entry : entries_) {
        if (!is_link(entry))
            continue;
        const Entry* target = &entry;
        for (int hops = 0; target && is_link(*target) && hops < 16; ++hops)
            target = entry_of(std::string_view(names_).substr(target->at, target->size));
        if (!target || is_link(*target) || static_cast<Kind>(target->kind) == Kind::folder) {
            lost.add(name_of(entry));
            continue;
        }
        const Entry found = *target;
        entry.at = found.at;
        entry.size = found.size;
        entry.kind = found.kind;
    }
    std::erase_if(entries_, is_link);
    if (lost.count > 0)
        oddities_.push_back(fmt::format("{}: {} to no file in it, left out: {}.", file_.path().string(),
                                        counted(lost.count, "link"), lost.described()));
}

const TarIndex::Entry* TarIndex::entry_of(std::string_view name) const {
    const auto found =
        std::ranges::lower_bound(entries_, name, path_less, [&](const Entry& entry) { return name_of(entry); });
    return found != entries_.end() && name_of(*found) == name ? &*found : nullptr;
}

std::vector<TarIndex::Entry>::const_iterator TarIndex::first_below(const std::string& folder_with_slash) const {
    return std::ranges::lower_bound(entries_, std::string_view(folder_with_slash), path_less,
                                    [&](const Entry& entry) { return name_of(entry); });
}

std::optional<TarIndex::Member> TarIndex::find(std::string_view name) const {
    const Entry* const entry = entry_of(name);
    if (!entry || static_cast<Kind>(entry->kind) == Kind::folder) {
        const std::string below = std::string(name) + "/";
        const auto first = first_below(below);
        if (entry || name.empty() || (first != entries_.end() && name_of(*first).starts_with(below)))
            return Member{true, 0, 0, {}};
        return std::nullopt;
    }
    Member member{false, entry->at, entry->size, {}};
    if (static_cast<Kind>(entry->kind) == Kind::sparse)
        member.trouble = "a sparse member, which is not read: unpack the archive with `tar -xf`";
    else if (static_cast<Kind>(entry->kind) == Kind::cut)
        member.trouble = fmt::format("a member of {} bytes, {} of which are in the archive", entry->size,
                                     file_.size() - std::min(file_.size(), entry->at));
    return member;
}

std::vector<FolderItem> TarIndex::items_in(std::string_view folder) const {
    const std::string below = folder.empty() ? std::string() : std::string(folder) + "/";
    std::vector<FolderItem> items;
    const auto add = [&](std::string_view name, FolderItem::Kind kind) {
        if (items.empty() || items.back().name != name)
            items.push_back({std::string(name), kind});
    };
    for (auto at = first_below(below); at != entries_.end() && name_of(*at).starts_with(below);) {
        const std::string_view rest = name_of(*at).substr(below.size());
        const std::size_t slash = rest.find('/');
        if (slash == std::string_view::npos) {
            add(rest, static_cast<Kind>(at->kind) == Kind::folder ? FolderItem::Kind::folder : FolderItem::Kind::file);
            ++at;
            continue;
        }
        add(rest.substr(0, slash), FolderItem::Kind::folder);
        const std::string inside = below + std::string(rest.substr(0, slash + 1));
        at = std::partition_point(at, entries_.end(),
                                  [&](const Entry& entry) { return name_of(entry).starts_with(inside); });
    }
    return items;
}

StoredBytes TarIndex::bytes_of(const Member& member, const std::filesystem::path& path) const {
    if (!member.trouble.empty())
        throw Error(fmt::format("{}: {}", path.string(), member.trouble));
    return file_.part(member.at, member.size);
}

} // namespace scanshade
