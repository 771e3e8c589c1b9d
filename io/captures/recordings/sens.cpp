// ScanNet's .sens, as SensReader and BundleFusion write it: a header with both cameras, then the frames, one after
// the other, with their sizes.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/compression/inflate.h"
#include "io/file_bytes.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

struct PackedImages {
    std::uint64_t colour_at = 0, colour_bytes = 0, depth_at = 0, depth_bytes = 0;
};

enum class DepthPacking : std::int32_t { raw = 0, zlib = 1 };
enum class ColourPacking : std::int32_t { raw = 0, png = 1, jpeg = 2 };

class Sens final : public FrameContainer {
  public:
    explicit Sens(const fs::path& path) : file(path) {}

    [[nodiscard]] cv::Mat image(Part part, std::size_t place) const override {
        return part == Part::depth ? cv::Mat(depth(place)) : cv::Mat(colour(place));
    }
    [[nodiscard]] cv::Size size(Part part, std::size_t /*place*/) const override {
        return part == Part::depth ? depth_size : colour_size;
    }

    FileBytes file;
    cv::Size colour_size, depth_size;
    ColourPacking colour_packing{};
    DepthPacking depth_packing{};
    std::vector<PackedImages> frames;

  private:
    [[nodiscard]] cv::Mat1w depth(std::size_t place) const {
        const PackedImages& frame = frames.at(place);
        const std::size_t expected = static_cast<std::size_t>(depth_size.area()) * sizeof(ushort);
        std::string bytes = file.bytes(frame.depth_at, frame.depth_bytes);
        if (depth_packing == DepthPacking::zlib)
            bytes = during(fmt::format("{}: depth of frame {} at byte {}", file.path().string(), place, frame.depth_at),
                           [&] { return inflated(bytes, Inflate::zlib, expected); });
        if (bytes.size() != expected)
            throw Error(fmt::format("{}: depth of frame {} at byte {}: {}, expected {} of {}x{} pixels",
                                    file.path().string(), place, frame.depth_at, counted(bytes.size(), "byte"),
                                    expected, depth_size.width, depth_size.height));
        cv::Mat1w image(depth_size);
        std::memcpy(image.data, bytes.data(), expected);
        return image;
    }

    [[nodiscard]] cv::Mat3b colour(std::size_t place) const {
        const PackedImages& frame = frames.at(place);
        const std::string where =
            fmt::format("{}: colour of frame {} at byte {}", file.path().string(), place, frame.colour_at);
        const std::string bytes = file.bytes(frame.colour_at, frame.colour_bytes);
        if (colour_packing != ColourPacking::raw)
            return colour_in(bytes, where);
        if (bytes.size() != static_cast<std::size_t>(colour_size.area()) * 3)
            throw Error(fmt::format("{}: {}, expected {}x{} pixels of 3", where, counted(bytes.size(), "byte"),
                                    colour_size.width, colour_size.height));
        cv::Mat3b image(colour_size);
        for (std::size_t i = 0; i < image.total(); ++i)
            image(static_cast<int>(i)) =
                cv::Vec3b(static_cast<uchar>(bytes[i * 3 + 2]), static_cast<uchar>(bytes[i * 3 + 1]),
                          static_cast<uchar>(bytes[i * 3]));
        return image;
    }
};

/// The header's numbers, one after the other.
class Fields {
  public:
    Fields(const FileBytes& file, std::uint64_t at) : file_(file), at_(at) {}
    template <class Number>
    Number next() {
        const std::string bytes = file_.bytes(at_, sizeof(Number));
        Number value{};
        std::memcpy(&value, bytes.data(), sizeof value);
        at_ += sizeof value;
        return value;
    }
    Eigen::Matrix4d matrix() {
        const auto numbers = next<std::array<float, 16>>();
        return Eigen::Map<const Eigen::Matrix<float, 4, 4, Eigen::RowMajor>>(numbers.data()).cast<double>();
    }
    [[nodiscard]] std::uint64_t at() const { return at_; }
    void skip(std::uint64_t bytes) { at_ += bytes; }

  private:
    const FileBytes& file_;
    std::uint64_t at_;
};

Camera camera_of(const Eigen::Matrix4d& k, cv::Size size, const fs::path& file) {
    return {{k(0, 0), k(1, 1), k(0, 2), k(1, 2), size}, {}, file.string()};
}

constexpr std::uint64_t longest_name = 1000, frame_header = 16 * sizeof(float) + 4 * sizeof(std::uint64_t);

