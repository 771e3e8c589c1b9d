// Azure Kinect's recordings, as k4arecorder and the SDK's record library write them: Matroska with tracks COLOR, DEPTH,
// IR and IMU, tags K4A_..., and the device's calibration attached. After the SDK's source (src/record,
// src/transformation), version 1.4.
#include "io/captures/listing/layouts.h"
#include "io/captures/listing/trajectory.h"
#include "io/captures/recordings/matroska/matroska.h"
#include "io/content_hash.h"
#include "io/images/format.h"
#include "io/images/image_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

namespace scanshade {

namespace fs = std::filesystem;
using matroska::Block, matroska::Contents, matroska::Track;

namespace {

using Json = nlohmann::json;

// ---------------------------------------------------------------------------------------------------- images

/// How pixels are stored: the four letters that Windows gives a bitmap.
struct PixelKind {
    const char* letters;
    int type;              ///< OpenCV's, of the image as stored
    int bytes_of_two;      ///< that two pixels take; 0 = packed
    int conversion;        ///< to BGR; -1 = none
    double rows_per_pixel; ///< of the stored image
};
constexpr std::array pixel_kinds = {
    PixelKind{"MJPG", CV_8UC3, 0, -1, 1},
    PixelKind{"NV12", CV_8UC1, 3, cv::COLOR_YUV2BGR_NV12, 1.5},
    PixelKind{"YUY2", CV_8UC2, 4, cv::COLOR_YUV2BGR_YUY2, 1},
    PixelKind{"BGRA", CV_8UC4, 8, cv::COLOR_BGRA2BGR, 1},
};

/// The four letters in the header of a bitmap, which is such a track's codec; empty for other codecs.
std::string letters_of(const Track& track) {
    constexpr std::size_t header_bytes = 40, letters_at = 16;
    if (track.codec != "V_MS/VFW/FOURCC" || track.codec_private.size() < header_bytes)
        return "";
    return track.codec_private.substr(letters_at, 4);
}

enum class DepthBytes { high_first, low_first };

class AzureKinect final : public FrameContainer {
  public:
    explicit AzureKinect(const fs::path& path) : file(path) {}

    struct Pair {
        Block depth;
        std::optional<Block> colour;
    };

    [[nodiscard]] cv::Mat image(Part part, std::size_t place) const override {
        const Pair& pair = frames.at(place);
        return part == Part::depth ? cv::Mat(depth(pair.depth)) : cv::Mat(colour(pair.colour.value()));
    }
    [[nodiscard]] cv::Size size(Part part, std::size_t /*place*/) const override {
        return part == Part::depth ? depth_size : colour_size;
    }
    [[nodiscard]] std::string content_hash(std::size_t place, bool with_colour,
                                           bool /*with_confidence*/) const override {
        const Pair& pair = frames.at(place);
        const auto hash = [&](const Block& block) { return hash_of(file.bytes(block.at, block.bytes)); };
        return hash(pair.depth) + (with_colour && pair.colour ? "|" + hash(*pair.colour) : "");
    }

    FileBytes file;
    cv::Size depth_size, colour_size;
    DepthBytes depth_bytes = DepthBytes::high_first;
    const PixelKind* colour_kind = nullptr; ///< null = no colour that can be decoded
    std::vector<Pair> frames;

  private:
    /// A block's bytes, which must be as many as `expected`, if that is given.
    [[nodiscard]] std::string bytes(const Block& block, const char* what, std::size_t expected) const {
        if (block.laced)
            throw Error(fmt::format("{} byte {}: several frames of {} in one block (lacing), expected one",
                                    file.path().string(), block.at, what));
        if (expected > 0 && block.bytes != expected)
            throw Error(fmt::format("{} byte {}: {} of {}, expected {}", file.path().string(), block.at,
                                    counted(block.bytes, "byte"), what, expected));
        return file.bytes(block.at, block.bytes);
    }

