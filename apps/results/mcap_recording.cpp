#include "apps/results/mcap_recording.h"

#include "io/captures/recordings/ros/message_output.h"
#include "io/file_bytes.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <system_error>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr double ns_per_s = 1e9;

/// In the order of McapTopic. Names as ROS's image_transport has them.
std::vector<ros::Channel> channels() {
    std::vector<ros::Channel> rows;
    for (const auto& [topic, type] : {std::pair{"/scanshade/frame", "std_msgs/msg/String"},
                                      {"/tf", "tf2_msgs/msg/TFMessage"},
                                      {"/tf_static", "tf2_msgs/msg/TFMessage"},
                                      {"/scanshade/camera_info", "sensor_msgs/msg/CameraInfo"},
                                      {"/scanshade/depth", "sensor_msgs/msg/Image"},
                                      {"/scanshade/colour/compressed", "sensor_msgs/msg/CompressedImage"},
                                      {"/scanshade/ao/compressed", "sensor_msgs/msg/CompressedImage"},
                                      {"/scanshade/confidence/compressed", "sensor_msgs/msg/CompressedImage"},
                                      {"/scanshade/shaded/compressed", "sensor_msgs/msg/CompressedImage"},
                                      {"/scanshade/points", "sensor_msgs/msg/PointCloud2"}})
        rows.push_back({topic, type, ros::definition_of(type)});
    return rows;
}

/// ROS counts seconds in 32 bits with a sign.
bool fits_ros(const std::optional<double>& stamp_s) {
    return stamp_s && *stamp_s >= 0 && *stamp_s < std::numeric_limits<std::int32_t>::max();
}

bool whole_millimetres(const Capture& capture) {
    constexpr double per_metre = 1000;
    const bool linear = capture.depth.kind == DepthEncoding::Kind::linear && !capture.depth_correction.any();
    return linear && std::ranges::all_of(capture.entries, [&](const CaptureEntry& entry) {
               const double own = entry.depth_units_per_metre;
               return entry.cloud.empty() && (own == 0 ? capture.depth.units_per_metre : own) == per_metre;
           });
}

} // namespace

fs::path mcap_file(const fs::path& folder, const std::string& block) {
    return folder / (block.empty() ? "run.mcap" : "run." + block + ".mcap");
}

McapRecording::McapRecording(fs::path file, const Capture& capture, bool resume)
    : file_(std::move(file)), capture_(capture), in_millimetres_(whole_millimetres(capture)) {
    const auto& entries = capture.entries;
    own_stamps_ = std::ranges::all_of(entries, [](const CaptureEntry& entry) { return fits_ros(entry.stamp_s); });
    has_poses_ =
        std::ranges::any_of(entries, [](const CaptureEntry& entry) { return entry.world_from_camera.has_value(); });
    const auto earlier_parts = parts();
    std::error_code ignored;
    if (resume) {
        const auto look_up = [&](const fs::path& earlier) {
            const auto name = std::make_shared<const fs::path>(earlier);
            for (ros::GroupPlace& group : ros::groups_in(earlier))
                earlier_.insert_or_assign(group.name, Place{name, group}); // later files have later results
        };
        if (fs::exists(file_, ignored))
            look_up(file_);
        for (const auto& [number, part] : earlier_parts)
            look_up(part);
    } else {
        fs::remove(file_, ignored);
        for (const auto& [number, part] : earlier_parts)
            fs::remove(part, ignored);
    }
    const unsigned number = earlier_parts.empty() ? 0 : earlier_parts.rbegin()->first + 1;
    part_ = file_.parent_path() / fmt::format(".{}.{}.mcap.part", file_.stem().string(), number);
}

std::map<unsigned, fs::path> McapRecording::parts() const {
    std::map<unsigned, fs::path> found;
    const std::string begin = "." + file_.stem().string() + ".";
    constexpr std::string_view end = ".mcap.part";
    std::error_code none_there;
    for (const auto& entry : fs::directory_iterator(file_.parent_path(), none_there)) {
        const std::string name = entry.path().filename().string();
        if (!name.starts_with(begin) || !name.ends_with(end) || name.size() <= begin.size() + end.size())
            continue;
        const auto number =
            whole_number(std::string_view(name).substr(begin.size(), name.size() - begin.size() - end.size()));
        if (number && *number < std::numeric_limits<unsigned>::max())
            found[static_cast<unsigned>(*number)] = entry.path();
    }
    return found;
}

void McapRecording::begin(const std::vector<std::size_t>& frames, std::set<std::size_t> kept) {
    frames_ = frames;
    kept_ = std::move(kept);
    output_ = std::make_unique<ros::McapOutput>(part_, std::string("scanshade ") + SCANSHADE_VERSION, channels());
}

void McapRecording::append(const std::string& group) {
    output_->add(group);
    ++added_;
}

void McapRecording::copy_until(std::size_t index) {
    for (; next_ < frames_.size() && frames_[next_] != index; ++next_) {
        if (!kept_.contains(frames_[next_]))
            continue;
        const Place& place = earlier_.at(capture_.entries[frames_[next_]].name);
        append(FileBytes(*place.file).bytes(place.group.at, place.group.size));
    }
}

void McapRecording::add(std::size_t index, const std::string& group) {
    copy_until(index);
    append(group);
    output_->flush(); // what the journal says next must be there, whatever becomes of this process
    ++next_;
}

void McapRecording::finish() {
    copy_until(std::numeric_limits<std::size_t>::max());
    const std::uint64_t messages = output_->messages();
    output_->finish();
    publish(part_, file_);
    std::error_code ignored;
    for (const auto& [number, part] : parts())
        fs::remove(part, ignored);
    constexpr double megabyte = 1e6;
    summary_ = fmt::format("{}, {}, {:.1f} MB", counted(added_, "frame"), counted(messages, "message"),
                           static_cast<double>(output_->bytes()) / megabyte);
}

std::int64_t McapRecording::stamp_ns(std::size_t index) const {
    if (own_stamps_) {
        // Seconds since 1970 as a double are known to a quarter of a microsecond.
        constexpr double since_1970_s = 1e8, us_per_s = 1e6;
        constexpr std::int64_t ns_per_us = 1000;
        const double stamp_s = *capture_.entries[index].stamp_s;
        return stamp_s > since_1970_s ? std::llround(stamp_s * us_per_s) * ns_per_us : std::llround(stamp_s * ns_per_s);
    }
    constexpr double per_s = 30;
    return std::llround(static_cast<double>(index + 1) * ns_per_s / per_s); // ROS takes 0 for no time
}

} // namespace scanshade