/// Appends the frames from the header's end on. Where one does not fit in the file, it and those after it are left out,
/// with a warning.
void add_frames(Capture& capture, const std::shared_ptr<Sens>& sens, Fields header, std::uint64_t count,
                bool coloured) {
    const fs::path& path = sens->file.path();
    const std::uint64_t end = sens->file.size();
    // A writer that died leaves 0: then what follows are frames to the end of the file.
    for (std::uint64_t i = 0; count > 0 ? i < count : header.at() < end; ++i) {
        const std::uint64_t begin = header.at();
        const auto damage = [&](const std::string& what) {
            capture.warnings.push_back(fmt::format("{}: frame {} at byte {}: {}; it and those after it are left out.",
                                                   path.string(), i, begin, what));
        };
        if (end - begin < frame_header) {
            damage(fmt::format("{} are left, expected {}", counted(end - begin, "byte"), frame_header));
            break;
        }
        const Eigen::Matrix4d pose = header.matrix();
        const auto numbers = header.next<std::array<std::uint64_t, 4>>();
        PackedImages images{header.at(), numbers[2], header.at() + numbers[2], numbers[3]};
        const std::uint64_t rest = end - header.at();
        if (images.colour_bytes > rest || images.depth_bytes > rest - images.colour_bytes) {
            damage(fmt::format("images of {} and {} bytes, but {} are left", images.colour_bytes, images.depth_bytes,
                               rest));
            break;
        }
        header.skip(images.colour_bytes + images.depth_bytes);
        CaptureEntry entry;
        entry.name = fmt::format("{:06}", i);
        entry.depth = path.string();
        entry.container = sens;
        entry.place = sens->frames.size();
        if (coloured && images.colour_bytes > 0)
            entry.colour = path.string();
        entry.stamp_s = static_cast<double>(numbers[1]) * 1e-6;
        entry.colour_stamp_s = static_cast<double>(numbers[0]) * 1e-6;
        MatrixPose checked =
            checked_pose(pose, fmt::format("{}: pose of frame {} at byte {}", path.string(), i, begin));
        entry.world_from_camera = checked.world_from_camera;
        for (std::string* sentence : {&checked.warning, &checked.problem})
            if (!sentence->empty())
                entry.warnings.push_back(std::move(*sentence));
        sens->frames.push_back(images);
        capture.entries.push_back(std::move(entry));
    }
}

} // namespace

bool is_sens(std::string_view start) {
    if (start.size() < 12)
        return false;
    std::uint32_t version = 0;
    std::uint64_t name = 0;
    std::memcpy(&version, start.data(), sizeof version);
    std::memcpy(&name, start.data() + sizeof version, sizeof name);
    const std::string_view sensor = start.substr(12, std::min<std::uint64_t>(name, longest_name));
    return (version == 3 || version == 4) && name > 0 && name < longest_name &&
           std::ranges::all_of(sensor, [](char c) { return c >= ' ' && c <= '~'; });
}

Listing list_sens(const fs::path& path) {
    auto sens = std::make_shared<Sens>(path);
    Fields header(sens->file, 4);
    header.skip(header.next<std::uint64_t>());
    const Eigen::Matrix4d colour_k = header.matrix(), colour_pose = header.matrix(), depth_k = header.matrix(),
                          depth_pose = header.matrix();
    const auto colour_packing = header.next<std::int32_t>(), depth_packing = header.next<std::int32_t>();
    if (depth_packing != 0 && depth_packing != 1)
        throw Error(fmt::format("{}: depth packed by method {} at byte {}, expected 0 (none) or 1 (zlib)",
                                path.string(), depth_packing, header.at() - 4));
    sens->colour_packing = static_cast<ColourPacking>(colour_packing);
    sens->depth_packing = static_cast<DepthPacking>(depth_packing);
    const auto sides = header.next<std::array<std::uint32_t, 4>>();
    const bool coloured = colour_packing >= 0 && colour_packing <= 2 && sides[0] > 0 && sides[1] > 0;
    if (coloured)
        sens->colour_size = image_size(sides[0], sides[1], path.string() + ": colour");
    sens->depth_size = image_size(sides[2], sides[3], path.string() + ": depth");
    const auto units_per_metre = header.next<float>();
    if (!(units_per_metre > 0) || !std::isfinite(units_per_metre))
        throw Error(fmt::format("{}: depth shift {} at byte {}, expected units per metre", path.string(),
                                units_per_metre, header.at() - 4));
    const auto count = header.next<std::uint64_t>();

    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = depth_encoding(fmt::format("{}", units_per_metre), "the file's depth shift");
    capture.registration = Registration::no;
    capture.registration_reason = "a camera of its own took the colour";
    const std::uint64_t end = sens->file.size(), left = end - std::min(header.at(), end);
    if (count > left / frame_header)
        throw Error(fmt::format("{}: {} frames according to byte {}, but {} are left", path.string(), count,
                                header.at() - 8, counted(left, "byte")));
    add_frames(capture, sens, std::move(header), count, coloured);
    if (capture.entries.empty())
        throw NoFrames(path.string() + ": no whole frame in this .sens");
    listing.find_camera = [=](cv::Size, std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        CameraFile file;
        file.camera = camera_of(depth_k, sens->depth_size, path);
        file.registration = Registration::no;
        if (coloured) {
            const MatrixPose apart = checked_pose(colour_pose.inverse() * depth_pose, path.string() + ": extrinsics");
            if (!apart.warning.empty())
                warnings.push_back(apart.warning);
            file.colour = ColourCamera{camera_of(colour_k, sens->colour_size, path),
                                       apart.world_from_camera.value_or(Eigen::Isometry3d::Identity())};
        }
        return file;
    };
    return listing;
}

} // namespace scanshade