    [[nodiscard]] cv::Mat1w depth(const Block& block) const {
        const std::string stored =
            bytes(block, "depth", static_cast<std::size_t>(depth_size.area()) * sizeof(std::uint16_t));
        cv::Mat1w image(depth_size);
        const bool high_first = depth_bytes == DepthBytes::high_first;
        for (std::size_t i = 0; i < image.total(); ++i) {
            const auto first = static_cast<unsigned char>(stored[2 * i]),
                       second = static_cast<unsigned char>(stored[2 * i + 1]);
            image(static_cast<int>(i)) = static_cast<ushort>(high_first ? first << 8 | second : second << 8 | first);
        }
        return image;
    }

    [[nodiscard]] cv::Mat3b colour(const Block& block) const {
        if (colour_kind->bytes_of_two == 0)
            return colour_in(bytes(block, "colour", 0), fmt::format("{} byte {}", file.path().string(), block.at));
        std::string stored =
            bytes(block, "colour", static_cast<std::size_t>(colour_size.area()) * colour_kind->bytes_of_two / 2);
        const cv::Mat pixels(static_cast<int>(colour_size.height * colour_kind->rows_per_pixel), colour_size.width,
                             colour_kind->type, stored.data());
        cv::Mat3b image;
        cv::cvtColor(pixels, image, colour_kind->conversion);
        return image;
    }
};

// ---------------------------------------------------------------------------------------------------- description

const matroska::Tag* tag_of(const Contents& contents, const char* name) {
    const auto found = std::ranges::find(contents.tags, name, &matroska::Tag::name);
    return found == contents.tags.end() ? nullptr : &*found;
}

/// Nanoseconds in a tag; 0 where there is none, or no number.
std::int64_t nanoseconds_in(const Contents& contents, const char* name, const fs::path& file,
                            std::vector<std::string>& warnings) {
    const matroska::Tag* tag = tag_of(contents, name);
    if (!tag)
        return 0;
    constexpr double longest = 1e18; // 30 years
    const auto value = number(trimmed(tag->value));
    if (value && std::abs(*value) < longest)
        return static_cast<std::int64_t>(std::llround(*value));
    warnings.push_back(
        fmt::format("{}: {} is {}, expected nanoseconds; taken as 0.", file.string(), name, in_quotes(tag->value)));
    return 0;
}

/// By the number in a tag, else by name. A track of the IMU has no images.
const Track* track_of(const Contents& contents, const char* name, const char* tag_name) {
    const matroska::Tag* tag = tag_of(contents, tag_name);
    const auto wanted = !tag ? std::nullopt : tag->track_uid > 0 ? tag->track_uid : whole_number(trimmed(tag->value));
    const auto by_number = std::ranges::find_if(
        contents.tracks, [&](const Track& track) { return wanted && track.video && track.uid == *wanted; });
    const auto by_name =
        std::ranges::find_if(contents.tracks, [&](const Track& track) { return track.video && track.name == name; });
    const auto found = by_number != contents.tracks.end() ? by_number : by_name;
    return found == contents.tracks.end() ? nullptr : &*found;
}

std::string tracks_listed(const Contents& contents) {
    std::vector<std::string> all;
    for (const Track& track : contents.tracks)
        all.push_back(fmt::format("{} ({})", in_quotes(track.name.empty() ? "unnamed" : track.name), track.codec));
    return all.empty() ? "no tracks" : fmt::format("{}", fmt::join(all, ", "));
}

/// What is left of the sensor: an image of `width` and `height`, cut out of `across` times `down` binned pixels.
struct Mode {
    const char* name;
    int across, down, left, top, width, height;

