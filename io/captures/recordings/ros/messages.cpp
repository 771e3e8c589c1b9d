#include "io/captures/recordings/ros/messages.h"

#include "io/images/image_check.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace scanshade::ros {

namespace {

/// A message's fields, one after the other: packed (ROS 1), or aligned to their own size (CDR, OMG's DDS-XTypes 7.4).
class Reader {
  public:
    Reader(std::string_view bytes, Encoding encoding) : bytes_(bytes), cdr_(encoding == Encoding::cdr) {
        if (!cdr_)
            return;
        take(start_);
        const auto kind = static_cast<unsigned char>(bytes_[1]);
        if (bytes_[0] != 0 || kind > 1)
            throw Error(fmt::format("a message of representation {:02x} {:02x}, expected plain CDR (00 00 or 00 01)",
                                    static_cast<unsigned char>(bytes_[0]), kind));
        swapped_ = kind == 0;
    }

    template <class Number>
    Number next() {
        if (cdr_)
            take((sizeof(Number) - (at_ - start_) % sizeof(Number)) % sizeof(Number));
        std::array<char, sizeof(Number)> raw;
        std::memcpy(raw.data(), take(sizeof(Number)).data(), sizeof(Number));
        if (swapped_)
            std::ranges::reverse(raw);
        Number value{};
        std::memcpy(&value, raw.data(), sizeof(Number));
        return value;
    }

    std::string_view take(std::size_t count) {
        if (count > bytes_.size() - at_)
            throw Error(
                fmt::format("{} expected at byte {} of a message of {}", counted(count, "byte"), at_, bytes_.size()));
        at_ += count;
        return bytes_.substr(at_ - count, count);
    }

    /// How many items follow, of at least `smallest` bytes each.
    std::size_t count(std::size_t smallest) {
        const auto count = next<std::uint32_t>();
        if (count > left() / smallest)
            throw Error(fmt::format("{} items at byte {} of a message of {}", count, at_ - 4, bytes_.size()));
        return count;
    }

    std::string text() {
        std::string_view text = take(next<std::uint32_t>());
        if (cdr_ && text.ends_with('\0'))
            text.remove_suffix(1);
        return as_utf8(text);
    }

    std::string frame() {
        std::string name = text();
        return name.starts_with('/') ? name.substr(1) : name;
    }

    Header header() {
        if (!cdr_)
            next<std::uint32_t>(); // the sequence number, which ROS 2 dropped
        const auto seconds = next<std::uint32_t>(), nanoseconds = next<std::uint32_t>();
        Header header;
        header.stamp_ns = static_cast<std::int64_t>(seconds) * 1'000'000'000 + nanoseconds;
        header.frame = frame();
        return header;
    }

    template <std::size_t N>
    std::array<double, N> numbers() {
        std::array<double, N> values;
        for (double& value : values)
            value = next<double>();
        return values;
    }

    Eigen::Isometry3d transform() {
        const auto v = numbers<7>();
        const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
        const Eigen::Vector3d t(v[0], v[1], v[2]);
        if (!t.allFinite() || !q.coeffs().allFinite() || !(q.norm() > 1e-6))
            throw Error("a transform that is not finite, or whose quaternion is zero");
        Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
        pose.linear() = q.normalized().toRotationMatrix();
        pose.translation() = t;
        return pose;
    }

    [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }

  private:
    static constexpr std::size_t start_ = 4; ///< CDR's own bytes, after which alignment is counted
    std::string_view bytes_;
    std::size_t at_ = 0;
    bool cdr_, swapped_ = false;
};

cv::Size size_in(std::uint32_t width, std::uint32_t height) {
    return image_check::checked_size(width, height, "a message");
}

/// Rows of `pixel` bytes each, copied without their padding.
cv::Mat rows_of(const ImageMessage& image, int type) {
    const std::size_t row = static_cast<std::size_t>(image.size.width) * CV_ELEM_SIZE(type);
    if (image.step < row ||
        image.data.size() / std::max<std::size_t>(image.step, 1) < static_cast<std::size_t>(image.size.height))
        throw Error(fmt::format("{} in rows of {}, expected {}x{} pixels of {}", counted(image.data.size(), "byte"),
                                image.step, image.size.width, image.size.height, image.encoding));
    cv::Mat pixels(image.size, type);
    for (int y = 0; y < pixels.rows; ++y)
        std::memcpy(pixels.ptr(y), image.data.data() + static_cast<std::size_t>(y) * image.step, row);
    if (image.big_endian && CV_ELEM_SIZE1(type) > 1)
        for (int y = 0; y < pixels.rows; ++y) {
            uchar* bytes = pixels.ptr(y);
            for (std::size_t at = 0; at < row; at += CV_ELEM_SIZE1(type))
                std::reverse(bytes + at, bytes + at + CV_ELEM_SIZE1(type));
        }
    return pixels;
}

} // namespace

