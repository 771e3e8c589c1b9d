// MCAP (mcap.dev/spec), as rosbag2 and Foxglove write it: records of an operation code, a length and content. Read from
// front to back, so the summary at the end is not needed.
#include "io/captures/recordings/ros/bag.h"
#include "io/captures/recordings/ros/mcap_records.h"
#include "io/captures/recordings/ros/unpack.h"
#include "io/checksum.h"
#include "io/file_bytes.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cstring>
#include <fmt/format.h>
#include <unordered_map>
#include <zlib.h>

namespace scanshade::ros {

namespace fs = std::filesystem;

namespace {

std::string unpack(std::string_view packed, const Chunk& chunk) {
    return chunk.compression == "zstd" ? unpacked_zstd(packed, chunk.size) : unpacked_lz4(packed, chunk.size);
}

constexpr std::uint32_t in_file = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint64_t magic_bytes = 8, record_start = 9; ///< operation code and length
constexpr std::size_t message_start = 22;                  ///< of a message's content: channel, sequence, two times

class Mcap final : public Bag {
  public:
    explicit Mcap(const fs::path& file) : file_(file), chunks_(file_, unpack) {
        path = file;
        read();
    }

    [[nodiscard]] std::string bytes(const Message& message) const override {
        if (message.chunk == in_file)
            return file_.bytes(message.at, message.size);
        return chunks_.unpacked(message.chunk)->substr(message.at, message.size);
    }

  private:
    /// Schemas and channels of the summary, where there is one: those of a damaged chunk are needed for the others.
    void read_summary() {
        constexpr std::uint64_t footer_bytes = record_start + 20 + magic_bytes, longest_summary = 1 << 26;
        if (file_.size() < magic_bytes + footer_bytes)
            return;
        const std::uint64_t footer = file_.size() - footer_bytes;
        const std::string end = file_.bytes(footer, footer_bytes);
        RecordContent content(end);
        if (static_cast<Op>(content.next<std::uint8_t>()) != Op::footer || content.next<std::uint64_t>() != 20)
            return;
        const auto start = content.next<std::uint64_t>();
        if (start < magic_bytes || start >= footer || footer - start > longest_summary)
            return;
        try {
            const std::string records = file_.bytes(start, footer - start);
            RecordContent summary(records);
            while (summary.at() < records.size()) {
                const auto op = static_cast<Op>(summary.next<std::uint8_t>());
                const std::string_view record = summary.take(summary.next<std::uint64_t>());
                if (op == Op::schema)
                    take_schema(record);
                else if (op == Op::channel)
                    take_channel(record);
            }
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) { // the records before it say the same
            warnings.push_back(fmt::format("{}: summary at byte {}: {}.", path.string(), start, failure.what()));
        }
    }

    void read() {
        read_summary();
        for (std::uint64_t at = magic_bytes;;) {
            const std::uint64_t begin = at;
            try {
                if (file_.size() - std::min(at, file_.size()) < record_start)
                    throw Error(fmt::format("{} are left, expected a record", counted(file_.size() - at, "byte")));
                const std::string head = file_.bytes(at, record_start);
                RecordContent start(head);
                const auto op = static_cast<Op>(start.next<std::uint8_t>());
                const auto size = start.next<std::uint64_t>();
                at += record_start;
                if (size > file_.size() - at)
                    throw Error(
                        fmt::format("{} of content, but {} are left", counted(size, "byte"), file_.size() - at));
                if (op == Op::data_end || op == Op::footer)
                    return;
                take(op, at, size);
                at += size;
            } catch (const Outage&) {
                throw;
            } catch (const Error& failure) {
                if (messages.empty())
                    throw Error(fmt::format("{}: record at byte {}: {}", path.string(), begin, failure.what()));
                warnings.push_back(fmt::format("{}: record at byte {}: {}; it and what follows is left out.",
                                               path.string(), begin, failure.what()));
                return;
            }
        }
    }

    void take(Op op, std::uint64_t at, std::uint64_t size) {
        if (op == Op::schema)
            take_schema(file_.bytes(at, size));
        else if (op == Op::channel)
            take_channel(file_.bytes(at, size));
        else if (op == Op::message)
            take_message(file_.bytes(at, std::min<std::uint64_t>(size, message_start + stamp_bytes)), in_file, at,
                         size);
        else if (op == Op::chunk)
            take_chunk(at, size);
    }

