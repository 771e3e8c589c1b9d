#include "io/captures/recordings/ros/message_output.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <limits>

namespace scanshade::ros {

namespace {

/// A message on its way: each number is aligned to its own size, counted from behind the first four bytes.
class Writer {
  public:
    template <class Number>
    Writer& add(Number value) {
        bytes_.resize(start_ + (bytes_.size() - start_ + sizeof value - 1) / sizeof value * sizeof value, '\0');
        const auto raw = std::bit_cast<std::array<char, sizeof value>>(value);
        bytes_.append(raw.data(), raw.size());
        return *this;
    }
    /// A text and the zero behind it.
    Writer& text(std::string_view text) {
        add(static_cast<std::uint32_t>(text.size() + 1));
        bytes_ += text;
        bytes_ += '\0';
        return *this;
    }
    Writer& header(const Header& header) {
        const std::int64_t second = 1'000'000'000;
        add(static_cast<std::int32_t>(header.stamp_ns / second));
        add(static_cast<std::uint32_t>(header.stamp_ns % second));
        return text(header.frame);
    }
    template <class Numbers>
    Writer& numbers(const Numbers& values) {
        for (const double value : values)
            add(value);
        return *this;
    }
    Writer& count(std::size_t count) { return add(static_cast<std::uint32_t>(count)); }
    Writer& data(std::string_view bytes) {
        count(bytes.size());
        bytes_ += bytes;
        return *this;
    }
    /// Room for so many bytes of data, to be filled.
    char* room(std::size_t size) {
        count(size);
        bytes_.resize(bytes_.size() + size);
        return bytes_.data() + bytes_.size() - size;
    }
    void reserve(std::size_t size) { bytes_.reserve(size); }
    [[nodiscard]] std::string take() { return std::move(bytes_); }

