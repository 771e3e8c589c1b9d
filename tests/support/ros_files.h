// Recordings of ROS made in code, byte by byte: bags of ROS 1, MCAP and rosbag2's SQLite files.
#pragma once

#include "tests/support/raw.h"

#include <bzlib.h>
#include <cstdint>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <lz4frame.h>
#include <map>
#include <opencv2/core.hpp>
#include <sqlite3.h>
#include <stdexcept>
#include <string>
#include <vector>
#include <zlib.h>
#include <zstd.h>

namespace scanshade::tests {

inline std::string counted_text(const std::string& text) { return raw(static_cast<std::uint32_t>(text.size())) + text; }

/// A message's fields, packed as ROS 1 does, or aligned as CDR asks.
class Fields {
  public:
    explicit Fields(bool cdr) : cdr_(cdr), bytes_(cdr ? std::string("\0\1\0\0", 4) : "") {}
    template <class Number>
    Fields& add(Number value) {
        while (cdr_ && (bytes_.size() - 4) % sizeof value != 0)
            bytes_ += '\0';
        bytes_ += raw(value);
        return *this;
    }
    Fields& add(const std::string& text) {
        add(static_cast<std::uint32_t>(text.size() + (cdr_ ? 1 : 0)));
        bytes_ += text;
        if (cdr_)
            bytes_ += '\0';
        return *this;
    }
    Fields& header(double stamp_s, const std::string& frame) {
        if (!cdr_)
            add(std::uint32_t(7));
        const auto ns = static_cast<std::int64_t>(stamp_s * 1e9 + 0.5);
        add(static_cast<std::uint32_t>(ns / 1000000000)).add(static_cast<std::uint32_t>(ns % 1000000000));
        return add(frame);
    }
    Fields& bytes(const std::string& data) {
        add(static_cast<std::uint32_t>(data.size()));
        bytes_ += data;
        return *this;
    }
    [[nodiscard]] const std::string& text() const { return bytes_; }

  private:
    bool cdr_;
    std::string bytes_;
};

struct TestMessage {
    std::string topic, type;
    double recorded_s;
    std::string data;
};

inline std::string packed(const std::string& bytes, const std::string& compression) {
    std::string out(bytes.size() * 2 + 1000, '\0');
    if (compression == "bz2") {
        auto size = static_cast<unsigned>(out.size());
        BZ2_bzBuffToBuffCompress(out.data(), &size, const_cast<char*>(bytes.data()),
                                 static_cast<unsigned>(bytes.size()), 9, 0, 0);
        out.resize(size);
    } else if (compression == "lz4") {
        out.resize(LZ4F_compressFrame(out.data(), out.size(), bytes.data(), bytes.size(), nullptr));
    } else if (compression == "zstd") {
        out.resize(ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 3));
    } else {
        return bytes;
    }
    return out;
}

inline std::string in_ros2(std::string type) { return type.insert(type.find('/'), "/msg"); }

/// A chunk for every three messages, and no index.
inline std::string bag_of_ros1(const std::vector<TestMessage>& messages, const std::string& compression,
                               const std::filesystem::path&) {
    const auto field = [](const std::string& name, const std::string& value) {
        return counted_text(name + "=" + value);
    };
    const auto record = [](const std::string& header, const std::string& data) {
        return counted_text(header) + counted_text(data);
    };
    const std::string head = field("op", "\3") + field("index_pos", raw(std::uint64_t(1))) +
                             field("conn_count", raw(1)) + field("chunk_count", raw(1));
    std::string file = "#ROSBAG V2.0\n" + record(head, std::string(4096 - head.size(), ' '));
    std::map<std::string, int> connections;
    std::string chunk;
    int in_chunk = 0;
    const auto end_chunk = [&] {
        if (!chunk.empty())
            file += record(field("op", "\5") + field("compression", compression) +
                               field("size", raw(static_cast<std::uint32_t>(chunk.size()))),
                           packed(chunk, compression));
        chunk.clear();
    };
    for (const TestMessage& message : messages) {
        const auto [connection, is_new] = connections.insert({message.topic, static_cast<int>(connections.size())});
        if (is_new)
            chunk += record(field("op", "\7") + field("conn", raw(connection->second)) + field("topic", message.topic),
                            field("type", message.type) + field("md5sum", "*"));
        const auto seconds = static_cast<std::uint32_t>(message.recorded_s);
        const auto nanoseconds = static_cast<std::uint32_t>((message.recorded_s - seconds) * 1e9);
        chunk += record(field("op", "\2") + field("conn", raw(connection->second)) +
                            field("time", raw(seconds) + raw(nanoseconds)),
                        message.data);
        if (++in_chunk % 3 == 0)
            end_chunk();
    }
    end_chunk();
    return file;
}