    [[nodiscard]] cv::Size size() const { return {width, height}; }
};
constexpr std::array depth_modes = {
    Mode{"NFOV_2X2BINNED", 512, 512, 96, 90, 320, 288},
    Mode{"NFOV_UNBINNED", 1024, 1024, 192, 180, 640, 576},
    Mode{"WFOV_2X2BINNED", 512, 512, 0, 0, 512, 512},
    Mode{"WFOV_UNBINNED", 1024, 1024, 0, 0, 1024, 1024},
};
constexpr std::array colour_modes = {
    Mode{"720P", 1280, 960, 0, 120, 1280, 720},    Mode{"1080P", 1920, 1440, 0, 180, 1920, 1080},
    Mode{"1440P", 2560, 1920, 0, 240, 2560, 1440}, Mode{"1536P", 2048, 1536, 0, 0, 2048, 1536},
    Mode{"2160P", 3840, 2880, 0, 360, 3840, 2160}, Mode{"3072P", 4096, 3072, 0, 0, 4096, 3072},
};

/// An image's size tells its mode.
template <std::size_t count>
const Mode* mode_of(const std::array<Mode, count>& modes, cv::Size size) {
    const auto* const found = std::ranges::find_if(modes, [&](const Mode& mode) { return mode.size() == size; });
    return found == modes.end() ? nullptr : &*found;
}

bool same_word(std::string_view a, std::string_view b) {
    return std::ranges::equal(a, b,
                              [](unsigned char x, unsigned char y) { return std::toupper(x) == std::toupper(y); });
}

/// Refuses what has no depth, in a sentence that says why.
const Track& depth_track(const Contents& contents, const fs::path& file) {
    const matroska::Tag* mode = tag_of(contents, "K4A_DEPTH_MODE");
    const Track* track = track_of(contents, "DEPTH", "K4A_DEPTH_TRACK");
    const bool azure = std::ranges::any_of(contents.tags, [](const auto& tag) { return tag.name.starts_with("K4A_"); });
    if (!azure && !track)
        throw NoFrames(fmt::format("{}: a video ({}), expected a recording of an Azure Kinect, whose depth is a track "
                                   "named DEPTH",
                                   file.string(), tracks_listed(contents)));
    if (mode && same_word(mode->value, "PASSIVE_IR"))
        throw Error(fmt::format("{}: recorded in the mode {}: infrared without depth", file.string(), mode->value));
    if (!track)
        throw Error(fmt::format("{}: a recording of an Azure Kinect without depth: {}", file.string(),
                                tracks_listed(contents)));
    return *track;
}

DepthBytes depth_bytes_of(const Track& track, const fs::path& file) {
    const std::string letters = letters_of(track);
    if (track.packed)
        throw Error(fmt::format("{}: the track {} is compressed by the container (ContentEncodings), expected plain "
                                "blocks; `mkvmerge --compression -1:none` undoes it",
                                file.string(), in_quotes(track.name)));
    if (letters == "b16g")
        return DepthBytes::high_first;
    if (letters == "YUY2") // early recorders called it so
        return DepthBytes::low_first;
    throw Error(fmt::format("{}: depth in the codec {} {}, expected V_MS/VFW/FOURCC with b16g", file.string(),
                            in_quotes(track.codec), in_quotes(letters)));
}

/// Null where colour cannot be decoded, with a warning.
const PixelKind* colour_kind_of(const Track& track, cv::Size size, const fs::path& file,
                                std::vector<std::string>& warnings) {
    const std::string letters = letters_of(track);
    const auto* const kind = std::ranges::find_if(pixel_kinds, [&](const auto& row) { return letters == row.letters; });
    const bool halves = kind != pixel_kinds.end() &&
                        (kind->conversion == cv::COLOR_YUV2BGR_NV12 || kind->conversion == cv::COLOR_YUV2BGR_YUY2);
    if (kind != pixel_kinds.end() && !track.packed && !(halves && (size.width % 2 != 0 || size.height % 2 != 0)))
        return &*kind;
    warnings.push_back(
        fmt::format("{}: colour of {}x{} pixels in the codec {} {}{}, expected MJPG, NV12, YUY2 or BGRA; "
                    "it is not used.",
                    file.string(), size.width, size.height, in_quotes(track.codec), in_quotes(letters),
                    track.packed ? ", compressed by the container" : ""));
    return nullptr;
}

// ---------------------------------------------------------------------------------------------------- calibration

constexpr std::uint64_t longest_calibration = 1 << 20; // 10 KB in recordings

/// The device's calibration: attached, by the tag that names it, or by its usual name.
Json calibration_in(const AzureKinect& recording, const Contents& contents) {
    const matroska::Tag* tag = tag_of(contents, "K4A_CALIBRATION_FILE");
    const auto by_number = std::ranges::find_if(contents.attachments, [&](const auto& file) {
        return tag && tag->attachment_uid > 0 && file.uid == tag->attachment_uid;
    });
    const auto by_name = std::ranges::find_if(contents.attachments, [&](const auto& file) {
        return (tag && file.name == tag->value) || file.name == "calibration.json";
    });
    const auto found = by_number != contents.attachments.end() ? by_number : by_name;
    if (found == contents.attachments.end())
        throw Error("no calibration.json is attached");
    if (found->bytes > longest_calibration)
        throw Error(fmt::format("{}: {} attached, expected at most {}", in_quotes(found->name),
                                counted(found->bytes, "byte"), longest_calibration));
    std::string text = recording.file.bytes(found->at, found->bytes);
    text.resize(text.find_last_not_of('\0') + 1); // the device's memory ends with one
    return parsed_json(text, found->name);
}

std::vector<double> numbers_at(const Json& object, const char* key, std::size_t count) {
    const auto list = object.find(key);
    if (list == object.end() || !list->is_array() || list->size() != count)
        throw Error(fmt::format("\"{}\" is not a list of {} numbers", key, count));
    std::vector<double> numbers;
    for (const Json& value : *list) {
        numbers.push_back(value.is_number() ? value.get<double>() : std::nan(""));
        if (!std::isfinite(numbers.back()))
            throw Error(fmt::format("\"{}\" is not a list of {} numbers", key, count));
    }
    return numbers;
}

const Json& member(const Json& object, const char* key) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    if (!object.is_object() || found == object.end())
        throw Error(fmt::format("\"{}\" is missing", key));
    return *found;
}

/// The entry of the camera whose "Purpose" ends so.
const Json& camera_entry(const Json& calibration, std::string_view purpose) {
    const Json& cameras = member(member(calibration, "CalibrationInformation"), "Cameras");
    for (const Json& camera : cameras)
        if (const auto said = camera.is_object() ? camera.find("Purpose") : camera.end();
            camera.is_object() && said != camera.end() && said->is_string() &&
            said->get_ref<const std::string&>().ends_with(purpose))
            return camera;
    throw Error(fmt::format("no camera with the \"Purpose\" ...{}", purpose));
}

Eigen::Matrix4d placed(const Json& entry) {
    const Json& rt = member(entry, "Rt");
    const auto rotation = numbers_at(rt, "Rotation", 9), translation = numbers_at(rt, "Translation", 3);
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.data());
    matrix.topRightCorner<3, 1>() = Eigen::Map<const Eigen::Vector3d>(translation.data());
    return matrix;
}

