// Recordings of phones with a lidar: Stray Scanner, Polycam, ARKitScenes.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

constexpr const char* lidar_confidence = "0 low, 1 medium, 2 high";

std::vector<std::string> cells_of(std::string_view line) {
    std::vector<std::string> cells;
    for (std::size_t at = 0; at <= line.size();) {
        const std::size_t comma = std::min(line.find(',', at), line.size());
        cells.emplace_back(trimmed(line.substr(at, comma - at)));
        at = comma + 1;
    }
    return cells;
}

/// Width and height in the track header of an MPEG-4 file, its boxes walked without decoding: 0x0 where there is none.
cv::Size video_size(const FileBytes& bytes) {
    const auto read_32 = [&](std::uint64_t at) {
        std::uint32_t value = 0;
        for (const char c : bytes.bytes(at, 4))
            value = value << 8 | static_cast<unsigned char>(c);
        return value;
    };
    const std::uint64_t end = bytes.size();
    constexpr int most_boxes = 10000;
    std::uint64_t at = 0;
    for (int box = 0; box < most_boxes && end - at >= 8; ++box) {
        std::uint64_t size = read_32(at), head = 8;
        const std::uint32_t type = read_32(at + 4);
        if (size == 1 && end - at >= 16) {
            size = std::uint64_t(read_32(at + 8)) << 32 | read_32(at + 12);
            head = 16;
        }
        if (size == 0)
            size = end - at;
        if (size < head || size > end - at)
            return {};
        if (type == 0x6d6f6f76 || type == 0x7472616b) { // moov, trak: what is in them
            at += head;
            continue;
        }
        if (type == 0x746b6864 && size > 16) { // tkhd
            const cv::Size found(static_cast<int>(read_32(at + size - 8) >> 16),
                                 static_cast<int>(read_32(at + size - 4) >> 16));
            if (!found.empty())
                return found;
        }
        at += size;
    }
    return {};
}

/// 3 rows of 3 numbers with commas.
Camera stray_camera(const fs::path& file) {
    const std::string bytes = read_list_file(file);
    std::vector<double> k;
    for (const TextLine& line : text_lines(bytes)) {
        if (trimmed(line.text).empty())
            continue;
        for (const std::string& cell : cells_of(line.text)) {
            const auto value = number(cell);
            if (!value || !std::isfinite(*value))
                throw Error(fmt::format("{}: {}, expected a number", at_line(file, line.number), in_quotes(cell)));
            k.push_back(*value);
        }
    }
    if (k.size() != 9)
        throw Error(fmt::format("{}: {}, expected 9 of a 3x3 matrix", file.string(), counted(k.size(), "number")));
    return {{k[0], k[4], k[2], k[5], {}}, {}, file.string()};
}

struct OdometryRow {
    double stamp_s = 0;
    Eigen::Isometry3d pose;
};

/// timestamp, frame, x, y, z, qx, qy, qz, qw: by the frame's number. Camera to world, in our axes.
std::map<std::uint64_t, OdometryRow> odometry_in(const fs::path& file, std::vector<std::string>& warnings) {
    const std::string bytes = read_list_file(file);
    std::map<std::uint64_t, OdometryRow> rows;
    for (const TextLine& line : text_lines(bytes)) {
        if (line.number == 1 || trimmed(line.text).empty())
            continue;
        const std::vector<std::string> cells = cells_of(line.text);
        const auto frame = cells.size() == 9 ? whole_number(cells[1]) : std::nullopt;
        std::vector<double> v;
        for (std::size_t i = 0; frame && i < cells.size(); ++i)
            if (const auto value = number(cells[i]); value && std::isfinite(*value))
                v.push_back(*value);
        const Eigen::Quaterniond q = v.size() == 9 ? Eigen::Quaterniond(v[8], v[5], v[6], v[7]) : Eigen::Quaterniond();
        if (v.size() != 9 || !(q.norm() > 1e-6)) {
            warnings.push_back(fmt::format("{}: expected 9 numbers (timestamp, frame, x, y, z, qx, qy, qz, qw); pose "
                                           "not used.",
                                           at_line(file, line.number)));
            continue;
        }
        rows.insert_or_assign(*frame, OdometryRow{v[0], pose_from({v[2], v[3], v[4]}, q)});
    }
    return rows;
}

} // namespace