inline std::string mcap(const std::vector<TestMessage>& messages, const std::string& compression,
                        const std::filesystem::path&) {
    const std::string magic = "\x89MCAP0\r\n";
    const auto record = [](int op, const std::string& content) {
        return std::string(1, static_cast<char>(op)) + raw(static_cast<std::uint64_t>(content.size())) + content;
    };
    std::string file = magic + record(1, counted_text("ros2") + counted_text("test")), chunk, described;
    std::map<std::string, std::uint16_t> channels;
    int in_chunk = 0;
    const auto end_chunk = [&] {
        if (chunk.empty())
            return;
        const std::string records = packed(chunk, compression);
        const auto sum =
            static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(chunk.data()), chunk.size()));
        file += record(6, raw(std::uint64_t(0)) + raw(std::uint64_t(0)) +
                              raw(static_cast<std::uint64_t>(chunk.size())) + raw(sum) + counted_text(compression) +
                              raw(static_cast<std::uint64_t>(records.size())) + records);
        chunk.clear();
    };
    for (const TestMessage& message : messages) {
        const auto id = static_cast<std::uint16_t>(channels.size() + 1);
        const auto [channel, is_new] = channels.insert({message.topic, id});
        if (is_new) {
            const std::string both =
                record(3, raw(id) + counted_text(in_ros2(message.type)) + counted_text("ros2msg") + counted_text("")) +
                record(4,
                       raw(id) + raw(id) + counted_text(message.topic) + counted_text("cdr") + raw(std::uint32_t(0)));
            chunk += both;
            described += both;
        }
        const auto ns = static_cast<std::uint64_t>(message.recorded_s * 1e9);
        chunk += record(5, raw(channel->second) + raw(std::uint32_t(0)) + raw(ns) + raw(ns) + message.data);
        if (++in_chunk % 3 == 0)
            end_chunk();
    }
    end_chunk();
    file += record(15, raw(std::uint32_t(0)));
    const std::uint64_t summary = file.size();
    return file + described + record(2, raw(summary) + raw(std::uint64_t(0)) + raw(std::uint32_t(0))) + magic;
}

inline void must(bool well, const std::string& what) {
    if (!well)
        throw std::runtime_error("SQLite refuses: " + what);
}

inline std::string sqlite(const std::vector<TestMessage>& messages, const std::string& compression,
                          const std::filesystem::path& path) {
    std::filesystem::remove(path);
    std::filesystem::create_directories(path.parent_path());
    sqlite3* database = nullptr;
    must(sqlite3_open(path.c_str(), &database) == SQLITE_OK, path.string());
    const auto execute = [&](const std::string& sql) {
        must(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK, sql);
    };
    execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)");
    std::map<std::string, int> topics;
    for (const TestMessage& message : messages) {
        const auto [topic, is_new] = topics.insert({message.topic, static_cast<int>(topics.size() + 1)});
        if (is_new)
            execute(fmt::format("INSERT INTO topics VALUES({}, '{}', '{}', 'cdr')", topic->second, message.topic,
                                in_ros2(message.type)));
        sqlite3_stmt* row = nullptr;
        sqlite3_prepare_v2(database, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1, &row,
                           nullptr);
        const std::string data = packed(message.data, compression);
        sqlite3_bind_int(row, 1, topic->second);
        sqlite3_bind_int64(row, 2, static_cast<sqlite3_int64>(message.recorded_s * 1e9));
        sqlite3_bind_blob(row, 3, data.data(), static_cast<int>(data.size()), SQLITE_STATIC);
        must(sqlite3_step(row) == SQLITE_DONE, message.topic);
        sqlite3_finalize(row);
    }
    sqlite3_close(database);
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

