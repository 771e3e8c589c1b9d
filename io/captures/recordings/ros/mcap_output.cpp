#include "io/captures/recordings/ros/mcap_output.h"
#include "io/captures/recordings/ros/mcap_records.h"

#include "io/file_bytes.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <zlib.h>
#include <zstd.h>

namespace scanshade::ros {

namespace fs = std::filesystem;

namespace {

static_assert(std::endian::native == std::endian::little, "MCAP's numbers are little-endian");

constexpr std::string_view magic = "\x89MCAP0\r\n";
constexpr std::string_view group_name = "scanshade/frame"; ///< of the metadata record that begins a group
constexpr std::size_t record_start = 9;                    ///< operation code and length
constexpr std::size_t largest_chunk = 4 << 20;

template <class Number>
void append(std::string& bytes, Number value) {
    const auto raw = std::bit_cast<std::array<char, sizeof value>>(value);
    bytes.append(raw.data(), raw.size());
}

void append_text(std::string& bytes, std::string_view text) {
    append(bytes, static_cast<std::uint32_t>(text.size()));
    bytes += text;
}

template <class Key, class Value>
std::string map_bytes(const std::map<Key, Value>& map) {
    std::string bytes;
    for (const auto& [key, value] : map) {
        append(bytes, key);
        append(bytes, value);
    }
    return bytes;
}

std::string record(Op op, std::string_view content) {
    std::string bytes;
    bytes.reserve(record_start + content.size());
    append(bytes, static_cast<std::uint8_t>(op));
    append(bytes, static_cast<std::uint64_t>(content.size()));
    bytes += content;
    return bytes;
}

std::uint32_t checksum(std::string_view bytes, std::uint32_t before = 0) {
    return static_cast<std::uint32_t>(
        crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<z_size_t>(bytes.size())));
}

template <class Number>
void put(std::string& bytes, std::size_t at, Number value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

/// A record of messages before its data.
std::string message_head(const NewMessage& message) {
    constexpr std::size_t numbers = 22;
    std::string head;
    append(head, static_cast<std::uint8_t>(Op::message));
    append(head, static_cast<std::uint64_t>(numbers + message.data.size()));
    append(head, message.channel);
    append(head, message.sequence);
    append(head, message.time_ns);
    append(head, message.time_ns);
    return head;
}

/// The records of a chunk, piece by piece: they are as large as a cloud, so they are never put together.
struct Pieces {
    std::vector<std::string> heads;
    std::vector<std::string_view> all;
    std::uint64_t size = 0;
};

Pieces pieces_of(std::span<const NewMessage> messages) {
    Pieces pieces;
    for (const NewMessage& message : messages)
        pieces.heads.push_back(message_head(message));
    for (std::size_t i = 0; i < messages.size(); ++i)
        for (const std::string_view piece : {std::string_view(pieces.heads[i]), std::string_view(messages[i].data)}) {
            pieces.all.push_back(piece);
            pieces.size += piece.size();
        }
    return pieces;
}

/// Appends the pieces packed; returns how many bytes that took.
std::size_t append_packed(std::string& bytes, const Pieces& pieces) {
    const auto check = [](std::size_t code) {
        if (ZSTD_isError(code))
            throw std::runtime_error(fmt::format("zstd: {}", ZSTD_getErrorName(code)));
        return code;
    };
    const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(), &ZSTD_freeCCtx);
    if (!context)
        throw std::bad_alloc();
    // Points become half as large or less at level 1; images are packed already.
    check(ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, 1));
    check(ZSTD_CCtx_setPledgedSrcSize(context.get(), pieces.size));
    const std::size_t at = bytes.size();
    bytes.resize(at + ZSTD_compressBound(pieces.size));
    ZSTD_outBuffer out{bytes.data() + at, bytes.size() - at, 0};
    for (const std::string_view piece : pieces.all) {
        ZSTD_inBuffer in{piece.data(), piece.size(), 0};
        while (in.pos < in.size)
            check(ZSTD_compressStream2(context.get(), &out, &in, ZSTD_e_continue));
    }
    ZSTD_inBuffer nothing{nullptr, 0, 0};
    while (check(ZSTD_compressStream2(context.get(), &out, &nothing, ZSTD_e_end)) != 0)
        continue;
    bytes.resize(at + out.pos);
    return out.pos;
}