std::optional<Listing> list_stray_scanner(const fs::path& folder) {
    const auto depths = depth_images_in(folder_named(folder, {"depth"}));
    if (depths.empty() || !is_file(folder / "camera_matrix.csv"))
        return std::nullopt;
    Listing listing = listing_of_phone("Stray Scanner");
    Capture& capture = listing.capture;
    capture.confidence_levels = lidar_confidence;
    if (assumed_encoding(depths.front()).name == "m") // older ones have .npy, of millimetres as well
        capture.depth = usual_encoding("1000", "Stray Scanner layout");
    const ImagesByStem sure(colour_images_in(folder_named(folder, {"confidence"}))),
        colours(colour_images_in(folder_named(folder, {"rgb", "color"})));
    std::map<std::uint64_t, OdometryRow> odometry;
    if (is_file(folder / "odometry.csv"))
        odometry = odometry_in(folder / "odometry.csv", capture.warnings);
    else
        capture.warnings.push_back(fmt::format("{}: there is no odometry.csv; no poses.", folder.string()));
    for (const fs::path& depth : depths) {
        CaptureEntry entry;
        entry.name = depth.stem().string();
        entry.depth = depth;
        entry.confidence = sure.of(entry.name);
        entry.colour = colours.of(entry.name);
        const auto frame = whole_number(entry.name);
        if (const auto row = frame ? odometry.find(*frame) : odometry.end(); row != odometry.end()) {
            entry.world_from_camera = row->second.pose;
            entry.stamp_s = row->second.stamp_s;
        } else if (!odometry.empty()) {
            entry.warnings.push_back(fmt::format("odometry.csv has no row for {}.", entry.name));
        }
        capture.entries.push_back(std::move(entry));
    }
    if (colours.empty() && is_file(folder / "rgb.mp4"))
        capture.warnings.push_back(
            fmt::format("{}: the video is not decoded; depth alone.", (folder / "rgb.mp4").string()));
    listing.find_camera = [folder](cv::Size depth, std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        const Camera camera = stray_camera(folder / "camera_matrix.csv");
        cv::Size size = is_file(folder / "rgb.mp4") ? video_size(FileBytes(folder / "rgb.mp4")) : cv::Size();
        if (size.empty()) {
            constexpr double usual = 7.5; // 1920x1440 for 256x192
            size = {static_cast<int>(std::lround(usual * depth.width)),
                    static_cast<int>(std::lround(usual * depth.height))};
            warnings.push_back(fmt::format("{}: no rgb.mp4 tells which size it is for; {}x{} is assumed.",
                                           camera.origin, size.width, size.height));
        }
        return CameraFile{*camera_for_depth(camera, size, depth), {}, Registration::unknown, {}};
    };
    return listing;
}

// --- Polycam: keyframes/{depth,cameras,corrected_cameras,images,corrected_images,confidence}/MICROSECONDS.* ---

namespace {

/// The camera and pose of a keyframe. Throws Error naming the file and key.
std::pair<std::shared_ptr<const Camera>, MatrixPose> polycam_camera(const fs::path& file, cv::Size depth) {
    const Json object = json_in(file);
    const auto value = [&](const std::string& key) {
        const auto found = object.is_object() ? object.find(key) : object.end();
        if (found == object.end() || !found->is_number())
            throw Error(fmt::format("{}: \"{}\" is missing or no number", file.string(), key));
        return found->get<double>();
    };
    const Camera camera{{value("fx"), value("fy"), value("cx"), value("cy"), {}}, {}, file.string()};
    const cv::Size size = image_size(value("width"), value("height"), file.string());
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column)
            pose(row, column) = value(fmt::format("t_{}{}", row, column));
    return {camera_for_depth(camera, size, depth), checked_pose(from_opengl(pose), file.string())};
}

} // namespace