inline constexpr const char *image_type = "sensor_msgs/Image", *info_type = "sensor_msgs/CameraInfo",
                            *tf_type = "tf2_msgs/TFMessage";

/// Three frames of 8x6 pixels at 2 m, pixel (1, 1) at 3 m, pixel (0, 0) a hole; a camera that moves along x by 1 m/s.
class RosMessages {
  public:
    explicit RosMessages(bool cdr) : cdr_(cdr) {}
    [[nodiscard]] Fields fields() const { return Fields(cdr_); }

    [[nodiscard]] std::string depth(double stamp_s, const std::string& encoding = "16UC1") const {
        const bool floats = encoding == "32FC1";
        std::string rows;
        for (int y = 0; y < 6; ++y) {
            for (int x = 0; x < 8; ++x) {
                const double z = x == 0 && y == 0 ? 0 : x == 1 && y == 1 ? 3 : 2;
                rows += floats ? raw(static_cast<float>(z)) : raw(static_cast<std::uint16_t>(z * 1000));
            }
            rows += "padding!";
        }
        Fields image = fields().header(stamp_s, "depth_optical").add(6U).add(8U).add(encoding).add(std::uint8_t(0));
        return image.add(floats ? 40U : 24U).bytes(rows).text();
    }
    [[nodiscard]] std::string colour(double stamp_s) const {
        std::string pixels;
        for (int i = 0; i < 12 * 16; ++i)
            pixels += "\xc7\x63\x09"; // red, green, blue
        Fields image = fields().header(stamp_s, "colour_optical").add(12U).add(16U).add(std::string("rgb8"));
        return image.add(std::uint8_t(0)).add(48U).bytes(pixels).text();
    }
    [[nodiscard]] std::string camera(cv::Size size, double fx, const std::string& frame,
                                     const std::string& model = "plumb_bob",
                                     const std::vector<double>& lens = {0.1, 0, 0, 0, 0}) const {
        Fields info = fields().header(0.5, frame).add(size.height).add(size.width).add(model);
        info.add(static_cast<std::uint32_t>(lens.size()));
        for (const double k : lens)
            info.add(k);
        for (const double k : {fx, 0.0, 3.5, 0.0, 11.0, 2.5, 0.0, 0.0, 1.0})
            info.add(k);
        for (int i = 0; i < 9 + 12; ++i)
            info.add(0.0);
        for (int i = 0; i < 6; ++i)
            info.add(0U);
        return info.add(std::uint8_t(0)).text();
    }
    [[nodiscard]] std::string transform(double stamp_s, const std::string& parent, const std::string& child,
                                        double x) const {
        Fields all = fields().add(1U).header(stamp_s, parent).add(child);
        for (const double v : {x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0})
            all.add(v);
        return all.text();
    }
    [[nodiscard]] std::vector<TestMessage> messages() const {
        std::vector<TestMessage> all{{"/tf_static", tf_type, 1, transform(0, "camera", "depth_optical", 0.25)},
                                     {"/tf_static", tf_type, 1, transform(0, "camera", "colour_optical", 0.5)},
                                     {"/depth/camera_info", info_type, 1, camera({8, 6}, 10, "depth_optical")},
                                     {"/color/camera_info", info_type, 1, camera({16, 12}, 20, "colour_optical")}};
        for (const double stamp : {1.0, 1.125, 1.25}) {
            all.push_back({"/tf", tf_type, stamp, transform(stamp, "world", "camera", stamp)});
            all.push_back({"/depth/image_raw", image_type, stamp + 0.5, depth(stamp)});
            if (stamp != 1.25)
                all.push_back({"/color/image_raw", image_type, stamp + 0.5, colour(stamp + 0.01)});
        }
        return all;
    }

  private:
    bool cdr_;
};

} // namespace scanshade::tests
