// Bags of ROS 1, format 2.0: records of a header of named fields and data, read from front to back. The index at the
// end is not needed, so recordings that were never closed are read as well.
#include "io/captures/recordings/ros/bag.h"
#include "io/captures/recordings/ros/unpack.h"
#include "io/file_bytes.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cstring>
#include <fmt/format.h>
#include <unordered_map>

namespace scanshade::ros {

namespace fs = std::filesystem;

namespace {

enum class Op : std::uint8_t { message = 2, bag_header = 3, index = 4, chunk = 5, chunk_info = 6, connection = 7 };

template <class Number>
Number number_at(std::string_view bytes, std::size_t at) {
    Number value{};
    if (at > bytes.size() || bytes.size() - at < sizeof value)
        throw Error(fmt::format("a field of {} at byte {} of it, expected {}", counted(bytes.size(), "byte"), at,
                                sizeof value));
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

/// name=value, each with its length before it.
class Fields {
  public:
    explicit Fields(std::string_view header) {
        for (std::size_t at = 0; at < header.size();) {
            const auto length = number_at<std::uint32_t>(header, at);
            at += sizeof length;
            if (length > header.size() - at)
                throw Error(fmt::format("a field of {} in a header of {}", counted(length, "byte"), header.size()));
            const std::string_view field = header.substr(at, length);
            const std::size_t equals = field.find('=');
            if (equals == std::string_view::npos)
                throw Error("a header's field without \"=\"");
            fields_.emplace_back(field.substr(0, equals), field.substr(equals + 1));
            at += length;
        }
    }
    [[nodiscard]] std::string_view text(std::string_view name) const {
        const auto found = std::ranges::find(fields_, name, &Field::first);
        if (found == fields_.end())
            throw Error(fmt::format("a header without \"{}\"", name));
        return found->second;
    }
    [[nodiscard]] bool has(std::string_view name) const {
        return std::ranges::find(fields_, name, &Field::first) != fields_.end();
    }
    template <class Number>
    [[nodiscard]] Number number(std::string_view name) const {
        return number_at<Number>(text(name), 0);
    }
    [[nodiscard]] Op op() const { return static_cast<Op>(number<std::uint8_t>("op")); }

  private:
    using Field = std::pair<std::string_view, std::string_view>;
    std::vector<Field> fields_;
};

std::string unpack(std::string_view packed, const Chunk& chunk) {
    return chunk.compression == "bz2" ? unpacked_bz2(packed, chunk.size) : unpacked_lz4(packed, chunk.size);
}

/// Messages that are not packed lie in the file itself.
constexpr std::uint32_t in_file = std::numeric_limits<std::uint32_t>::max();

class BagOfRos1 final : public Bag {
  public:
    explicit BagOfRos1(const fs::path& file) : file_(file), chunks_(file_, unpack) {
        path = file;
        read();
    }

    [[nodiscard]] std::string bytes(const Message& message) const override {
        if (message.chunk == in_file)
            return file_.bytes(message.at, message.size);
        return chunks_.unpacked(message.chunk)->substr(message.at, message.size);
    }

  private:
    static constexpr std::uint64_t magic_bytes = 13;
    static constexpr std::uint32_t longest_header = 1 << 20;

    void read() {
        bool closed = true;
        for (std::uint64_t at = magic_bytes; at < file_.size();) {
            const std::uint64_t begin = at;
            try {
                constexpr std::uint64_t two_lengths = 8;
                if (file_.size() - at < two_lengths)
                    throw Error(fmt::format("{} are left, expected a record", counted(file_.size() - at, "byte")));
                std::string header = part(at, longest_header);
                const Fields fields(header);
                const auto size = number_at<std::uint32_t>(file_.bytes(at, 4), 0);
                at += 4;
                const Op op = fields.op();
                if (op == Op::bag_header) {
                    if (fields.has("encryptor") && !fields.text("encryptor").empty())
                        throw Error(
                            fmt::format("encrypted by {}, which is not read", in_quotes(fields.text("encryptor"))));
                    closed = fields.number<std::uint64_t>("index_pos") != 0;
                } else if (op == Op::chunk) {
                    take_chunk(fields, at, size);
                } else if (op == Op::connection) {
                    take_connection(fields, file_.bytes(at, size));
                } else if (op == Op::message) {
                    check_left(at, size);
                    take_message(fields, in_file, at, file_.bytes(at, std::min<std::uint64_t>(size, stamp_bytes)),
                                 size);
                } else if (op == Op::chunk_info) {
                    break; // the index at the end
                }
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
        if (!closed)
            warnings.push_back(path.string() + ": the recording was never closed; it was read from front to back.");
    }

    std::string part(std::uint64_t& at, std::uint32_t longest) const {
        const auto size = number_at<std::uint32_t>(file_.bytes(at, 4), 0);
        if (size > longest)
            throw Error(fmt::format("a header of {}, expected at most {}", counted(size, "byte"), longest));
        at += 4;
        check_left(at, std::uint64_t(size) + 4);
        at += size;
        return file_.bytes(at - size, size);
    }

    void check_left(std::uint64_t at, std::uint64_t size) const {
        if (size > file_.size() - std::min(at, file_.size()))
            throw Error(fmt::format("{} of data, but {} are left", counted(size, "byte"), file_.size() - at));
    }

    void take_chunk(const Fields& fields, std::uint64_t at, std::uint32_t size) {
        const std::string compression(fields.text("compression"));
        if (compression == "none") {
            check_left(at, size);
            take_records(file_.bytes(at, size), in_file, at);
            return;
        }
        if (compression != "bz2" && compression != "lz4")
            throw Error(fmt::format("a chunk packed by {}, expected none, bz2 or lz4", in_quotes(compression)));
        check_left(at, size);
        chunks_.chunks.push_back({at, size, fields.number<std::uint32_t>("size"), compression});
        const auto chunk = static_cast<std::uint32_t>(chunks_.chunks.size() - 1);
        std::shared_ptr<const std::string> records;
        try {
            records = chunks_.unpacked(chunk);
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) { // the next chunk may be sound
            warnings.push_back(fmt::format("{}; its messages are left out.", failure.what()));
            return;
        }
        take_records(*records, chunk, 0);
    }

    /// The records of a chunk; messages lie `base` bytes after their place in `records`.
    void take_records(std::string_view records, std::uint32_t chunk, std::uint64_t base) {
        for (std::size_t at = 0; at < records.size();) {
            const auto cut = [&](std::uint64_t size) {
                if (size > records.size() - at)
                    throw Error(
                        fmt::format("{} in a chunk of which {} are left", counted(size, "byte"), records.size() - at));
            };
            const auto header = number_at<std::uint32_t>(records, at);
            at += 4;
            cut(header);
            const Fields fields(records.substr(at, header));
            at += header;
            const auto size = number_at<std::uint32_t>(records, at);
            at += 4;
            cut(size);
            if (fields.op() == Op::connection)
                take_connection(fields, records.substr(at, size));
            else if (fields.op() == Op::message)
                take_message(fields, chunk, base + at, records.substr(at, size), size);
            at += size;
        }
    }

    void take_connection(const Fields& fields, std::string_view data) {
        const auto connection = fields.number<std::uint32_t>("conn");
        const std::string topic(fields.text("topic")), type(Fields(data).text("type"));
        connections_[connection] = topic_named(topic, type, Encoding::ros1, "ros1");
    }

    void take_message(const Fields& fields, std::uint32_t chunk, std::uint64_t at, std::string_view first,
                      std::uint64_t size) {
        const auto found = connections_.find(fields.number<std::uint32_t>("conn"));
        if (found == connections_.end())
            throw Error(fmt::format("a message of connection {}, which was not described before it",
                                    fields.number<std::uint32_t>("conn")));
        const auto time = fields.number<std::uint64_t>("time");
        Message message{found->second, 0, chunk, at, size};
        message.recorded_ns =
            static_cast<std::int64_t>(time & 0xffffffff) * 1'000'000'000 + static_cast<std::int64_t>(time >> 32);
        add(message, first);
    }

    FileBytes file_;
    Chunks chunks_;
    std::unordered_map<std::uint32_t, std::uint32_t> connections_;
};

} // namespace

std::shared_ptr<const Bag> open_bag_of_ros1(const fs::path& file) { return std::make_shared<BagOfRos1>(file); }

} // namespace scanshade::ros
