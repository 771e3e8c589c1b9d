#include "io/captures/recordings/ros/bag.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cstring>

namespace scanshade::ros {

namespace {

constexpr std::string_view ros1_magic = "#ROSBAG V2.0\n", mcap_magic = "\x89MCAP0\r\n",
                           sqlite_magic{"SQLite format 3\0", 16};

bool earlier_format(std::string_view start) {
    return start.starts_with("#ROSBAG V1") || start.starts_with("#ROSRECORD");
}

} // namespace

std::uint32_t Bag::topic_named(const std::string& name, const std::string& type, Encoding encoding,
                               const std::string& encoding_name) {
    std::string plain = type; // ROS 2 puts "msg" between package and name
    if (const std::size_t at = plain.find("/msg/"); at != std::string::npos)
        plain.erase(at, 4);
    const auto found =
        std::ranges::find_if(topics, [&](const Topic& topic) { return topic.name == name && topic.type == plain; });
    if (found != topics.end())
        return static_cast<std::uint32_t>(found - topics.begin());
    constexpr std::size_t most_topics = 1 << 16;
    if (topics.size() >= most_topics)
        throw Error(path.string() + ": more than 65536 topics");
    topics.push_back({name, plain, encoding, encoding_name});
    return static_cast<std::uint32_t>(topics.size() - 1);
}

void Bag::add(Message message, std::string_view first_bytes) {
    constexpr std::size_t most_messages = std::size_t(1) << 28;
    if (messages.size() >= most_messages)
        throw Error(path.string() + ": more than 2^28 messages");
    Topic& topic = topics.at(message.topic);
    ++topic.messages;
    // ROS 1 has a sequence number before the stamp, CDR its own four bytes.
    if (has_image_header(topic) && first_bytes.size() >= stamp_bytes) {
        std::uint32_t seconds = 0, nanoseconds = 0;
        std::memcpy(&seconds, first_bytes.data() + 4, sizeof seconds);
        std::memcpy(&nanoseconds, first_bytes.data() + 8, sizeof nanoseconds);
        if (topic.encoding == Encoding::cdr && first_bytes[1] == 0) {
            seconds = __builtin_bswap32(seconds);
            nanoseconds = __builtin_bswap32(nanoseconds);
        }
        message.stamp_ns = static_cast<std::int64_t>(seconds) * 1'000'000'000 + nanoseconds;
    }
    messages.push_back(message);
}

bool has_image_header(const Topic& topic) {
    return topic.type == "sensor_msgs/Image" || topic.type == "sensor_msgs/CompressedImage";
}

bool is_bag(std::string_view start) {
    return start.starts_with(ros1_magic) || start.starts_with(mcap_magic) || start.starts_with(sqlite_magic) ||
           earlier_format(start);
}

std::shared_ptr<const Bag> open_bag(const std::filesystem::path& file) {
    const std::string start = read_bytes(file, sqlite_magic.size());
    if (earlier_format(start))
        throw Error(file.string() +
                    ": a bag of an earlier format, expected 2.0; `rosbag fix` or `rosbag migrate` converts it");
    if (!is_bag(start))
        throw Error(file.string() + ": neither a bag of ROS 1 nor SQLite nor MCAP, by its first bytes");
    return start.starts_with(mcap_magic)     ? open_mcap(file)
           : start.starts_with(sqlite_magic) ? open_sqlite(file)
                                             : open_bag_of_ros1(file);
}

} // namespace scanshade::ros