cv::Size sensor_of(const Json& entry) {
    const auto side = [&](const char* key) {
        const Json& value = member(entry, key);
        return value.is_number() ? value.get<double>() : 0.0;
    };
    return image_size(side("SensorWidth"), side("SensorHeight"), "the sensor");
}

/// A camera in a mode. The file's numbers are for an image of width and height 1, whose corner is 0.
Camera in_mode(const Json& entry, const Mode& mode, const std::string& origin) {
    const Json& intrinsics = member(entry, "Intrinsics");
    const Json& said = member(intrinsics, "ModelType");
    std::string model = said.is_string() ? said.get<std::string>() : said.dump();
    if (const std::string_view start = "CALIBRATION_LensDistortionModel"; model.starts_with(start))
        model.erase(0, start.size());
    // "Rational6KT", of devices before the first sold, halves part of the tangential distortion.
    if (model != "BrownConrady")
        throw Error(fmt::format("a lens of the model {}, expected BrownConrady", in_quotes(model)));
    const auto p = numbers_at(intrinsics, "ModelParameters", 14); // cx cy fx fy k1 .. k6 codx cody p2 p1
    if (p[10] != 0 || p[11] != 0)
        throw Error(fmt::format("a lens whose centre of distortion is at {}, {}, expected 0", p[10], p[11]));
    const double across = mode.across, down = mode.down;
    Camera camera{
        {p[2] * across, p[3] * down, p[0] * across - mode.left - 0.5, p[1] * down - mode.top - 0.5, mode.size()},
        {p[4], p[5], p[13], p[12], p[6], p[7], p[8], p[9]},
        origin};
    check(camera);
    return camera;
}

Camera depth_camera(const Json& calibration, const Mode& mode, const std::string& origin) {
    const Json& entry = camera_entry(calibration, "Depth");
    if (const cv::Size sensor = sensor_of(entry); sensor != cv::Size(1024, 1024))
        throw Error(fmt::format("a sensor of {}x{} pixels, expected 1024x1024", sensor.width, sensor.height));
    return in_mode(entry, mode, origin);
}

