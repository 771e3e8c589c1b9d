// A recording of ROS as a capture: which topics are depth, colour and their cameras, what belongs together, and the
// poses by /tf. Recordings of RealSense's own tools have other topics and bring their unit along.
#include "io/captures/listing/layouts.h"
#include "io/captures/recordings/ros/messages.h"
#include "io/captures/recordings/ros/transforms.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/images/image_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <set>

namespace scanshade {

namespace fs = std::filesystem;
using namespace ros;

namespace {

/// One or several bags, their topics joined by name, their messages in the order of time.
class Recording {
  public:
    explicit Recording(const std::vector<fs::path>& files) {
        for (const fs::path& file : files) {
            const auto bag = open_bag(file);
            warnings.insert(warnings.end(), bag->warnings.begin(), bag->warnings.end());
            std::vector<std::uint32_t> index;
            for (const Topic& topic : bag->topics) {
                auto same = std::ranges::find_if(
                    topics, [&](const Topic& t) { return t.name == topic.name && t.type == topic.type; });
                if (same == topics.end())
                    same = topics.insert(topics.end(), topic);
                else
                    same->messages += topic.messages;
                index.push_back(static_cast<std::uint32_t>(same - topics.begin()));
            }
            for (Message message : bag->messages) {
                message.topic = index[message.topic];
                message.file = static_cast<std::uint32_t>(bags.size());
                messages.push_back(message);
            }
            bags.push_back(bag);
        }
        std::ranges::stable_sort(messages, {}, &Message::recorded_ns);
    }

    [[nodiscard]] std::string bytes(const Message& message) const { return bags[message.file]->bytes(message); }
    [[nodiscard]] Encoding encoding(const Message& message) const { return topics[message.topic].encoding; }
    [[nodiscard]] std::string where(const Message& message) const {
        return fmt::format("{}: {} at {:.9f} s", bags[message.file]->path.string(), topics[message.topic].name,
                           static_cast<double>(message.recorded_ns) * 1e-9);
    }
    /// What `decode` makes of a message; errors name the message.
    template <class Decode>
    auto decoded(const Message& message, const Decode& decode) const {
        return during(where(message), [&] { return decode(std::string_view(bytes(message)), encoding(message)); });
    }
    [[nodiscard]] const Message* first(std::uint32_t topic) const {
        const auto found = std::ranges::find(messages, topic, &Message::topic);
        return found == messages.end() ? nullptr : &*found;
    }
    [[nodiscard]] std::optional<std::uint32_t> topic_named(std::string_view name) const {
        const auto found = std::ranges::find(topics, name, &Topic::name);
        return found == topics.end() || found->messages == 0
                   ? std::nullopt
                   : std::optional(static_cast<std::uint32_t>(found - topics.begin()));
    }
    [[nodiscard]] std::string topics_listed() const {
        std::vector<std::string> rows;
        for (const Topic& topic : topics)
            rows.push_back(fmt::format("{} ({}, {})", topic.name, topic.type, topic.messages));
        return fmt::format("{}", fmt::join(rows, ", "));
    }

    std::vector<std::shared_ptr<const Bag>> bags;
    std::vector<Topic> topics;
    std::vector<Message> messages;
    std::vector<std::string> warnings;
};

bool is_compressed(const Topic& topic) { return topic.type == "sensor_msgs/CompressedImage"; }
bool is_realsense(const std::string& topic) { return topic.starts_with("/device_"); }

/// The frames' messages: depth, and colour where there is one.
class RosFrames final : public FrameContainer {
  public:
    explicit RosFrames(std::shared_ptr<const Recording> recording) : recording_(std::move(recording)) {}

    /// Integers are millimetres: given as metres where other frames of the topic are floats.
    bool in_metres = false;

    [[nodiscard]] cv::Mat image(Part part, std::size_t place) const override {
        const Message& message = part == Part::depth ? frames.at(place).depth : frames.at(place).colour.value();
        const bool compressed = is_compressed(recording_->topics[message.topic]);
        return recording_->decoded(message, [&](std::string_view bytes, Encoding encoding) -> cv::Mat {
            if (part == Part::depth)
                return as_others(compressed ? depth_in(compressed_image_in(bytes, encoding))
                                            : depth_in(image_in(bytes, encoding)));
            return compressed ? scanshade::colour_in(compressed_image_in(bytes, encoding).data, "a message's image")
                              : ros::colour_in(image_in(bytes, encoding));
        });
    }