ImageMessage image_in(std::string_view bytes, Encoding encoding) {
    Reader reader(bytes, encoding);
    ImageMessage image;
    image.header = reader.header();
    const auto height = reader.next<std::uint32_t>(), width = reader.next<std::uint32_t>();
    image.size = size_in(width, height);
    image.encoding = reader.text();
    image.big_endian = reader.next<std::uint8_t>() != 0;
    image.step = reader.next<std::uint32_t>();
    image.data = reader.take(reader.count(1));
    if (encoding == Encoding::ros1 && reader.left() == sizeof(float))
        image.unit_m = reader.next<float>();
    return image;
}

CompressedImage compressed_image_in(std::string_view bytes, Encoding encoding) {
    Reader reader(bytes, encoding);
    CompressedImage image;
    image.header = reader.header();
    image.format = reader.text();
    image.data = reader.take(reader.count(1));
    return image;
}

CameraInfo camera_info_in(std::string_view bytes, Encoding encoding) {
    Reader reader(bytes, encoding);
    CameraInfo info;
    info.header = reader.header();
    const auto height = reader.next<std::uint32_t>(), width = reader.next<std::uint32_t>();
    if (width > 0 && height > 0)
        info.size = size_in(width, height);
    info.model = reader.text();
    info.lens.resize(reader.count(sizeof(double)));
    for (double& k : info.lens)
        k = reader.next<double>();
    info.k = reader.numbers<9>();
    info.r = reader.numbers<9>();
    info.p = reader.numbers<12>();
    info.binning_x = reader.next<std::uint32_t>();
    info.binning_y = reader.next<std::uint32_t>();
    std::array<std::uint32_t, 4> region; // x, y, height, width
    for (std::uint32_t& side : region)
        side = std::min(reader.next<std::uint32_t>(), std::uint32_t(1) << 20);
    info.region = cv::Rect(static_cast<int>(region[0]), static_cast<int>(region[1]), static_cast<int>(region[3]),
                           static_cast<int>(region[2]));
    return info;
}

std::vector<Transform> transforms_in(std::string_view bytes, Encoding encoding) {
    Reader reader(bytes, encoding);
    constexpr std::size_t smallest = 7 * sizeof(double);
    std::vector<Transform> transforms(reader.count(smallest));
    for (Transform& transform : transforms) {
        const Header header = reader.header();
        transform.stamp_ns = header.stamp_ns;
        transform.parent = header.frame;
        transform.child = reader.frame();
        transform.parent_from_child = reader.transform();
    }
    return transforms;
}

float float_in(std::string_view bytes, Encoding encoding) { return Reader(bytes, encoding).next<float>(); }

Eigen::Isometry3d transform_in(std::string_view bytes, Encoding encoding) {
    return Reader(bytes, encoding).transform();
}

std::map<std::string, std::string> settings_in(std::string_view bytes, Encoding encoding) {
    const std::string text = Reader(bytes, encoding).text();
    std::map<std::string, std::string> settings;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t end = std::min(text.find(';', at), text.size());
        const std::string row = text.substr(at, end - at);
        const std::size_t equals = row.find('=');
        if (equals == std::string::npos)
            settings[""] = row;
        else
            settings[row.substr(0, equals)] = row.substr(equals + 1);
        at = end + 1;
    }
    return settings;
}

cv::Mat depth_in(const ImageMessage& image) {
    if (image.encoding == "16UC1" || image.encoding == "mono16")
        return rows_of(image, CV_16UC1);
    if (image.encoding == "32FC1")
        return rows_of(image, CV_32FC1);
    throw Error(fmt::format("an image of the encoding {}, expected 16UC1, mono16 or 32FC1", in_quotes(image.encoding)));
}