/// Early calibrations are for the sensor's middle 16:9: to the whole sensor, whose unit the modes are in.
Json whole_sensor(Json entry) {
    const cv::Size sensor = sensor_of(entry);
    if (std::int64_t{sensor.width} * 3 / 4 == sensor.height)
        return entry;
    if (std::int64_t{sensor.width} * 9 / 16 != sensor.height)
        throw Error(fmt::format("a colour sensor of {}x{} pixels, expected 4:3 or 16:9", sensor.width, sensor.height));
    auto p = numbers_at(member(entry, "Intrinsics"), "ModelParameters", 14);
    constexpr double part_rows = 2304, rows_above = 384, all_rows = 3072;
    p[1] = (p[1] * part_rows + rows_above) / all_rows;
    p[3] = p[3] * part_rows / all_rows;
    entry["Intrinsics"]["ModelParameters"] = p;
    return entry;
}

ColourCamera colour_camera(const Json& calibration, const Mode& mode, const std::string& origin) {
    const Json entry = whole_sensor(camera_entry(calibration, "PhotoVideo"));
    // Each camera's Rt leads from one common frame to the camera (the SDK's extrinsic_transformation.c); depth's is
    // the identity.
    const Eigen::Matrix4d matrix = placed(entry) * placed(camera_entry(calibration, "Depth")).inverse();
    const MatrixPose apart = checked_pose(matrix, "\"Rt\"");
    if (!apart.world_from_camera)
        throw Error(apart.problem.empty() ? apart.warning : apart.problem);
    return {in_mode(entry, mode, origin), *apart.world_from_camera};
}

std::optional<CameraFile> cameras_of(const AzureKinect& recording, const Contents& contents,
                                     std::vector<std::string>& warnings) {
    const std::string file = recording.file.path().string(), origin = file + ": calibration.json";
    const Mode* depth_mode = mode_of(depth_modes, recording.depth_size);
    const Mode* colour_mode = mode_of(colour_modes, recording.colour_size);
    const auto warn = [&](const std::string& what) { warnings.push_back(fmt::format("{}: {}.", file, what)); };
    CameraFile found;
    found.registration = Registration::no;
    Json calibration;
    try {
        if (!depth_mode)
            throw Error(fmt::format("depth of {}x{} pixels, which no mode has", recording.depth_size.width,
                                    recording.depth_size.height));
        calibration = calibration_in(recording, contents);
        found.camera = depth_camera(calibration, *depth_mode, origin);
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        warn(fmt::format("no camera for depth: {}", failure.what()));
        return std::nullopt;
    }
    if (!recording.colour_kind)
        return found;
    try {
        if (!colour_mode)
            throw Error(fmt::format("images of {}x{} pixels, which no mode has", recording.colour_size.width,
                                    recording.colour_size.height));
        found.colour = colour_camera(calibration, *colour_mode, origin);
    } catch (const Error& failure) {
        warn(fmt::format("no camera for colour: {}", failure.what()));
    }
    return found;
}

// ---------------------------------------------------------------------------------------------------- frames

std::vector<Block> blocks_of(const Contents& contents, const Track& track) {
    std::vector<Block> blocks;
    std::ranges::copy_if(contents.blocks, std::back_inserter(blocks),
                         [&](const Block& block) { return block.track == track.number; });
    std::ranges::stable_sort(blocks, {}, &Block::time_ns);
    return blocks;
}

/// Of a frame: as the tracks say, else the least distance between depths, else 1/30 s.
std::int64_t period_of(const Track& depth, const Track& colour, const std::vector<Block>& depths) {
    std::int64_t period = std::max(depth.duration_ns, colour.duration_ns);
    if (period > 0)
        return period;
    constexpr std::int64_t usual = 33'333'333;
    period = std::numeric_limits<std::int64_t>::max();
    for (std::size_t i = 1; i < depths.size(); ++i)
        if (depths[i].time_ns > depths[i - 1].time_ns)
            period = std::min(period, depths[i].time_ns - depths[i - 1].time_ns);
    return period < std::numeric_limits<std::int64_t>::max() ? period : usual;
}

