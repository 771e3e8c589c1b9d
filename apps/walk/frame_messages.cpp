#include "apps/walk/frame_messages.h"

#include "apps/frame/frame_points.h"
#include "apps/frame/outputs.h"
#include "apps/json.h"
#include "io/captures/recordings/ros/message_output.h"
#include "io/images/image_file.h"
#include "io/images/png_output.h"
#include "io/text.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

// Frames of tf. A camera's own axes are "optical" in ROS; those of its body are x forward, y left, z up (REP 103).
constexpr const char *world = "world", *body = "camera", *depth_camera = "camera_optical",
                     *colour_camera = "colour_camera_optical", *map = "map", *scanner = "scanner",
                     *cloud_frame = "cloud";

Isometry3d body_from_optical() {
    Isometry3d turn = Isometry3d::Identity();
    turn.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    return turn;
}

/// What is taken off points that floats cannot hold well: whole metres amid them, or nothing.
Vector3d origin_of(std::span<const Vector3d> points) {
    constexpr double far_away_m = 4096; // beyond, neighbouring floats are half a millimetre apart
    Eigen::AlignedBox3d box;
    for (const Vector3d& point : points)
        if (point.allFinite())
            box.extend(point);
    if (box.isEmpty() || std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()) <= far_away_m)
        return Vector3d::Zero();
    return box.center().array().round();
}

/// The messages of one frame.
class Messages {
  public:
    Messages(const Work& work, const McapRecording& recording)
        : sequence_(static_cast<std::uint32_t>(work.row.index + 1)), stamp_ns_(recording.stamp_ns(work.row.index)) {}

    void add(McapTopic topic, std::string data) {
        all_.push_back(
            {static_cast<std::uint16_t>(topic), sequence_, static_cast<std::uint64_t>(stamp_ns_), std::move(data)});
    }
    void add_png(McapTopic topic, const char* frame, const std::string& encoding, std::string png) {
        add(topic, ros::message_of(ros::CompressedImage{header(frame), fmt::format("{0}; png compressed {0}", encoding),
                                                        std::move(png)}));
    }
    void add_transforms(bool fixed, const std::vector<ros::Transform>& transforms) {
        add(fixed ? McapTopic::tf_static : McapTopic::tf, ros::message_of(transforms));
    }
    [[nodiscard]] ros::Header header(const char* frame) const { return {stamp_ns_, frame}; }
    [[nodiscard]] ros::Transform transform(const char* parent, const char* child, const Isometry3d& pose) const {
        return {stamp_ns_, parent, child, pose};
    }
    [[nodiscard]] std::string packed(const std::string& name) const { return ros::packed_group(name, all_); }

  private:
    std::uint32_t sequence_;
    std::int64_t stamp_ns_;
    std::vector<ros::NewMessage> all_;
};

/// Whether the images are those of the secondary camera.
bool in_colour_view(const Work& work, const Outputs& outputs) {
    return outputs.colour_view && !work.frame.cloud && has_secondary_camera(work.frame);
}

/// The camera of the scene's pixels, as recorded: with its lens.
Camera camera_of_images(const Work& work, const Scene& scene, bool of_colour) {
    Camera camera;
    camera.pinhole = scene.camera;
    if (of_colour)
        camera.distortion = work.frame.colour_camera->camera.distortion;
    else if (!work.frame.cloud || work.frame.cloud->organised())
        camera.distortion = work.frame.camera.distortion;
    return camera;
}

std::string depth_message(const ros::Header& header, const cv::Mat1f& z_m, bool in_millimetres) {
    if (in_millimetres) {
        cv::Mat1w stored(z_m.size());
        std::transform(z_m.begin(), z_m.end(), stored.begin(), [](float metres) {
            constexpr float per_metre = 1000;
            return cv::saturate_cast<ushort>(std::round(metres * per_metre));
        });
        return ros::image_message(header, stored, "16UC1");
    }
    cv::Mat1f metres = z_m.clone(); // REP 118: a float hole is NaN
    for (float& z : metres)
        if (!(z > 0))
            z = std::numeric_limits<float>::quiet_NaN();
    return ros::image_message(header, metres, "32FC1");
}

bool is_png(AoFormat format) { return format == AoFormat::png16 || format == AoFormat::png8; }

