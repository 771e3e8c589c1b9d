// SQLite files of rosbag2 and of RealSense's recorder. Messages may each be a zstd frame.
#include "io/captures/recordings/ros/bag.h"
#include "io/captures/recordings/ros/unpack.h"
#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <map>
#include <sqlite3.h>

namespace scanshade::ros {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view zstd_magic = "\x28\xb5\x2f\xfd";

/// As a URI, in which only these bytes stand for themselves.
std::string uri_of(const fs::path& file) {
    std::string uri = "file:";
    for (const char c : fs::absolute(file).string())
        uri +=
            std::isalnum(static_cast<unsigned char>(c)) != 0 || std::string_view("/-_.~").find(c) != std::string::npos
                ? std::string(1, c)
                : fmt::format("%{:02X}", static_cast<unsigned char>(c));
    return uri + "?immutable=1"; // nothing is written beside it
}

class Sqlite final : public Bag {
  public:
    explicit Sqlite(const fs::path& file) {
        path = file;
        if (stored_in_tar(file))
            throw Error(file.string() + ": a database of SQLite is not read from within a tar: unpack it with "
                                        "`tar -xf`");
        if (fs::path journal = file.string() + "-wal"; size_of_file(journal).value_or(0) > 0)
            throw Error(fmt::format("{}: the recording was not closed: {} holds a part of it; `sqlite3 FILE .tables` "
                                    "joins them",
                                    file.string(), journal.filename().string()));
        sqlite3* opened = nullptr;
        const int status = sqlite3_open_v2(uri_of(file).c_str(), &opened,
                                           SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_FULLMUTEX, nullptr);
        database_.reset(opened);
        check(status);
        sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, 1 << 30);
        check(sqlite3_exec(opened, "PRAGMA trusted_schema = OFF", nullptr, nullptr, nullptr));
        read();
    }

    [[nodiscard]] std::string bytes(const Message& message) const override {
        const Statement row = prepared("SELECT data FROM messages WHERE rowid = ?");
        sqlite3_bind_int64(row.get(), 1, static_cast<sqlite3_int64>(message.at));
        if (!next(row))
            throw Error(fmt::format("{}: message {} is not there", path.string(), message.at));
        std::string data = blob(row, 0);
        if (!data.starts_with(zstd_magic))
            return data;
        return during(fmt::format("{}: message {}", path.string(), message.at),
                      [&] { return unpacked_zstd(data, size_of_zstd(data)); });
    }

  private:
    struct Close {
        void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
        void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
        void operator()(sqlite3_blob* blob) const { sqlite3_blob_close(blob); }
    };
    using Statement = std::unique_ptr<sqlite3_stmt, Close>;

    void check(int status) const {
        if (status == SQLITE_NOMEM)
            throw std::bad_alloc();
        if (status == SQLITE_IOERR || status == SQLITE_BUSY)
            throw Outage(fmt::format("{}: {}", path.string(), sqlite3_errmsg(database_.get())));
        if (status != SQLITE_OK && status != SQLITE_ROW && status != SQLITE_DONE)
            throw Error(fmt::format("{}: {}", path.string(), sqlite3_errmsg(database_.get())));
    }
    [[nodiscard]] Statement prepared(const char* sql) const {
        sqlite3_stmt* statement = nullptr;
        check(sqlite3_prepare_v2(database_.get(), sql, -1, &statement, nullptr));
        return Statement(statement);
    }
    [[nodiscard]] bool next(const Statement& statement) const {
        const int status = sqlite3_step(statement.get());
        check(status);
        return status == SQLITE_ROW;
    }
    static std::string blob(const Statement& row, int column) {
        const auto* data = static_cast<const char*>(sqlite3_column_blob(row.get(), column));
        return data ? std::string(data, static_cast<std::size_t>(sqlite3_column_bytes(row.get(), column))) : "";
    }

    void read() {
        const Statement tables =
            prepared("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')");
        if (!next(tables) || sqlite3_column_int(tables.get(), 0) != 2)
            throw Error(path.string() + ": an SQLite file without the tables \"topics\" and \"messages\" of rosbag2");
        std::map<std::int64_t, std::uint32_t> by_id;
        const Statement rows = prepared("SELECT id, name, type, serialization_format FROM topics");
        while (next(rows)) {
            const std::string format = blob(rows, 3);
            by_id[sqlite3_column_int64(rows.get(), 0)] =
                topic_named(blob(rows, 1), blob(rows, 2), format == "cdr" ? Encoding::cdr : Encoding::unknown, format);
        }
        try {
            read_messages(by_id);
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            if (messages.empty())
                throw;
            warnings.push_back(fmt::format("{}; what follows after {} is left out.", failure.what(),
                                           counted(messages.size(), "message")));
        }
    }

    void read_messages(const std::map<std::int64_t, std::uint32_t>& by_id) {
        std::unique_ptr<sqlite3_blob, Close> data;
        const Statement rows = prepared("SELECT rowid, topic_id, timestamp FROM messages");
        while (next(rows)) {
            const auto topic = by_id.find(sqlite3_column_int64(rows.get(), 1));
            if (topic == by_id.end())
                continue;
            const sqlite3_int64 row = sqlite3_column_int64(rows.get(), 0);
            Message message{topic->second, 0, 0, static_cast<std::uint64_t>(row), 0};
            message.recorded_ns = sqlite3_column_int64(rows.get(), 2);
            std::string first;
            if (has_image_header(topics[topic->second])) {
                if (data) {
                    check(sqlite3_blob_reopen(data.get(), row));
                } else {
                    sqlite3_blob* opened = nullptr;
                    check(sqlite3_blob_open(database_.get(), "main", "messages", "data", row, 0, &opened));
                    data.reset(opened);
                }
                message.size = static_cast<std::uint64_t>(sqlite3_blob_bytes(data.get()));
                first.resize(std::min<std::size_t>(message.size, stamp_bytes));
                check(sqlite3_blob_read(data.get(), first.data(), static_cast<int>(first.size()), 0));
                if (first.starts_with(zstd_magic))
                    first = bytes(message).substr(0, stamp_bytes);
            }
            add(message, first);
        }
    }

    std::unique_ptr<sqlite3, Close> database_;
};

} // namespace

std::shared_ptr<const Bag> open_sqlite(const fs::path& file) { return std::make_shared<Sqlite>(file); }

} // namespace scanshade::ros