std::optional<Listing> list_polycam(const fs::path& folder) {
    const fs::path frames = is_folder(folder / "keyframes") ? folder / "keyframes" : folder;
    const auto depths = depth_images_in(folder_named(frames, {"depth"}));
    const bool cameras_fit = std::ranges::any_of(
        depths, [&](const fs::path& depth) { return is_file(frames / "cameras" / (depth.stem().string() + ".json")); });
    // Other recordings have folders depth/ and cameras/, too.
    if (depths.empty() || !is_folder(frames / "cameras") || (frames == folder && !cameras_fit))
        return std::nullopt;
    Listing listing = listing_of_phone("Polycam");
    Capture& capture = listing.capture;
    capture.confidence_levels = "0 low, 127 and 255 high";
    capture.guessed_beyond_m = 5;
    const ImagesByStem images(colour_images_in(folder_named(frames, {"images"}))),
        corrected(colour_images_in(folder_named(frames, {"corrected_images"}))),
        sure(colour_images_in(folder_named(frames, {"confidence"})));
    std::size_t uncorrected = 0;
    for (const fs::path& depth : depths) {
        CaptureEntry entry;
        entry.name = depth.stem().string();
        entry.depth = depth;
        entry.confidence = sure.of(entry.name);
        if (const auto microseconds = whole_number(entry.name))
            entry.stamp_s = static_cast<double>(*microseconds) * 1e-6;
        const fs::path better = frames / "corrected_cameras" / (entry.name + ".json"),
                       raw = frames / "cameras" / (entry.name + ".json");
        entry.colour = corrected.of(entry.name);
        const bool is_corrected = !entry.colour.empty() && is_file(better);
        uncorrected += !is_corrected;
        if (!is_corrected)
            entry.colour = images.of(entry.name);
        try {
            const auto [camera, pose] = polycam_camera(is_corrected ? better : raw, peek_size(depth));
            entry.camera = camera;
            entry.world_from_camera = pose.world_from_camera;
            if (!pose.warning.empty())
                entry.warnings.push_back(pose.warning);
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            entry.problem = failure.what();
        }
        capture.entries.push_back(std::move(entry));
    }
    if (uncorrected == capture.entries.size())
        capture.warnings.push_back(fmt::format("{}: no corrected_cameras/ with corrected_images/; the raw poses are "
                                               "used, which drift.",
                                               frames.string()));
    else if (uncorrected > 0)
        capture.warnings.push_back(fmt::format("{} of {} frames have no corrected camera, and take the raw one: their "
                                               "poses may be off by what was corrected.",
                                               uncorrected, capture.entries.size()));
    settle_own_cameras(listing);
    return listing;
}

// --- ARKitScenes: lowres_depth/VIDEO_SECONDS.png, lowres_wide_intrinsics/*.pincam, lowres_wide.traj ---

namespace {

/// "t rx ry rz tx ty tz": a rotation vector and a translation from world to camera.
std::vector<StampedPose> arkit_trajectory(const fs::path& file, std::vector<std::string>& warnings) {
    const std::string bytes = read_list_file(file);
    std::vector<StampedPose> poses;
    for (const TextLine& line : text_lines(bytes)) {
        std::vector<double> v;
        const auto all = words(line.text);
        if (all.empty())
            continue;
        for (const std::string_view word : all)
            if (const auto value = number(word); value && std::isfinite(*value))
                v.push_back(*value);
        if (v.size() != 7 || all.size() != 7) {
            warnings.push_back(
                fmt::format("{}: expected 7 numbers (time, rotation vector, translation); pose not used.",
                            at_line(file, line.number)));
            continue;
        }
        const Eigen::Vector3d turn(v[1], v[2], v[3]);
        const Eigen::AngleAxisd rotation(turn.norm(), turn.norm() > 0 ? turn.normalized() : Eigen::Vector3d::UnitX());
        poses.push_back({v[0], pose_from({v[4], v[5], v[6]}, Eigen::Quaterniond(rotation)).inverse()});
    }
    std::ranges::sort(poses, {}, &StampedPose::stamp_s);
    return poses;
}

/// Ten rows a second against sixty images: a row within 5 ms, or between two that are at most 0.2 s apart.
std::optional<Eigen::Isometry3d> arkit_pose(const std::vector<StampedPose>& poses, double stamp_s) {
    constexpr double same_s = 0.005, apart_s = 0.2, rounding_s = 1e-6;
    const auto after = std::ranges::lower_bound(poses, stamp_s, {}, &StampedPose::stamp_s);
    const auto near = [&](auto row) { return std::abs(row->stamp_s - stamp_s) <= same_s; };
    const bool first = after == poses.begin(), last = after == poses.end();
    const bool after_near = !last && near(after), before_near = !first && near(std::prev(after));
    if (before_near && (!after_near || stamp_s - std::prev(after)->stamp_s < after->stamp_s - stamp_s))
        return std::prev(after)->world_from_camera;
    if (after_near)
        return after->world_from_camera;
    if (first || last || after->stamp_s - std::prev(after)->stamp_s > apart_s + rounding_s)
        return std::nullopt;
    return pose_at(poses, stamp_s, apart_s);
}

/// "w h fx fy cx cy"
Camera pincam(const fs::path& file) {
    const std::string bytes = read_list_file(file);
    std::vector<double> v;
    for (const std::string_view word : words(bytes))
        if (const auto value = number(word); value && std::isfinite(*value))
            v.push_back(*value);
    if (v.size() != 6)
        throw Error(fmt::format("{}: expected 6 numbers (width height fx fy cx cy)", file.string()));
    return {{v[2], v[3], v[4], v[5], image_size(v[0], v[1], file.string())}, {}, file.string()};
}

/// VIDEO_SECONDS -> VIDEO and SECONDS.
std::optional<std::pair<std::string, double>> arkit_name(const std::string& stem) {
    const std::size_t line = stem.rfind('_');
    const auto seconds = line == std::string::npos ? std::nullopt : number(stem.substr(line + 1));
    return seconds ? std::optional(std::pair(stem.substr(0, line), *seconds)) : std::nullopt;
}

} // namespace