void add_images(Messages& messages, const Work& work, const FrameImages& images, const Outputs& outputs,
                bool in_millimetres) {
    const Scene& scene = images.scene;
    const bool of_colour = in_colour_view(work, outputs);
    const char* frame = of_colour ? colour_camera : depth_camera;
    messages.add(McapTopic::camera_info,
                 ros::message_of(ros::info_of(camera_of_images(work, scene, of_colour), messages.header(frame))));
    const LengthUnit& unit = outputs.unit;
    cv::Mat1f z = scene.z_m;
    if (unit.arbitrary())
        scene.z_m.convertTo(z = cv::Mat1f(), CV_32F, unit.units_per_length);
    messages.add(McapTopic::depth,
                 depth_message(messages.header(frame), z, in_millimetres && !of_colour && !unit.arbitrary()));
    const auto stored = [&](bool written, const std::filesystem::path& file, const auto& image) {
        return written ? read_bytes(outputs.folder / file) : encoded_png(image());
    };
    const std::string& name = work.entry.name;
    if (!scene.colour.empty())
        messages.add_png(McapTopic::colour, frame, "bgr8", encoded_png(scene.colour));
    const AoFormat format = outputs.format == AoFormat::png8 ? AoFormat::png8 : AoFormat::png16;
    messages.add_png(McapTopic::ao, frame, format == AoFormat::png8 ? "mono8" : "mono16",
                     stored(outputs.ao && is_png(outputs.format), ao_file(name, outputs), [&]() -> cv::Mat {
                         return images.map.empty() ? ao_integers(scene.visibility, format) : images.map;
                     }));
    messages.add_png(
        McapTopic::confidence, frame, "mono8",
        stored(outputs.confidence && is_png(outputs.format), confidence_file(name, outputs), [&]() -> cv::Mat {
            const cv::Mat1f& confidence = scene.confidence.empty() ? work.confidence.visibility : scene.confidence;
            return images.confidence_map.empty() ? ao_integers(confidence, AoFormat::png8)
                                                 : cv::Mat(images.confidence_map);
        }));
    messages.add_png(McapTopic::shaded, frame, "bgr8",
                     stored(outputs.shaded, picture_file("shaded", name), [&]() -> cv::Mat { return images.shaded; }));
}

/// The links that place the frame in the world, or its camera upright where no frame of the capture has a pose.
void add_transforms(Messages& messages, const Work& work, const Outputs& outputs, const McapRecording& recording,
                    const Vector3d& origin) {
    const char* own = work.by_points ? scanner : depth_camera;
    std::vector<ros::Transform> fixed, moving;
    if (recording.has_poses()) {
        if (std::optional<Isometry3d> pose = work.entry.world_from_camera) {
            pose->translation() *= outputs.unit.told(1);
            moving.push_back(messages.transform(world, own, *pose));
        }
    } else {
        fixed.push_back(work.by_points ? messages.transform(map, own, Isometry3d::Identity())
                                       : messages.transform(body, own, body_from_optical()));
    }
    if (!origin.isZero()) {
        Isometry3d shift = Isometry3d::Identity();
        shift.translation() = origin;
        moving.push_back(messages.transform(own, cloud_frame, shift));
    }
    if (in_colour_view(work, outputs))
        fixed.push_back(
            messages.transform(depth_camera, colour_camera, work.frame.colour_camera->colour_from_depth.inverse()));
    if (!fixed.empty())
        messages.add_transforms(true, fixed);
    if (!moving.empty())
        messages.add_transforms(false, moving);
}

std::string frame_text(const Work& work) {
    const auto known = [](double value) { return std::isfinite(value) ? json(std::round(value * 1e4) / 1e4) : json(); };
    const FrameRow& row = work.row;
    json text{{"name", row.name},
              {"index", row.index},
              {"status", any_doubt(row.findings) ? "doubtful" : "ok"},
              {"valid_share", known(row.valid_share)},
              {"coverage", known(row.coverage)},
              {"mean_visibility", known(row.mean_visibility)}};
    if (std::isfinite(row.expected_error))
        text["expected_error"] = known(row.expected_error);
    if (any_doubt(row.findings))
        text["doubts"] = doubts_in(row.findings);
    return json_line(text);
}

} // namespace

Outputs with_messages(const Outputs& outputs) {
    Outputs all = outputs;
    all.ao = all.confidence = all.shaded = all.cloud = all.depth_cloud = true;
    return all;
}

std::string frame_messages(Work& work, const FrameImages& images, const Outputs& outputs,
                           const McapRecording& recording) {
    const FramePoints all =
        work.frame.cloud ? points_of_cloud(work, outputs) : points_of_depth(work, images.scene, outputs);
    const Vector3d origin = origin_of(all.points);
    Messages messages(work, recording);
    messages.add(McapTopic::frame, ros::text_message(frame_text(work)));
    add_transforms(messages, work, outputs, recording, origin);
    if (!work.by_points)
        add_images(messages, work, images, outputs, recording.in_millimetres());
    ros::PointCloud cloud{.header = messages.header(!origin.isZero() ? cloud_frame
                                                    : work.by_points ? scanner
                                                                     : depth_camera),
                          .points = all.points,
                          .origin = origin,
                          .grid = {},
                          .colours = all.colours,
                          .fields = {{"ambient_occlusion", all.visibility}}};
    if (work.frame.cloud && work.frame.cloud->organised())
        cloud.grid = work.frame.cloud->grid;
    if (!all.confidence.empty())
        cloud.fields.push_back({"ao_confidence", all.confidence});
    if (ros::bytes_of(cloud) > std::numeric_limits<std::uint32_t>::max()) {
        work.row.warnings.push_back(fmt::format("{} do not fit into a message of ROS (4 GiB): {} has none of them.",
                                                counted(all.points.size(), "point"),
                                                recording.path().filename().string()));
    } else {
        require_memory(2 * ros::bytes_of(cloud), fmt::format("a message of {}", counted(all.points.size(), "point")));
        messages.add(McapTopic::points, ros::message_of(cloud));
    }
    return messages.packed(work.entry.name);
}

} // namespace scanshade