    struct Pair {
        Message depth;
        std::optional<Message> colour;
    };
    std::vector<Pair> frames;

  private:
    [[nodiscard]] cv::Mat as_others(cv::Mat depth) const {
        if (in_metres && depth.type() == CV_16UC1)
            depth.convertTo(depth, CV_32F, 0.001);
        return depth;
    }

    std::shared_ptr<const Recording> recording_;
};

// ---------------------------------------------------------------------------------------------------- topics

bool holds(std::string text, std::initializer_list<const char*> words) {
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return std::ranges::any_of(words, [&](const char* word) { return text.find(word) != std::string::npos; });
}

/// The name without what image_transport appends.
std::string base_of(const std::string& topic) {
    for (const std::string_view end : {"/compressedDepth", "/compressed"})
        if (topic.ends_with(end))
            return topic.substr(0, topic.size() - end.size());
    return topic;
}

std::string parent_of(const std::string& topic) { return topic.substr(0, topic.rfind('/')); }

/// The topic of the camera's numbers that belongs to a topic of images.
std::string camera_topic(const Recording& recording, const std::string& images) {
    if (!is_realsense(images))
        return parent_of(base_of(images)) + "/camera_info";
    const std::string stream = parent_of(parent_of(images)); // .../Depth_0/image/data
    for (const char* name : {"/info/camera_info", "/camera_info"})
        if (recording.topic_named(stream + name))
            return stream + name;
    return stream + "/camera_info";
}

/// How an image's numbers are written: "16UC1", "jpeg" ...; empty where the first message cannot be read.
std::string encoding_of(const Recording& recording, std::uint32_t topic) {
    try {
        return recording.decoded(*recording.first(topic), [&](std::string_view bytes, Encoding encoding) {
            return is_compressed(recording.topics[topic]) ? compressed_image_in(bytes, encoding).format
                                                          : image_in(bytes, encoding).encoding;
        });
    } catch (const Outage&) {
        throw;
    } catch (const Error&) {
        return "";
    }
}

bool depth_encoded(const std::string& encoding) {
    return encoding == "16UC1" || encoding == "mono16" || encoding == "32FC1" ||
           encoding.find("compressedDepth") != std::string::npos;
}

/// Of a recording of lidars, which has no image that --topic could name as depth.
void refuse_clouds(const Recording& recording, const fs::path& path) {
    constexpr std::array types{"sensor_msgs/PointCloud2",    "sensor_msgs/PointCloud",
                               "sensor_msgs/LaserScan",      "velodyne_msgs/VelodyneScan",
                               "livox_ros_driver/CustomMsg", "livox_ros_driver2/CustomMsg",
                               "foxglove.PointCloud"};
    std::vector<std::string> clouds;
    for (std::uint32_t i = 0; i < recording.topics.size(); ++i) {
        const Topic& topic = recording.topics[i];
        if (topic.messages > 0 && has_image_header(topic) && depth_encoded(encoding_of(recording, i)))
            return;
        if (topic.messages > 0 && std::ranges::count(types, topic.type) > 0)
            clouds.push_back(fmt::format("{} ({}, {})", topic.name, topic.type, topic.messages));
    }
    if (!clouds.empty())
        throw NoFrames(
            fmt::format("{}: clouds and no depth images: {}. Clouds of recordings are not read: export them as "
                        "PCD or PLY (`rosrun pcl_ros bag_to_pcd`, or a node that saves PointCloud2), and give "
                        "the folder of these files",
                        path.string(), fmt::join(clouds, ", ")));
}

/// The topic of depth: the one that the user names, or the best by name, encoding and camera.
std::uint32_t depth_topic(const Recording& recording, const std::string& wanted, const fs::path& path,
                          std::vector<std::string>& warnings) {
    if (!wanted.empty()) {
        const auto named = recording.topic_named(wanted);
        if (!named)
            throw Misuse(fmt::format("--topic {}: {} has {}", wanted, path.string(), recording.topics_listed()));
        if (const Topic& topic = recording.topics[*named]; !has_image_header(topic))
            throw Misuse(fmt::format("--topic {}: its messages are {}, expected images of depth", wanted, topic.type));
        return *named;
    }
    struct Candidate {
        std::uint32_t topic;
        int worth;
    };
    std::vector<Candidate> candidates;
    for (std::uint32_t i = 0; i < recording.topics.size(); ++i) {
        const Topic& topic = recording.topics[i];
        if (!has_image_header(topic) || topic.messages == 0 || topic.encoding == Encoding::unknown ||
            !holds(topic.name, {"depth"}) || holds(topic.name, {"infra", "confidence"}) ||
            !depth_encoded(encoding_of(recording, i)))
            continue;
        const int aligned = holds(topic.name, {"aligned_depth_to_color", "depth_registered", "depth_to_rgb"}) ? 4 : 0,
                  camera = recording.topic_named(camera_topic(recording, topic.name)) ? 2 : 0,
                  raw = is_compressed(topic) ? 0 : 1;
        candidates.push_back({i, aligned + camera + raw});
    }
    if (candidates.empty()) {
        refuse_clouds(recording, path);
        const bool unreadable = std::ranges::any_of(recording.topics, [](const Topic& topic) {
            return topic.messages > 0 && topic.encoding == Encoding::unknown;
        });
        throw NoFrames(fmt::format("{}: no topic of depth images{}; --topic names one. It has {}", path.string(),
                                   unreadable ? " (messages of ROS 1 and CDR are read)" : "",
                                   recording.topics_listed()));
    }
    const auto best = std::ranges::max_element(candidates, {}, &Candidate::worth);
    for (const Candidate& candidate : candidates)
        if (candidate.topic != best->topic)
            warnings.push_back(fmt::format("{}: depth is {}; {} is not used (--topic).", path.string(),
                                           recording.topics[best->topic].name, recording.topics[candidate.topic].name));
    return best->topic;
}

std::optional<std::uint32_t> colour_topic(const Recording& recording, std::uint32_t depth) {
    const auto worth = [&](const Topic& topic) {
        return (holds(topic.name, {"color", "colour", "rgb"}) ? 4 : 0) + (is_compressed(topic) ? 0 : 1) +
               (recording.topic_named(camera_topic(recording, topic.name)) ? 2 : 0);
    };
    std::optional<std::uint32_t> best;
    for (std::uint32_t i = 0; i < recording.topics.size(); ++i) {
        const Topic& topic = recording.topics[i];
        if (i == depth || !has_image_header(topic) || topic.messages == 0 || topic.encoding == Encoding::unknown ||
            holds(topic.name, {"depth", "infra", "confidence", "/ir/", "theora", "/scanshade/ao", "/scanshade/shaded"}))
            continue;
        const std::string encoding = encoding_of(recording, i);
        if (encoding.empty() || depth_encoded(encoding))
            continue;
        if (!best || worth(topic) > worth(recording.topics[*best]))
            best = i;
    }
    return best;
}

// ---------------------------------------------------------------------------------------------------- cameras

CameraInfo info_from_settings(std::string_view bytes, Encoding encoding) {
    auto settings = settings_in(bytes, encoding);
    const auto value = [&](const char* key) {
        const auto found = number(settings[key]);
        if (!found)
            throw Error(fmt::format("{}={}, expected a number", key, in_quotes(settings[key])));
        return *found;
    };
    CameraInfo info;
    info.size = image_size(value("width"), value("height"), "the camera");
    info.k = {value("fx"), 0, value("ppx"), 0, value("fy"), value("ppy"), 0, 0, 1};
    info.model = settings["model"];
    std::string coefficients = settings["coeffs"];
    std::ranges::replace(coefficients, ',', ' ');
    for (const std::string_view word : words(coefficients))
        info.lens.push_back(number(word).value_or(std::nan("")));
    return info;
}

struct CameraFound {
    CameraInfo info;
    Camera camera;
};

/// The camera of a topic of images of this size; warns where there is none.
std::optional<CameraFound> camera_for(const Recording& recording, std::uint32_t images, cv::Size size,
                                      std::vector<std::string>& warnings) {
    const std::string& name = recording.topics[images].name;
    const std::string topic = camera_topic(recording, name);
    const auto index = recording.topic_named(topic);
    if (!index) {
        warnings.push_back(fmt::format("{} has no camera: there is no topic {}.", name, topic));
        return std::nullopt;
    }
    const Message& message = *recording.first(*index);
    return recording.decoded(message, [&](std::string_view bytes, Encoding encoding) -> std::optional<CameraFound> {
        const CameraInfo info = recording.topics[*index].type == "std_msgs/String" ? info_from_settings(bytes, encoding)
                                                                                   : camera_info_in(bytes, encoding);
        auto camera = camera_of(info, holds(name, {"rect"}), size);
        if (!camera) {
            warnings.push_back(fmt::format("{}: no focal length; it is not used.", topic));
            return std::nullopt;
        }
        camera->origin = topic;
        if (info.model == "Inverse Brown Conrady" && camera->distortion.any())
            warnings.push_back(
                fmt::format("{}: its lens model works in the inverse direction; taken as Brown-Conrady.", topic));
        return CameraFound{info, *camera};
    });
}

/// Pose of the reference stream in a stream of RealSense's recorder; nothing where the recording has none.
std::optional<Eigen::Isometry3d> stream_from_reference(const Recording& recording, const std::string& images) {
    const std::string prefix = parent_of(parent_of(images)) + "/tf/";
    for (std::uint32_t i = 0; i < recording.topics.size(); ++i) {
        const Topic& topic = recording.topics[i];
        if (!topic.name.starts_with(prefix) || topic.messages == 0)
            continue;
        return recording.decoded(*recording.first(i), [&](std::string_view bytes, Encoding encoding) {
            if (topic.type != "std_msgs/String")
                return transform_in(bytes, encoding);
            auto settings = settings_in(bytes, encoding);
            std::vector<double> numbers; // the rotation by columns, then the translation
            for (const char* key : {"rotation", "translation"}) {
                std::ranges::replace(settings[key], ',', ' ');
                for (const std::string_view word : words(settings[key]))
                    numbers.push_back(number(word).value_or(std::nan("")));
            }
            if (numbers.size() != 12 || !std::ranges::all_of(numbers, [](double v) { return std::isfinite(v); }))
                throw Error("expected a rotation of 9 numbers and a translation of 3");
            Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
            pose.linear() = Eigen::Map<const Eigen::Matrix3d>(numbers.data());
            pose.translation() = Eigen::Map<const Eigen::Vector3d>(numbers.data() + 9);
            return pose;
        });
    }
    return std::nullopt;
}

/// RealSense's unit in metres, and who says so.
std::pair<double, std::string> realsense_unit(const Recording& recording, std::uint32_t depth) {
    const Topic& topic = recording.topics[depth];
    if (!is_compressed(topic))
        if (const ImageMessage image = recording.decoded(*recording.first(depth), image_in);
            image.unit_m && *image.unit_m > 0)
            return {*image.unit_m, "the unit behind each image"};
    const std::string option = parent_of(parent_of(parent_of(topic.name))) + "/option/Depth_Units/value";
    if (const auto index = recording.topic_named(option)) {
        const double unit = recording.decoded(*recording.first(*index), [&](std::string_view bytes, Encoding encoding) {
            return recording.topics[*index].type == "std_msgs/String"
                       ? number(settings_in(bytes, encoding)[""]).value_or(0)
                       : double(float_in(bytes, encoding));
        });
        if (unit > 0 && std::isfinite(unit))
            return {unit, option};
    }
    return {0, ""};
}

DepthEncoding depth_unit(const Recording& recording, std::uint32_t depth, const cv::Mat& first) {
    if (first.type() == CV_32FC1)
        return usual_encoding("m", "ROS: floats are metres");
    if (is_realsense(recording.topics[depth].name))
        if (const auto [unit, origin] = realsense_unit(recording, depth); unit > 0) {
            double units_per_metre = 1 / unit; // a float's 0.001 is not quite a thousandth
            if (std::abs(units_per_metre / std::round(units_per_metre) - 1) < 1e-5)
                units_per_metre = std::round(units_per_metre);
            return depth_encoding(fmt::format("{}", units_per_metre), origin);
        }
    return usual_encoding("mm", "ROS: 16-bit integers are millimetres");
}

// ---------------------------------------------------------------------------------------------------- frames

/// Each colour message belongs to the nearest depth, and each is used once.
std::vector<std::optional<Message>> paired(const std::vector<Message>& depths, const std::vector<Message>& colours,
                                           double limit_s) {
    std::vector<std::optional<Message>> pairs(depths.size());
    const auto limit_ns = static_cast<std::int64_t>(limit_s * 1e9);
    std::size_t next = 0;
    for (std::size_t i = 0; i < depths.size(); ++i) {
        const auto away = [&](const Message& colour) { return std::abs(colour.stamp_ns - depths[i].stamp_ns); };
        while (next + 1 < colours.size() && away(colours[next + 1]) <= away(colours[next]))
            ++next;
        if (next < colours.size() && away(colours[next]) <= limit_ns)
            pairs[i] = colours[next++];
    }
    return pairs;
}

std::vector<Message> messages_of(const Recording& recording, std::uint32_t topic, std::vector<std::string>& warnings) {
    std::vector<Message> messages;
    std::ranges::copy_if(recording.messages, std::back_inserter(messages),
                         [&](const Message& message) { return message.topic == topic; });
    const bool stamped = std::ranges::any_of(messages, [](const Message& message) { return message.stamp_ns > 0; });
    for (Message& message : messages)
        if (!stamped || message.stamp_ns == no_stamp)
            message.stamp_ns = message.recorded_ns;
    if (!stamped)
        warnings.push_back(
            fmt::format("{}: no header has a time; the recorder's is taken.", recording.topics[topic].name));
    std::ranges::stable_sort(messages, {}, &Message::stamp_ns);
    return messages;
}

Transforms transforms_of(const Recording& recording, std::vector<std::string>& warnings) {
    Transforms transforms;
    RepeatedWarning damaged(warnings);
    for (const Message& message : recording.messages) {
        const Topic& topic = recording.topics[message.topic];
        if (topic.encoding == Encoding::unknown || (topic.type != "tf2_msgs/TFMessage" && topic.type != "tf/tfMessage"))
            continue;
        try {
            for (const Transform& transform : recording.decoded(message, transforms_in))
                transforms.add(transform, topic.name.find("static") != std::string::npos);
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            damaged.add(fmt::format("{}; not used.", failure.what()));
        }
    }
    transforms.settle();
    return transforms;
}

/// The first image that can be decoded; none of the first few means that depth cannot be read. compressedDepth may mix
/// integers and floats: then all become floats.
cv::Mat first_depth(RosFrames& frames, bool may_mix, const fs::path& path) {
    std::string why = path.string() + ": no depth";
    constexpr std::size_t tries = 8;
    cv::Mat first;
    for (std::size_t i = 0; i < std::min(tries, frames.frames.size()) && (first.empty() || may_mix); ++i) {
        try {
            const cv::Mat depth = frames.image(FrameContainer::Part::depth, i);
            frames.in_metres = frames.in_metres || (may_mix && depth.type() == CV_32FC1);
            if (first.empty() || depth.type() == CV_32FC1)
                first = depth;
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            why = failure.what();
        }
    }
    if (first.empty())
        throw Error(why);
    return first;
}

std::string frame_of(const Recording& recording, std::uint32_t images) {
    return recording.decoded(*recording.first(images), [&](std::string_view bytes, Encoding encoding) {
        return is_compressed(recording.topics[images]) ? compressed_image_in(bytes, encoding).header.frame
                                                       : image_in(bytes, encoding).header.frame;
    });
}

/// Where the colour was taken: on depth's pixels, by a camera beside it, or unknown.
void settle_colour(const Recording& recording, std::uint32_t depth, std::uint32_t colour, const RosFrames& frames,
                   const Transforms& transforms, CameraFile& file) {
    const auto with_colour =
        std::ranges::find_if(frames.frames, [](const RosFrames::Pair& pair) { return pair.colour.has_value(); });
    if (with_colour == frames.frames.end())
        return;
    const cv::Size size =
        frames.size(FrameContainer::Part::colour, static_cast<std::size_t>(with_colour - frames.frames.begin()));
    const std::string &depth_name = recording.topics[depth].name, &colour_name = recording.topics[colour].name;
    const auto camera = camera_for(recording, colour, size, file.warnings);
    const Pinhole& k = file.camera.pinhole;
    const bool realsense = is_realsense(depth_name);
    const std::string depth_frame = frame_of(recording, depth), colour_frame = frame_of(recording, colour);
    const auto same = [](double a, double b) { return std::abs(a - b) < 0.01; };
    std::optional<Eigen::Isometry3d> apart;
    if (!realsense) {
        apart = transforms.between(colour_frame, depth_frame);
    } else {
        const auto depth_pose = stream_from_reference(recording, depth_name),
                   colour_pose = stream_from_reference(recording, colour_name);
        if (depth_pose && colour_pose)
            apart = *colour_pose * depth_pose->inverse();
    }
    const bool alike = camera && size == k.size && !realsense && apart &&
                       apart->isApprox(Eigen::Isometry3d::Identity(), 1e-6) && same(camera->camera.pinhole.fx, k.fx) &&
                       same(camera->camera.pinhole.cx, k.cx) && same(camera->camera.pinhole.fy, k.fy) &&
                       same(camera->camera.pinhole.cy, k.cy);
    if (alike || (holds(depth_name, {"aligned_depth_to_color", "depth_registered"}) && size == k.size)) {
        file.registration = Registration::yes;
        return;
    }
    file.registration = Registration::no;
    if (camera && apart)
        file.colour = ColourCamera{camera->camera, *apart};
    else if (camera)
        file.warnings.push_back(
            fmt::format("nothing tells where the camera of {} is; its images are not used.", colour_name));
}

} // namespace

Listing list_ros(const fs::path& path, const CaptureOptions& options) {
    return list_ros(path, std::vector{path}, options);
}

Listing list_ros(const fs::path& path, const std::vector<fs::path>& files, const CaptureOptions& options) {
    const auto recording = std::make_shared<const Recording>(files);
    Listing listing;
    listing.may_stand_still = true;
    Capture& capture = listing.capture;
    capture.warnings = recording->warnings;
    const std::uint32_t depth = depth_topic(*recording, options.topic, path, capture.warnings);
    const std::optional<std::uint32_t> colour = colour_topic(*recording, depth);
    if (is_realsense(recording->topics[depth].name))
        capture.kind = "RealSense recording";

    const auto frames = std::make_shared<RosFrames>(recording);
    const std::vector<Message> depths = messages_of(*recording, depth, capture.warnings);
    const std::vector<Message> colours =
        colour ? messages_of(*recording, *colour, capture.warnings) : std::vector<Message>();
    const auto pairs = paired(depths, colours, options.association_limit_s);
    const Transforms transforms = transforms_of(*recording, capture.warnings);
    const std::string frame = frame_of(*recording, depth);
    for (std::size_t i = 0; i < depths.size(); ++i) {
        CaptureEntry entry;
        entry.container = frames;
        entry.place = i;
        entry.depth = recording->bags[depths[i].file]->path.string();
        const std::int64_t stamp_ns = depths[i].stamp_ns;
        entry.name = fmt::format("{}.{:09}", stamp_ns / 1'000'000'000, std::abs(stamp_ns % 1'000'000'000));
        entry.stamp_s = static_cast<double>(stamp_ns) * 1e-9;
        if (pairs[i]) {
            entry.colour = recording->bags[pairs[i]->file]->path.string();
            entry.colour_stamp_s = static_cast<double>(pairs[i]->stamp_ns) * 1e-9;
        } else if (colour) {
            entry.warnings.push_back(fmt::format("no colour image within {} s.", options.association_limit_s));
        }
        entry.world_from_camera = transforms.world_from(frame, *entry.stamp_s);
        frames->frames.push_back({depths[i], pairs[i]});
        capture.entries.push_back(std::move(entry));
    }
    const auto posed = static_cast<std::size_t>(std::ranges::count_if(
        capture.entries, [](const CaptureEntry& entry) { return entry.world_from_camera.has_value(); }));
    if (posed > 0 && posed < capture.entries.size())
        capture.warnings.push_back(fmt::format(
            "{} of {} have no pose in /tf.", counted(capture.entries.size() - posed, "frame"), capture.entries.size()));
    if (posed > 0 && !transforms.optical(frame))
        capture.warnings.push_back(fmt::format("the frame {} is not named optical, and nothing turns it: taken as x "
                                               "right, y down, z forward.",
                                               in_quotes(frame)));
    if (posed == 0)
        for (const Topic& topic : recording->topics)
            if (topic.type == "nav_msgs/Odometry" || topic.type == "geometry_msgs/PoseStamped")
                capture.warnings.push_back(
                    fmt::format("{} ({}) is not used; poses come from /tf.", topic.name, topic.type));