cv::Mat3b colour_in(const ImageMessage& image) {
    struct Row {
        const char* encoding;
        int type;
        int conversion; ///< of cv::cvtColor; -1: none
    };
    // OpenCV names a Bayer pattern by its second row's second and third pixel, ROS by the first row's first two.
    static constexpr std::array rows{Row{"bgr8", CV_8UC3, -1},
                                     Row{"8UC3", CV_8UC3, -1},
                                     Row{"rgb8", CV_8UC3, cv::COLOR_RGB2BGR},
                                     Row{"bgra8", CV_8UC4, cv::COLOR_BGRA2BGR},
                                     Row{"rgba8", CV_8UC4, cv::COLOR_RGBA2BGR},
                                     Row{"mono8", CV_8UC1, cv::COLOR_GRAY2BGR},
                                     Row{"8UC1", CV_8UC1, cv::COLOR_GRAY2BGR},
                                     Row{"yuv422", CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
                                     Row{"uyvy", CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
                                     Row{"yuv422_yuy2", CV_8UC2, cv::COLOR_YUV2BGR_YUY2},
                                     Row{"yuyv", CV_8UC2, cv::COLOR_YUV2BGR_YUY2},
                                     Row{"bayer_rggb8", CV_8UC1, cv::COLOR_BayerBG2BGR},
                                     Row{"bayer_bggr8", CV_8UC1, cv::COLOR_BayerRG2BGR},
                                     Row{"bayer_gbrg8", CV_8UC1, cv::COLOR_BayerGR2BGR},
                                     Row{"bayer_grbg8", CV_8UC1, cv::COLOR_BayerGB2BGR}};
    const auto* const row =
        std::ranges::find_if(rows, [&](const Row& each) { return image.encoding == each.encoding; });
    if (row == rows.end())
        throw Error(fmt::format("a colour image of the encoding {}, expected one of rgb8, bgr8, rgba8, bgra8, mono8, "
                                "yuv422, yuv422_yuy2, bayer_*8",
                                in_quotes(image.encoding)));
    const cv::Mat pixels = rows_of(image, row->type);
    if (row->conversion < 0)
        return pixels;
    if (row->type == CV_8UC2 && image.size.width % 2 != 0)
        throw Error(fmt::format("{} in rows of {} pixels, expected an even number", image.encoding, image.size.width));
    cv::Mat3b colour;
    cv::cvtColor(pixels, colour, row->conversion);
    return colour;
}

std::optional<Camera> camera_of(const CameraInfo& info, bool rectified, cv::Size size) {
    const auto finite = [](const auto& values) {
        return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
    };
    if (!finite(info.k) || !finite(info.p) || !finite(info.lens))
        throw Error("a camera with numbers that are not finite");
    const bool by_projection = rectified && info.p[0] > 0;
    Camera camera;
    Pinhole& k = camera.pinhole;
    k = by_projection ? Pinhole{info.p[0], info.p[5], info.p[2], info.p[6], info.size}
                      : Pinhole{info.k[0], info.k[4], info.k[2], info.k[5], info.size};
    if (!(k.fx > 0) || !(k.fy > 0))
        return std::nullopt;
    // K is for the full image: first the part that is read out, then pixels joined.
    if (info.region.width > 0 && info.region.height > 0) { // the area of a damaged one may be no int
        k.cx -= info.region.x;
        k.cy -= info.region.y;
        k.size = info.region.size();
    }
    if (const std::uint32_t x = std::max(info.binning_x, 1U), y = std::max(info.binning_y, 1U); x > 1 || y > 1) {
        const cv::Size binned(k.size.width / static_cast<int>(x), k.size.height / static_cast<int>(y));
        if (!binned.empty())
            k = scaled(k, binned);
    }
    if (k.size.empty())
        k.size = size;
    if (k.size != size) {
        const double across = static_cast<double>(size.width) / k.size.width,
                     down = static_cast<double>(size.height) / k.size.height;
        if (std::abs(across / down - 1) > 0.01)
            throw Error(fmt::format("a camera for {}x{} pixels, but the images have {}x{}", k.size.width, k.size.height,
                                    size.width, size.height));
        k = scaled(k, size);
    }
    const std::vector<double>& d = info.lens;
    if (by_projection || std::ranges::all_of(d, [](double v) { return v == 0; }))
        return camera;
    if (info.model == "equidistant" || info.model == "fisheye" || info.model == "Kannala Brandt4") {
        camera.distortion = kannala_brandt(d);
        return camera;
    }
    // Whatever the model's name, OpenCV's eight numbers are OpenCV's model; behind them are thin prisms and tilts.
    const bool more =
        std::any_of(d.begin() + std::min<std::ptrdiff_t>(8, std::ssize(d)), d.end(), [](double v) { return v != 0; });
    if (more || info.model == "Ftheta" || d.size() < 4)
        throw Error(fmt::format("a lens of the model {} with {}, which is not known; give --camera",
                                in_quotes(info.model), counted(d.size(), "coefficient")));
    camera.distortion = brown_conrady(d);
    return camera;
}

} // namespace scanshade::ros
