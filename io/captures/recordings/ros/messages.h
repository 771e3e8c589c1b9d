// The messages of ROS that make a recording, decoded: sensor_msgs, tf2_msgs, and what RealSense's recorder adds. The
// definitions are those of ROS 1 and 2, which differ in their header alone.
#pragma once

#include "io/captures/recordings/ros/bag.h"
#include "projection/camera.h"

#include <array>
#include <Eigen/Geometry>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace scanshade::ros {

struct Header {
    std::int64_t stamp_ns = 0;
    std::string frame; ///< without a leading slash
};

struct ImageMessage {
    Header header;
    cv::Size size;
    std::string encoding; ///< "16UC1", "rgb8" ...
    bool big_endian = false;
    std::size_t step = 0; ///< bytes from row to row
    std::string data;
    /// Metres per unit, which RealSense's recorder puts behind the image.
    std::optional<float> unit_m;
};

struct CompressedImage {
    Header header;
    std::string format, data;
};

struct CameraInfo {
    Header header;
    cv::Size size; ///< 0x0 where it is not given
    std::string model;
    std::vector<double> lens;
    std::array<double, 9> k{}, r{};
    std::array<double, 12> p{};
    std::uint32_t binning_x = 0, binning_y = 0;
    cv::Rect region; ///< of the full image; 0x0 = all of it
};

struct Transform {
    std::int64_t stamp_ns = 0;
    std::string parent, child;
    Eigen::Isometry3d parent_from_child;
};

// Each throws Error, without a file's name, for messages that are cut short or absurd.
[[nodiscard]] ImageMessage image_in(std::string_view bytes, Encoding encoding);
[[nodiscard]] CompressedImage compressed_image_in(std::string_view bytes, Encoding encoding);
[[nodiscard]] CameraInfo camera_info_in(std::string_view bytes, Encoding encoding);
[[nodiscard]] std::vector<Transform> transforms_in(std::string_view bytes, Encoding encoding);
[[nodiscard]] float float_in(std::string_view bytes, Encoding encoding);                 ///< std_msgs/Float32
[[nodiscard]] Eigen::Isometry3d transform_in(std::string_view bytes, Encoding encoding); ///< geometry_msgs/Transform
/// "key=value;key=value", which RealSense's recorder writes since 2026; a text without "=" has the key "".
[[nodiscard]] std::map<std::string, std::string> settings_in(std::string_view bytes, Encoding encoding);

/// The numbers of a depth image as stored: integers of 16 bits (16UC1, mono16), or floats (32FC1).
[[nodiscard]] cv::Mat depth_in(const ImageMessage& image);
/// The same of image_transport's compressedDepth: PNG, or RVL (Wilson 2017); inverse depth becomes metres.
[[nodiscard]] cv::Mat depth_in(const CompressedImage& image);
/// 8-bit BGR.
[[nodiscard]] cv::Mat3b colour_in(const ImageMessage& image);

/// The pinhole of images of `size`, and their lens where they are not rectified. Throws Error for a model that is not
/// known; nothing where the message holds no camera.
[[nodiscard]] std::optional<Camera> camera_of(const CameraInfo& info, bool rectified, cv::Size size);

} // namespace scanshade::ros