    const cv::Mat first = first_depth(*frames, is_compressed(recording->topics[depth]), path);
    capture.depth = depth_unit(*recording, depth, first);
    capture.registration_reason = colour ? "nothing tells where the colour was taken" : "there is no colour";
    listing.find_camera = [=, size = first.size()](cv::Size,
                                                   std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        const auto found = camera_for(*recording, depth, size, warnings);
        if (!found)
            return std::nullopt;
        CameraFile file;
        file.camera = found->camera;
        if (colour)
            settle_colour(*recording, depth, *colour, *frames, transforms, file);
        return file;
    };
    return listing;
}

namespace {

/// "day_0.mcap", "day_1.mcap": one recording that rosbag2 cut into files.
bool are_parts(const std::vector<fs::path>& files) {
    const auto recording_of = [](const fs::path& file) {
        const std::string stem = file.stem().string();
        const std::size_t end = stem.rfind('_');
        return end != std::string::npos && whole_number(stem.substr(end + 1)) ? stem.substr(0, end) : "";
    };
    const std::string first = recording_of(files.front());
    return !first.empty() &&
           std::ranges::all_of(files, [&](const fs::path& file) { return recording_of(file) == first; });
}

} // namespace

std::optional<Listing> list_rosbag2_folder(const fs::path& folder, const CaptureOptions& options) {
    const fs::path metadata = folder / "metadata.yaml";
    std::vector<fs::path> files;
    if (is_file(metadata)) {
        const std::string bytes = read_list_file(metadata);
        if (!bytes.starts_with("rosbag2_bagfile_information:"))
            return std::nullopt;
        // The list is YAML, but of one form only, since one program writes it.
        bool listed_now = false;
        for (const TextLine& line : text_lines(bytes)) {
            std::string_view text = trimmed(line.text);
            if (text.starts_with("relative_file_paths:")) {
                listed_now = true;
            } else if (listed_now && text.starts_with("- ")) {
                std::string_view name = trimmed(text.substr(2));
                while (name.size() > 1 && (name.front() == '"' || name.front() == '\''))
                    name = name.substr(1, name.size() - 2);
                if (const std::string trouble = trouble_with(folder, std::string(name)); !trouble.empty())
                    throw Error(fmt::format("{}: {}", at_line(metadata, line.number), trouble));
                files.push_back(folder / name);
            } else {
                listed_now = false;
            }
        }
        if (files.empty())
            throw Error(metadata.string() + ": no file under \"relative_file_paths\"");
    } else {
        for (const fs::path& file : files_in(folder))
            if (const std::string extension = lower_extension(file); extension == ".db3" || extension == ".mcap")
                files.push_back(file);
        if (files.size() < 2 || !are_parts(files))
            return std::nullopt; // a folder's only recording is found by its first bytes
    }
    for (const fs::path& file : files)
        if (lower_extension(file) == ".zstd")
            throw Error(file.string() + ": packed as a whole; `zstd -d FILE` unpacks it");
    Listing listing = list_ros(folder, files, options);
    if (!is_file(metadata))
        listing.capture.warnings.push_back(fmt::format("{}: no metadata.yaml; {} are taken as one recording.",
                                                       folder.string(), counted(files.size(), "file")));
    return listing;
}

} // namespace scanshade