  private:
    static constexpr std::size_t start_ = 4;
    std::string bytes_{"\0\1\0\0", start_};
};

constexpr std::size_t message_head = 512; ///< room for all but data

// ---------------------------------------------------------------------------------------------------- definitions

struct Definition {
    std::string_view type;
    std::string_view fields;
    std::vector<std::string_view> uses = {}; ///< all types in it
};

constexpr std::string_view header_type = "std_msgs/msg/Header", time_type = "builtin_interfaces/msg/Time";

/// The fields of the public definitions (github.com/ros2: common_interfaces, geometry2, rcl_interfaces), in their
/// order.
const std::vector<Definition>& definitions() {
    static const std::vector<Definition> rows{
        {time_type, "int32 sec\nuint32 nanosec\n"},
        {header_type, "builtin_interfaces/Time stamp\nstring frame_id\n"},
        {"std_msgs/msg/String", "string data\n"},
        {"sensor_msgs/msg/Image",
         "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
         "uint8[] data\n",
         {header_type, time_type}},
        {"sensor_msgs/msg/CompressedImage",
         "std_msgs/Header header\nstring format\nuint8[] data\n",
         {header_type, time_type}},
        {"sensor_msgs/msg/RegionOfInterest",
         "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"},
        {"sensor_msgs/msg/CameraInfo",
         "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
         "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
         {header_type, time_type, "sensor_msgs/msg/RegionOfInterest"}},
        {"sensor_msgs/msg/PointField",
         "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n"
         "uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n"},
        {"sensor_msgs/msg/PointCloud2",
         "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
         "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
         {header_type, time_type, "sensor_msgs/msg/PointField"}},
        {"geometry_msgs/msg/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
        {"geometry_msgs/msg/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"},
        {"geometry_msgs/msg/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
        {"geometry_msgs/msg/TransformStamped",
         "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
        {"tf2_msgs/msg/TFMessage",
         "geometry_msgs/TransformStamped[] transforms\n",
         {"geometry_msgs/msg/TransformStamped", header_type, time_type, "geometry_msgs/msg/Transform",
          "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Quaternion"}}};
    return rows;
}

const Definition& definition_row(std::string_view type) {
    const auto row = std::ranges::find(definitions(), type, &Definition::type);
    if (row == definitions().end())
        throw Error(fmt::format("messages of the type {} are not written", type));
    return *row;
}

/// "sensor_msgs/msg/Image" -> "sensor_msgs/Image"
std::string short_name(std::string_view type) {
    std::string name(type);
    constexpr std::string_view middle = "/msg/";
    return name.replace(name.find(middle), middle.size(), "/");
}

} // namespace

std::string definition_of(std::string_view type) {
    const Definition& row = definition_row(type);
    std::string text(row.fields);
    for (const std::string_view used : row.uses)
        text += fmt::format("{:=>80}\nMSG: {}\n{}", "", short_name(used), definition_row(used).fields);
    return text;
}

std::string image_message(const Header& header, const cv::Mat& image, const std::string& encoding) {
    const std::size_t step = static_cast<std::size_t>(image.cols) * image.elemSize();
    Writer writer;
    writer.reserve(message_head + step * static_cast<std::size_t>(image.rows));
    writer.header(header).count(static_cast<std::size_t>(image.rows)).count(static_cast<std::size_t>(image.cols));
    writer.text(encoding).add(std::uint8_t(0)).count(step);
    char* data = writer.room(step * static_cast<std::size_t>(image.rows));
    for (int row = 0; row < image.rows; ++row)
        std::memcpy(data + static_cast<std::size_t>(row) * step, image.ptr(row), step);
    return writer.take();
}

std::string message_of(const CompressedImage& image) {
    Writer writer;
    writer.reserve(message_head + image.data.size());
    return writer.header(image.header).text(image.format).data(image.data).take();
}

std::string message_of(const CameraInfo& info) {
    Writer writer;
    writer.header(info.header);
    writer.add(static_cast<std::uint32_t>(info.size.height)).add(static_cast<std::uint32_t>(info.size.width));
    writer.text(info.model).count(info.lens.size()).numbers(info.lens);
    writer.numbers(info.k).numbers(info.r).numbers(info.p);
    writer.add(info.binning_x).add(info.binning_y);
    for (const int side : {info.region.x, info.region.y, info.region.height, info.region.width})
        writer.add(static_cast<std::uint32_t>(side));
    return writer.add(std::uint8_t(0)).take();
}

std::string message_of(const std::vector<Transform>& transforms) {
    Writer writer;
    writer.count(transforms.size());
    for (const Transform& transform : transforms) {
        const Eigen::Quaterniond q(transform.parent_from_child.linear());
        const Eigen::Vector3d t = transform.parent_from_child.translation();
        writer.header({transform.stamp_ns, transform.parent}).text(transform.child);
        writer.numbers(std::array{t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
    }
    return writer.take();
}

std::string text_message(std::string_view text) { return Writer().text(text).take(); }

CameraInfo info_of(const Camera& camera, Header header) {
    const Pinhole& k = camera.pinhole;
    const Distortion& d = camera.distortion;
    CameraInfo info;
    info.header = std::move(header);
    info.size = k.size;
    info.model = d.model == LensModel::kannala_brandt ? "equidistant"
                 : d.rational()                       ? "rational_polynomial"
                                                      : "plumb_bob";
    info.lens = coefficients(d);
    info.k = {k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1};
    info.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    info.p = {k.fx, 0, k.cx, 0, 0, k.fy, k.cy, 0, 0, 0, 1, 0};
    return info;
}

std::uint64_t bytes_of(const PointCloud& cloud) {
    const std::size_t floats = 3 + (cloud.colours.empty() ? 0 : 1) + cloud.fields.size();
    return std::uint64_t(cloud.points.size()) * floats * sizeof(float);
}

std::string message_of(const PointCloud& cloud) {
    const std::uint64_t bytes = bytes_of(cloud);
    constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
    if (bytes > most)
        throw Error(fmt::format("{} of points in a message, which can have {}", counted(bytes, "byte"), most));
    const cv::Size grid = cloud.grid.empty() ? cv::Size(static_cast<int>(cloud.points.size()), 1) : cloud.grid;
    std::vector<std::string> names{"x", "y", "z"};
    if (!cloud.colours.empty())
        names.emplace_back("rgb");
    for (const PointField& field : cloud.fields)
        names.push_back(field.name);
    const std::size_t step = names.size() * sizeof(float);

    Writer writer;
    writer.reserve(message_head + bytes);
    writer.header(cloud.header);
    writer.count(static_cast<std::size_t>(grid.height)).count(static_cast<std::size_t>(grid.width));
    writer.count(names.size());
    constexpr std::uint8_t float32 = 7;
    for (std::size_t i = 0; i < names.size(); ++i)
        writer.text(names[i]).count(i * sizeof(float)).add(float32).count(1);
    writer.add(std::uint8_t(0)).count(step).count(step * static_cast<std::size_t>(grid.width));
    char* data = writer.room(bytes);
    bool dense = true;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
        const auto put = [&](float value) {
            std::memcpy(data, &value, sizeof value);
            data += sizeof value;
        };
        const Eigen::Vector3d point = cloud.points[i] - cloud.origin;
        dense = dense && point.allFinite();
        for (const double coordinate : point)
            put(static_cast<float>(coordinate));
        if (!cloud.colours.empty()) { // 0x00RRGGBB, as bits
            const cv::Vec3b& c = cloud.colours[i];
            put(std::bit_cast<float>(std::uint32_t(c[2]) << 16 | std::uint32_t(c[1]) << 8 | c[0]));
        }
        for (const PointField& field : cloud.fields)
            put(field.values[i]);
    }
    return writer.add(static_cast<std::uint8_t>(dense)).take();
}

} // namespace scanshade::ros