/// Messages of one chunk, packed, with their index.
void append_chunk(std::string& group, std::span<const NewMessage> messages) {
    const Pieces pieces = pieces_of(messages);
    std::map<std::uint16_t, std::string> index;
    std::uint64_t start = std::numeric_limits<std::uint64_t>::max(), end = 0, at = 0;
    for (std::size_t i = 0; i < messages.size(); ++i) {
        std::string& places = index[messages[i].channel];
        append(places, messages[i].time_ns);
        append(places, at);
        at += pieces.heads[i].size() + messages[i].data.size();
        start = std::min(start, messages[i].time_ns);
        end = std::max(end, messages[i].time_ns);
    }
    std::uint32_t sum = 0;
    for (const std::string_view piece : pieces.all)
        sum = checksum(piece, sum);

    const std::size_t begin = group.size();
    std::size_t packed_at = 0;
    const auto append_head = [&](std::string_view compression) {
        group.resize(begin);
        group += record(Op::chunk, "");
        append(group, start);
        append(group, end);
        append(group, pieces.size);
        append(group, sum);
        append_text(group, compression);
        packed_at = group.size();
        append(group, std::uint64_t(0));
    };
    append_head("zstd");
    // Readers, ours among them, take a chunk that grows a thousandfold for damage or malice: empty images stay as they
    // are.
    constexpr std::size_t most_ratio = 500;
    if (pieces.size / most_ratio >= append_packed(group, pieces)) {
        append_head("");
        for (const std::string_view piece : pieces.all)
            group += piece;
    }
    put(group, packed_at, static_cast<std::uint64_t>(group.size() - packed_at - sizeof(std::uint64_t)));
    put(group, begin + 1, static_cast<std::uint64_t>(group.size() - begin - record_start));
    for (const auto& [channel, places] : index) {
        std::string row;
        append(row, channel);
        append_text(row, places);
        group += record(Op::message_index, row);
    }
}

/// The content of the metadata record that begins a group. Its length depends on the name alone.
std::string group_head(const std::string& name, std::string_view chunks) {
    std::string rows;
    for (const auto& [key, value] :
         std::map<std::string, std::string>{{"bytes", fmt::format("{:020}", chunks.size())},
                                            {"crc32", fmt::format("{:08x}", checksum(chunks))},
                                            {"name", name}}) {
        append_text(rows, key);
        append_text(rows, value);
    }
    std::string content;
    append_text(content, group_name);
    append_text(content, rows);
    return content;
}

struct GroupHead {
    std::string name, crc32;
    std::uint64_t bytes = 0;
};

/// Nothing where a metadata record is another one.
std::optional<GroupHead> group_head_in(std::string_view content) {
    RecordContent parts(content);
    if (parts.text() != group_name)
        return std::nullopt;
    GroupHead head;
    for (RecordContent rows(parts.text()); rows.more();) {
        const std::string_view key = rows.text(), value = rows.text();
        if (key == "name")
            head.name = value;
        else if (key == "crc32")
            head.crc32 = value;
        else if (key == "bytes")
            head.bytes = whole_number(value).value_or(0);
    }
    return head;
}

} // namespace

std::string packed_group(const std::string& name, const std::vector<NewMessage>& messages) {
    std::string group = record(Op::metadata, group_head(name, "")); // filled in when its numbers are known
    const std::size_t chunks_at = group.size();
    const std::span<const NewMessage> all(messages);
    for (std::size_t first = 0; first < all.size();) {
        std::size_t end = first + 1, size = all[first].data.size();
        while (end < all.size() && size + all[end].data.size() <= largest_chunk)
            size += all[end++].data.size();
        append_chunk(group, all.subspan(first, end - first));
        first = end;
    }
    const std::string head = record(Op::metadata, group_head(name, std::string_view(group).substr(chunks_at)));
    group.replace(0, chunks_at, head);
    return group;
}

std::vector<GroupPlace> groups_in(const fs::path& path) {
    std::vector<GroupPlace> groups;
    const FileBytes file(path);
    const auto left = [&](std::uint64_t at) { return file.size() - std::min(at, file.size()); };
    if (file.size() < magic.size() || file.bytes(0, magic.size()) != magic)
        return groups;
    constexpr std::uint64_t longest_head = 1 << 20;
    for (std::uint64_t at = magic.size(); left(at) >= record_start;) {
        const std::string start = file.bytes(at, record_start);
        RecordContent parts(start);
        const auto op = static_cast<Op>(parts.next<std::uint8_t>());
        const auto size = parts.next<std::uint64_t>();
        const std::uint64_t content_at = at + record_start;
        if (size > left(content_at) || op == Op::data_end)
            break;
        std::optional<GroupHead> head;
        if (op == Op::metadata && size <= longest_head) {
            try {
                const std::string content = file.bytes(content_at, size);
                head = group_head_in(content);
            } catch (const Outage&) {
                throw;
            } catch (const Error&) { // somebody else's
            }
        }
        const std::uint64_t begin = std::exchange(at, content_at + size);
        if (!head)
            continue;
        if (head->bytes > left(at))
            break;
        std::uint32_t sum = 0;
        constexpr std::uint64_t step = 1 << 22;
        for (std::uint64_t done = 0; done < head->bytes; done += step)
            sum = checksum(file.bytes(at + done, std::min(step, head->bytes - done)), sum);
        at += head->bytes;
        if (fmt::format("{:08x}", sum) == head->crc32)
            groups.push_back({head->name, begin, at - begin});
    }
    return groups;
}