    void take_schema(std::string_view content) {
        RecordContent schema(content);
        const auto id = schema.next<std::uint16_t>();
        schemas_[id] = schema.text();
    }

    void take_channel(std::string_view content) {
        RecordContent channel(content);
        const auto id = channel.next<std::uint16_t>(), schema = channel.next<std::uint16_t>();
        const std::string topic(channel.text()), encoding(channel.text());
        channels_[id] = topic_named(topic, schemas_[schema],
                                    encoding == "cdr"    ? Encoding::cdr
                                    : encoding == "ros1" ? Encoding::ros1
                                                         : Encoding::unknown,
                                    encoding);
    }

    void take_message(std::string_view first, std::uint32_t chunk, std::uint64_t at, std::uint64_t size) {
        RecordContent content(first);
        const auto id = content.next<std::uint16_t>();
        content.take(sizeof(std::uint32_t));
        const auto recorded = content.next<std::uint64_t>();
        content.take(sizeof(std::uint64_t));
        const auto channel = channels_.find(id);
        if (channel == channels_.end())
            throw Error(fmt::format("a message of channel {}, which was not described before it", id));
        Message message{channel->second, 0, chunk, at + message_start, size - message_start};
        message.recorded_ns = static_cast<std::int64_t>(recorded);
        add(message, first.substr(message_start));
    }

    void take_chunk(std::uint64_t at, std::uint64_t size) {
        constexpr std::uint64_t longest_start = 64; // four numbers, the packer's name, the length
        const std::string head = file_.bytes(at, std::min(size, longest_start));
        RecordContent start(head);
        start.take(2 * sizeof(std::uint64_t));
        const auto unpacked = start.next<std::uint64_t>();
        const auto checksum = start.next<std::uint32_t>();
        const std::string compression(start.text());
        const auto packed = start.next<std::uint64_t>();
        const std::uint64_t records_at = at + start.at();
        if (packed > size - start.at())
            throw Error(fmt::format("{} of records in a chunk of {}", counted(packed, "byte"), size));
        if (!compression.empty() && compression != "zstd" && compression != "lz4")
            throw Error(fmt::format("a chunk packed by {}, expected zstd, lz4 or nothing", in_quotes(compression)));
        const auto records_of = [&](std::string_view records, std::uint32_t chunk, std::uint64_t base) {
            const auto found =
                static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(records.data()), records.size()));
            if (checksum != 0 && !sums_agree(found, checksum))
                throw Error(fmt::format("{}: chunk at byte {}: checksum {:08x}, expected {:08x}", path.string(), at,
                                        found, checksum));
            take_records(records, chunk, base);
        };
        try {
            if (compression.empty())
                return records_of(file_.bytes(records_at, packed), in_file, records_at);
            chunks_.chunks.push_back({records_at, packed, unpacked, compression});
            const auto chunk = static_cast<std::uint32_t>(chunks_.chunks.size() - 1);
            records_of(*chunks_.unpacked(chunk), chunk, 0);
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) { // the next chunk may be sound
            warnings.push_back(fmt::format("{}; its messages are left out.", failure.what()));
        }
    }

    void take_records(std::string_view records, std::uint32_t chunk, std::uint64_t base) {
        RecordContent content(records);
        while (content.at() < records.size()) {
            const auto op = static_cast<Op>(content.next<std::uint8_t>());
            const auto size = content.next<std::uint64_t>();
            const std::size_t at = content.at();
            const std::string_view record = content.take(size);
            if (op == Op::schema)
                take_schema(record);
            else if (op == Op::channel)
                take_channel(record);
            else if (op == Op::message)
                take_message(record, chunk, base + at, size);
        }
    }

    FileBytes file_;
    Chunks chunks_;
    std::unordered_map<std::uint16_t, std::string> schemas_;
    std::unordered_map<std::uint16_t, std::uint32_t> channels_;
};

} // namespace

std::shared_ptr<const Bag> open_mcap(const fs::path& file) { return std::make_shared<Mcap>(file); }

} // namespace scanshade::ros
