// Messages of ROS 2, written in CDR (OMG's DDS-XTypes 7.4, little-endian), and their definitions. The reverse of
// messages.h.
#pragma once

#include "io/captures/recordings/ros/messages.h"

#include <cstdint>
#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::ros {

/// 16UC1, 32FC1, mono8 ...: as `encoding` says, which must fit the pixels. Rows are not padded.
[[nodiscard]] std::string image_message(const Header& header, const cv::Mat& image, const std::string& encoding);
[[nodiscard]] std::string message_of(const CompressedImage& image);
[[nodiscard]] std::string message_of(const CameraInfo& info);
/// tf2_msgs/msg/TFMessage
[[nodiscard]] std::string message_of(const std::vector<Transform>& transforms);
/// std_msgs/msg/String
[[nodiscard]] std::string text_message(std::string_view text);

/// The numbers of images without binning or regions: K, lens and P of the same camera, R the identity. `camera` is that
/// of the pixels, lens included.
[[nodiscard]] CameraInfo info_of(const Camera& camera, Header header);

/// A float of each point.
struct PointField {
    std::string name;
    std::span<const float> values;
};
struct PointCloud {
    Header header = {};
    std::span<const Eigen::Vector3d> points = {};
    Eigen::Vector3d origin = Eigen::Vector3d::Zero(); ///< is taken off each point: floats have seven digits
    cv::Size grid = {};                               ///< empty = one row
    std::span<const cv::Vec3b> colours = {};          ///< BGR; empty = no field rgb
    std::vector<PointField> fields = {};
};
/// The bytes of the points in the message.
[[nodiscard]] std::uint64_t bytes_of(const PointCloud& cloud);
/// sensor_msgs/msg/PointCloud2 with x, y, z, rgb (packed in a float, as PCL does) and the fields. Throws Error for more
/// bytes than its length can say, 2^32 - 1.
[[nodiscard]] std::string message_of(const PointCloud& cloud);

/// "sensor_msgs/msg/Image" as a ros2msg text with all types in it; throws Error for a type that is not written.
[[nodiscard]] std::string definition_of(std::string_view type);

} // namespace scanshade::ros