namespace {

/// Does not follow a symbolic link in the file's place.
std::FILE* created(const fs::path& file) {
    const int handle = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0666);
    return handle < 0 ? nullptr : ::fdopen(handle, "wb");
}

} // namespace

McapOutput::McapOutput(fs::path file, const std::string& library, std::vector<Channel> channels)
    : file_(std::move(file)), stream_(created(file_), &std::fclose), channels_(std::move(channels)) {
    if (!stream_)
        throw Outage(fmt::format("{}: cannot be created: {}", file_.string(), std::generic_category().message(errno)));
    write(magic);
    std::string content;
    append_text(content, "ros2");
    append_text(content, library);
    write(record(Op::header, content));
}

void McapOutput::write(std::string_view bytes) {
    if (std::fwrite(bytes.data(), 1, bytes.size(), stream_.get()) != bytes.size())
        throw Outage(fmt::format("{}: not written: {}", file_.string(), std::generic_category().message(errno)));
    checksum_ = checksum(bytes, checksum_);
    at_ += bytes.size();
}

void McapOutput::flush() {
    if (std::fflush(stream_.get()) != 0)
        throw Outage(fmt::format("{}: not written: {}", file_.string(), std::generic_category().message(errno)));
}

std::uint16_t McapOutput::schema_of(std::uint16_t channel) const {
    const auto first = std::ranges::find(channels_, channels_.at(channel - 1U).type, &Channel::type);
    return static_cast<std::uint16_t>(first - channels_.begin() + 1);
}

std::string McapOutput::schema_record(std::uint16_t channel) const {
    const Channel& row = channels_.at(channel - 1U);
    std::string content;
    append(content, schema_of(channel));
    append_text(content, row.type);
    append_text(content, "ros2msg");
    append_text(content, row.definition);
    return record(Op::schema, content);
}

std::string McapOutput::channel_record(std::uint16_t channel) const {
    std::string content;
    append(content, channel);
    append(content, schema_of(channel));
    append_text(content, channels_.at(channel - 1U).topic);
    append_text(content, "cdr");
    append_text(content, ""); // no metadata
    return record(Op::channel, content);
}

void McapOutput::declare(std::uint16_t channel) {
    if (channel == 0 || channel > channels_.size())
        throw Error(fmt::format("a message of channel {}, of {}", channel, channels_.size()));
    if (counts_.contains(channel))
        return;
    const bool known =
        std::ranges::any_of(counts_, [&](const auto& count) { return schema_of(count.first) == schema_of(channel); });
    if (!known)
        write(schema_record(channel));
    write(channel_record(channel));
    counts_[channel] = 0;
}

void McapOutput::add(std::string_view group) {
    struct Found {
        ChunkFacts facts;
        std::size_t at = 0; ///< in the group
    };
    std::vector<Found> chunks;
    std::vector<MetadataFacts> metadata;
    std::map<std::uint16_t, std::uint64_t> counts;
    for (RecordContent parts(group); parts.more();) {
        const std::size_t begin = parts.at();
        const auto op = static_cast<Op>(parts.next<std::uint8_t>());
        RecordContent content(parts.take(parts.next<std::uint64_t>()));
        const std::uint64_t length = parts.at() - begin;
        if (op == Op::metadata) {
            metadata.push_back({begin, length});
        } else if (op == Op::chunk) {
            ChunkFacts facts;
            facts.start_ns = content.next<std::uint64_t>();
            facts.end_ns = content.next<std::uint64_t>();
            facts.size = content.next<std::uint64_t>();
            content.next<std::uint32_t>();
            facts.compression = content.text();
            facts.packed = content.next<std::uint64_t>();
            facts.length = length;
            chunks.push_back({facts, begin});
        } else if (op == Op::message_index && !chunks.empty()) {
            constexpr std::size_t row = 2 * sizeof(std::uint64_t);
            const auto channel = content.next<std::uint16_t>();
            counts[channel] += content.text().size() / row;
            chunks.back().facts.index_at[channel] = begin;
            chunks.back().facts.index_length += length;
        } else {
            throw Error(fmt::format("a record of kind {} in a group of messages", static_cast<int>(op)));
        }
    }
    for (const auto& [channel, count] : counts) {
        declare(channel);
        counts_[channel] += count;
    }
    for (MetadataFacts& each : metadata) {
        each.at += at_;
        metadata_.push_back(each);
    }
    for (Found& found : chunks) {
        found.facts.at = at_ + found.at;
        for (auto& [channel, place] : found.facts.index_at)
            place += at_;
        chunks_.push_back(std::move(found.facts));
    }
    write(group);
}