std::optional<Listing> list_arkit_scenes(const fs::path& given) {
    fs::path folder = given;
    if (!is_folder(folder / "lowres_depth")) // VIDEO/VIDEO_frames/
        folder = given / ((given.filename().empty() ? given.parent_path() : given).filename().string() + "_frames");
    const auto depths = depth_images_in(folder_named(folder, {"lowres_depth"}));
    if (depths.empty())
        return std::nullopt;
    Listing listing = listing_of_phone("ARKitScenes");
    Capture& capture = listing.capture;
    capture.confidence_levels = lidar_confidence;
    tell_ignored(folder, {"highres_depth"}, capture.warnings);
    const ImagesByStem sure(colour_images_in(folder_named(folder, {"confidence"}))),
        colours(colour_images_in(folder_named(folder, {"lowres_wide", "color"})));
    std::map<double, fs::path> pincams; // by seconds
    if (const auto cameras = folder_named(folder, {"lowres_wide_intrinsics", "wide_intrinsics"}))
        for (const fs::path& file : files_in(*cameras))
            if (const auto name = arkit_name(file.stem().string()); name && lower_extension(file) == ".pincam")
                pincams.emplace(name->second, file);
    std::vector<StampedPose> poses;
    if (is_file(folder / "lowres_wide.traj"))
        poses = arkit_trajectory(folder / "lowres_wide.traj", capture.warnings);
    else
        capture.warnings.push_back(fmt::format("{}: there is no lowres_wide.traj; no poses.", folder.string()));
    constexpr double of_image_s = 0.0015;
    for (const fs::path& depth : depths) {
        CaptureEntry entry;
        entry.name = depth.stem().string();
        entry.depth = depth;
        entry.confidence = sure.of(entry.name);
        entry.colour = colours.of(entry.name);
        const auto name = arkit_name(entry.name);
        if (name) {
            entry.stamp_s = name->second;
            entry.world_from_camera = arkit_pose(poses, name->second);
        }
        if (!entry.world_from_camera && !poses.empty())
            entry.warnings.push_back("lowres_wide.traj has no pose near its time.");
        const auto after = pincams.lower_bound(name ? name->second : 0);
        auto nearest = after;
        if (name && after != pincams.begin() &&
            (after == pincams.end() || name->second - std::prev(after)->first < after->first - name->second))
            nearest = std::prev(after);
        if (name && nearest != pincams.end()) {
            if (std::abs(nearest->first - name->second) > of_image_s)
                entry.warnings.push_back(
                    fmt::format("it has no camera file; that of {} is taken.", nearest->second.filename().string()));
            try {
                const Camera camera = pincam(nearest->second);
                entry.camera = camera_for_depth(camera, camera.pinhole.size, peek_size(depth));
            } catch (const Outage&) {
                throw;
            } catch (const Error& failure) {
                entry.problem = failure.what();
            }
        }
        capture.entries.push_back(std::move(entry));
    }
    settle_own_cameras(listing);
    return listing;
}

} // namespace scanshade
