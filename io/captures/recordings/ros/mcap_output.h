// MCAP files (mcap.dev/spec), written: groups of messages one after the other, and the summary that players seek by.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::ros {

/// A topic as the file declares it. Its id is its place in McapOutput's list, counted from 1.
struct Channel {
    std::string topic;
    std::string type;       ///< "sensor_msgs/msg/Image"
    std::string definition; ///< of the type and of all types in it, as ros2msg
};

/// A message in CDR.
struct NewMessage {
    std::uint16_t channel = 0;  ///< id
    std::uint32_t sequence = 0; ///< on its channel
    std::uint64_t time_ns = 0;  ///< of the log and of the publisher
    std::string data;
};

/// Messages that belong together, as they lie in a file: a metadata record that names them, then chunks packed by zstd,
/// each with the index of its messages. A chunk has at most 4 MiB before packing, or one longer message. The bytes do
/// not depend on the file, so groups can be made by several threads and copied from file to file.
[[nodiscard]] std::string packed_group(const std::string& name, const std::vector<NewMessage>& messages);

/// Where a group lies in a file.
struct GroupPlace {
    std::string name;
    std::uint64_t at = 0, size = 0;
};
/// The whole groups of a file, which may be cut off anywhere. Nothing where it is no MCAP file. Groups whose checksum
/// is wrong are left out.
[[nodiscard]] std::vector<GroupPlace> groups_in(const std::filesystem::path& file);

/// A file on its way. Every failure of the file system is an Outage that names it.
class McapOutput {
  public:
    /// `library` names the writer.
    McapOutput(std::filesystem::path file, const std::string& library, std::vector<Channel> channels);

    /// Appends what packed_group() made. A channel is declared when its first message comes.
    void add(std::string_view group);
    /// Gives the system what was added, so that it outlives the process.
    void flush();
    /// Writes the summary and the end, and closes the file. Nothing can be added then.
    void finish();

    [[nodiscard]] std::uint64_t messages() const;
    [[nodiscard]] std::uint64_t bytes() const { return at_; }

  private:
    /// What the summary says of a chunk, a record of its own there.
    struct ChunkFacts {
        std::uint64_t start_ns = 0, end_ns = 0, at = 0, length = 0, packed = 0, size = 0, index_length = 0;
        std::string compression;
        std::map<std::uint16_t, std::uint64_t> index_at;
    };
    struct MetadataFacts {
        std::uint64_t at = 0, length = 0;
    };
    void write(std::string_view bytes);
    void declare(std::uint16_t channel);
    [[nodiscard]] std::uint16_t schema_of(std::uint16_t channel) const;
    [[nodiscard]] std::string schema_record(std::uint16_t channel) const;
    [[nodiscard]] std::string channel_record(std::uint16_t channel) const;
    [[nodiscard]] std::string statistics_record() const;

    std::filesystem::path file_;
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream_;
    std::vector<Channel> channels_;
    std::map<std::uint16_t, std::uint64_t> counts_; ///< messages by channel; those declared
    std::vector<ChunkFacts> chunks_;
    std::vector<MetadataFacts> metadata_;
    std::uint64_t at_ = 0;
    std::uint32_t checksum_ = 0; ///< of everything written
};

} // namespace scanshade::ros