std::uint64_t McapOutput::messages() const {
    std::uint64_t sum = 0;
    for (const auto& [channel, count] : counts_)
        sum += count;
    return sum;
}

std::string McapOutput::statistics_record() const {
    std::set<std::uint16_t> schemas;
    for (const auto& [channel, count] : counts_)
        schemas.insert(schema_of(channel));
    std::uint64_t start = chunks_.empty() ? 0 : std::numeric_limits<std::uint64_t>::max(), end = 0;
    for (const ChunkFacts& chunk : chunks_) {
        start = std::min(start, chunk.start_ns);
        end = std::max(end, chunk.end_ns);
    }
    std::string content;
    append(content, messages());
    append(content, static_cast<std::uint16_t>(schemas.size()));
    append(content, static_cast<std::uint32_t>(counts_.size()));
    append(content, std::uint32_t(0)); // attachments
    append(content, static_cast<std::uint32_t>(metadata_.size()));
    append(content, static_cast<std::uint32_t>(chunks_.size()));
    append(content, start);
    append(content, end);
    append_text(content, map_bytes(counts_));
    return record(Op::statistics, content);
}

void McapOutput::finish() {
    std::string end_of_data;
    append(end_of_data, checksum_);
    write(record(Op::data_end, end_of_data));

    const std::uint64_t summary_at = at_;
    checksum_ = 0; // the summary's own begins here
    std::string offsets;
    const auto write_rows = [&](Op op, const auto& rows) {
        const std::uint64_t start = at_;
        rows();
        if (at_ == start)
            return;
        std::string content;
        append(content, static_cast<std::uint8_t>(op));
        append(content, start);
        append(content, at_ - start);
        offsets += record(Op::summary_offset, content);
    };
    write_rows(Op::schema, [&] {
        std::set<std::uint16_t> written;
        for (const auto& [channel, count] : counts_)
            if (written.insert(schema_of(channel)).second)
                write(schema_record(channel));
    });
    write_rows(Op::channel, [&] {
        for (const auto& [channel, count] : counts_)
            write(channel_record(channel));
    });
    write_rows(Op::statistics, [&] { write(statistics_record()); });
    write_rows(Op::chunk_index, [&] {
        for (const ChunkFacts& chunk : chunks_) {
            std::string content;
            append(content, chunk.start_ns);
            append(content, chunk.end_ns);
            append(content, chunk.at);
            append(content, chunk.length);
            append_text(content, map_bytes(chunk.index_at));
            append(content, chunk.index_length);
            append_text(content, chunk.compression);
            append(content, chunk.packed);
            append(content, chunk.size);
            write(record(Op::chunk_index, content));
        }
    });
    write_rows(Op::metadata_index, [&] {
        for (const MetadataFacts& each : metadata_) {
            std::string content;
            append(content, each.at);
            append(content, each.length);
            append_text(content, group_name);
            write(record(Op::metadata_index, content));
        }
    });
    const std::uint64_t offsets_at = at_;
    write(offsets);
    // The footer's own numbers count for the checksum, up to the checksum itself.
    std::string footer;
    append(footer, static_cast<std::uint8_t>(Op::footer));
    append(footer, static_cast<std::uint64_t>(2 * sizeof(std::uint64_t) + sizeof(std::uint32_t)));
    append(footer, summary_at);
    append(footer, offsets_at);
    append(footer, checksum(footer, checksum_));
    write(footer);
    write(magic);
    if (std::fclose(stream_.release()) != 0)
        throw Outage(fmt::format("{}: not written: {}", file_.string(), std::generic_category().message(errno)));
}

} // namespace scanshade::ros