/// Colour of the same instant: depth is taken `delay_ns` after it. Each image is used once.
void pair_colour(AzureKinect& recording, const std::vector<Block>& colours, std::int64_t delay_ns,
                 std::int64_t limit_ns) {
    std::size_t next = 0;
    for (AzureKinect::Pair& pair : recording.frames) {
        const auto away = [&](const Block& colour) {
            return std::abs(static_cast<double>(colour.time_ns) + static_cast<double>(delay_ns) -
                            static_cast<double>(pair.depth.time_ns));
        };
        while (next + 1 < colours.size() && away(colours[next + 1]) <= away(colours[next]))
            ++next;
        if (next < colours.size() && away(colours[next]) < static_cast<double>(limit_ns))
            pair.colour = colours[next++];
    }
}

} // namespace

Listing list_azure_kinect(const fs::path& path) {
    const auto recording = std::make_shared<AzureKinect>(path);
    const auto contents = std::make_shared<const Contents>(matroska::read(recording->file));
    Listing listing;
    Capture& capture = listing.capture;
    capture.warnings = contents->warnings;
    const Track& depth = depth_track(*contents, path);
    recording->depth_bytes = depth_bytes_of(depth, path);
    recording->depth_size = image_size(depth.width, depth.height, path.string() + ": depth");
    if (const auto* mode = tag_of(*contents, "K4A_DEPTH_MODE"); mode) {
        const Mode* by_size = mode_of(depth_modes, recording->depth_size);
        if (!by_size || !same_word(by_size->name, mode->value))
            capture.warnings.push_back(fmt::format("{}: depth of {}x{} pixels in the mode {}; the size decides.",
                                                   path.string(), recording->depth_size.width,
                                                   recording->depth_size.height, in_quotes(mode->value)));
    }
    const std::vector<Block> depths = blocks_of(*contents, depth);
    for (const Block& block : depths)
        recording->frames.push_back({block, std::nullopt});

    const Track* colour = track_of(*contents, "COLOR", "K4A_COLOR_TRACK");
    if (colour == &depth)
        colour = nullptr;
    if (colour) {
        recording->colour_size = image_size(colour->width, colour->height, path.string() + ": colour");
        recording->colour_kind = colour_kind_of(*colour, recording->colour_size, path, capture.warnings);
    }
    if (recording->colour_kind) {
        const std::int64_t delay_ns = nanoseconds_in(*contents, "K4A_DEPTH_DELAY_NS", path, capture.warnings);
        pair_colour(*recording, blocks_of(*contents, *colour), delay_ns, period_of(depth, *colour, depths) / 2);
    }
    const double start_s =
        static_cast<double>(nanoseconds_in(*contents, "K4A_START_OFFSET_NS", path, capture.warnings)) * 1e-9;

    for (std::size_t i = 0; i < recording->frames.size(); ++i) {
        const AzureKinect::Pair& pair = recording->frames[i];
        CaptureEntry entry;
        entry.name = fmt::format("{:06}", i);
        entry.depth = path.string();
        entry.container = recording;
        entry.place = i;
        entry.stamp_s = static_cast<double>(pair.depth.time_ns) * 1e-9 + start_s; // the device's clock, as in the SDK
        if (pair.colour) {
            entry.colour = path.string();
            entry.colour_stamp_s = static_cast<double>(pair.colour->time_ns) * 1e-9 + start_s;
        } else if (recording->colour_kind) {
            entry.warnings.push_back("no colour image of the same time.");
        }
        capture.entries.push_back(std::move(entry));
    }
    if (capture.entries.empty())
        throw NoFrames(fmt::format("{}: no whole depth image in this recording{}{}", path.string(),
                                   capture.warnings.empty() ? "" : "; ", fmt::join(capture.warnings, " ")));
    capture.depth = usual_encoding("mm", "Azure Kinect: millimetres");
    capture.registration = Registration::no;
    capture.registration_reason = "a camera of its own took the colour";
    listing.find_camera = [=](cv::Size, std::vector<std::string>& warnings) {
        return cameras_of(*recording, *contents, warnings);
    };
    return listing;
}

} // namespace scanshade
