// Recordings of ROS: their topics, where each message lies, and its bytes. Bags of ROS 1 (format 2.0), MCAP, and SQLite
// files of rosbag2.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::ros {

/// How the messages of a topic are written down.
enum class Encoding { ros1, cdr, unknown };

struct Topic {
    std::string name;
    std::string type; ///< of ROS 1 and 2 alike: "sensor_msgs/Image"
    Encoding encoding = Encoding::unknown;
    std::string encoding_name; ///< as the file says
    std::uint64_t messages = 0;
};

constexpr std::int64_t no_stamp = std::numeric_limits<std::int64_t>::min();

/// Where a message lies. What the numbers mean is the bag's business.
struct Message {
    std::uint32_t topic = 0; ///< index of the topic
    std::uint32_t file = 0;  ///< index of the bag, where several are one recording
    std::uint32_t chunk = 0;
    std::uint64_t at = 0, size = 0;
    std::int64_t recorded_ns = 0;     ///< when it was written
    std::int64_t stamp_ns = no_stamp; ///< of its header, for images
};

/// A file of messages. Several threads may ask for bytes at once.
class Bag {
  public:
    Bag() = default;
    Bag(const Bag&) = delete;
    Bag& operator=(const Bag&) = delete;
    virtual ~Bag() = default;

    std::filesystem::path path;
    std::vector<Topic> topics;
    std::vector<Message> messages; ///< as they come in the file
    std::vector<std::string> warnings;

    /// Throws Error naming file and place.
    [[nodiscard]] virtual std::string bytes(const Message& message) const = 0;

  protected:
    /// Index of the topic, which is added where it is new.
    std::uint32_t topic_named(const std::string& name, const std::string& type, Encoding encoding,
                              const std::string& encoding_name);
    /// Counts a message and takes the stamp from its first bytes.
    void add(Message message, std::string_view first_bytes);
};

/// Whether messages of the type begin with the header of an image, whose stamp is wanted.
[[nodiscard]] bool has_image_header(const Topic& topic);
/// Enough bytes for add().
constexpr std::size_t stamp_bytes = 12;

/// Whether a file with these first bytes is such a recording, or one of an earlier format that is refused by name.
[[nodiscard]] bool is_bag(std::string_view start);
/// Throws Error naming file and place where nothing can be read; damage after the first messages is a warning.
[[nodiscard]] std::shared_ptr<const Bag> open_bag(const std::filesystem::path& file);

// One function for each format.
[[nodiscard]] std::shared_ptr<const Bag> open_bag_of_ros1(const std::filesystem::path& file);
[[nodiscard]] std::shared_ptr<const Bag> open_mcap(const std::filesystem::path& file);
[[nodiscard]] std::shared_ptr<const Bag> open_sqlite(const std::filesystem::path& file);

} // namespace scanshade::ros
