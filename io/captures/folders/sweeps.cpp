// Sweeps of a laser scanner on a car: KITTI odometry's sequences and nuScenes. Clouds stay in the scanner's frame; each
// has the pose world_from_scanner.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/json_table.h"
#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <span>
#include <unordered_set>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

Listing listing_of_sweeps() {
    Listing listing;
    listing.capture.depth = depth_encoding("m", "of the layout's clouds: metres");
    listing.capture.registration_reason = "there is no colour";
    listing.find_camera = [](cv::Size, std::vector<std::string>&) { return std::nullopt; };
    return listing;
}

// --- KITTI odometry ---

/// Twelve words as the upper rows of a 4x4. Throws Error, beginning with `where`, for anything else; NaN is a number.
Eigen::Matrix4d matrix_of(std::span<const std::string_view> twelve, const std::string& where) {
    if (twelve.size() != 12)
        throw Error(fmt::format("{}: {}, expected 12 (3 rows of 4)", where, counted(twelve.size(), "value")));
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    for (std::size_t i = 0; i < 12; ++i) {
        const auto value = number(twelve[i]);
        if (!value)
            throw Error(fmt::format("{}: {} is not a number", where, in_quotes(twelve[i])));
        matrix(static_cast<Eigen::Index>(i / 4), static_cast<Eigen::Index>(i % 4)) = *value;
    }
    return matrix;
}

/// What is read of a file, or nothing and a warning.
template <class Read>
auto unless_damaged(std::vector<std::string>& warnings, const Read& read) -> decltype(std::optional(read())) {
    try {
        return read();
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        warnings.push_back(fmt::format("{}; sweeps have no poses.", failure.what()));
        return std::nullopt;
    }
}

/// calib.txt's line "Tr: 12 numbers", which downloads of old do not have.
Eigen::Isometry3d camera_from_scanner(const fs::path& file) {
    const std::string bytes = read_list_file(file);
    for (const TextLine& line : text_lines(bytes)) {
        const auto row = words(line.text);
        if (row.empty() || (row[0] != "Tr:" && row[0] != "Tr"))
            continue;
        const std::string where = at_line(file, line.number);
        const MatrixPose pose = checked_pose(matrix_of(std::span(row).subspan(1), where), where);
        if (!pose.world_from_camera)
            throw Error(pose.warning.substr(0, pose.warning.find(';')));
        return *pose.world_from_camera;
    }
    throw Error(file.string() + ": no line \"Tr:\" (scanner to camera)");
}

/// One pose a line, world_from_camera; those that cannot be used have their reason.
std::vector<MatrixPose> poses_in_rows(const fs::path& file) {
    const std::string bytes = read_list_file(file);
    std::vector<MatrixPose> poses;
    for (const TextLine& line : text_lines(bytes)) {
        if (trimmed(line.text).empty())
            continue;
        const std::string where = at_line(file, line.number);
        try {
            poses.push_back(checked_pose(matrix_of(words(line.text), where), where));
        } catch (const Error& failure) {
            poses.push_back({std::nullopt, {}, fmt::format("{}; pose not used.", failure.what())});
        }
    }
    return poses;
}

std::vector<double> stamps_in(const fs::path& file, std::vector<std::string>& warnings) {
    if (!is_file(file))
        return {};
    const std::string bytes = read_list_file(file);
    std::vector<double> stamps;
    for (const TextLine& line : text_lines(bytes)) {
        if (trimmed(line.text).empty())
            continue;
        const auto stamp = number(trimmed(line.text));
        if (!stamp || !std::isfinite(*stamp)) {
            warnings.push_back(fmt::format("{}: {} is no time in seconds; times are not used.",
                                           at_line(file, line.number), in_quotes(line.text)));
            return {};
        }
        stamps.push_back(*stamp);
    }
    return stamps;
}

/// SemanticKITTI's poses.txt lies in the sequence, KITTI's own poses/NN.txt two levels up.
fs::path file_of_poses(const fs::path& sequence) {
    std::error_code ignored;
    if (fs::path own = sequence / "poses.txt"; is_file(own))
        return own;
    const fs::path whole = fs::absolute(sequence, ignored).lexically_normal();
    const fs::path named = whole.filename().empty() ? whole.parent_path() : whole; // "00/" ends with an empty name
    return named.parent_path().parent_path() / "poses" / (named.filename().string() + ".txt");
}

} // namespace

std::optional<Listing> list_kitti_odometry(const fs::path& folder) {
    const auto velodyne = folder_named(folder, {"velodyne"});
    if (!velodyne || !is_file(folder / "calib.txt"))
        return std::nullopt;
    const FolderFiles sweeps =
        files_in(*velodyne).only([](const fs::path& file) { return lower_extension(file) == ".bin"; });
    if (sweeps.empty())
        return std::nullopt;
    Listing listing = listing_of_sweeps();
    Capture& capture = listing.capture;
    tell_ignored(folder, {"image_0", "image_1", "image_2", "image_3"}, capture.warnings);
    const auto camera_from =
        unless_damaged(capture.warnings, [&] { return camera_from_scanner(folder / "calib.txt"); });
    const fs::path file = file_of_poses(folder);
    const auto poses = camera_from ? unless_damaged(capture.warnings, [&] { return poses_in_rows(file); })
                                   : std::optional<std::vector<MatrixPose>>();
    const auto stamps = stamps_in(folder / "times.txt", capture.warnings);
    if (poses && poses->size() != sweeps.size())
        capture.warnings.push_back(fmt::format("{}: {}, velodyne/ has {}; they are paired by the sweeps' numbers.",
                                               file.string(), counted(poses->size(), "pose"),
                                               counted(sweeps.size(), "sweep")));
    for (std::size_t i = 0; i < sweeps.size(); ++i) {
        CaptureEntry entry;
        entry.name = sweeps[i].stem().string();
        entry.cloud = sweeps[i];
        const std::size_t row = whole_number(entry.name).value_or(i);
        if (row < stamps.size())
            entry.stamp_s = stamps[row];
        if (poses && row >= poses->size()) {
            entry.warnings.push_back(fmt::format("{}: no row {} (from 0) for {}.", file.string(), row, entry.name));
        } else if (poses) {
            const MatrixPose& pose = (*poses)[row];
            if (pose.world_from_camera)
                entry.world_from_camera = *pose.world_from_camera * *camera_from;
            else
                entry.warnings.push_back(pose.warning);
        }
        capture.entries.push_back(std::move(entry));
    }
    return listing;
}

// --- nuScenes ---

namespace {

/// A row's "translation" and "rotation", a quaternion with w first.
MatrixPose pose_in(const std::vector<double>& t, const std::vector<double>& q, const std::string& where) {
    if (t.size() != 3 || q.size() != 4)
        return {std::nullopt, {}, where + ": expected a \"translation\" of 3 and a \"rotation\" of 4 numbers"};
    const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
    constexpr double unit_tolerance = 1e-2;
    if (!(std::abs(rotation.norm() - 1) < unit_tolerance))
        return {std::nullopt, {}, fmt::format("{}: a quaternion of length {:.3g}, expected 1", where, rotation.norm())};
    return {pose_from({t[0], t[1], t[2]}, rotation), {}, {}};
}

using PosesByToken = std::unordered_map<std::string, MatrixPose>;

/// Of the tokens that `wanted` has.
PosesByToken poses_by_token(const fs::path& file, const std::unordered_set<std::string>& wanted) {
    PosesByToken poses;
    for_each_row(file, {"token", "translation", "rotation"}, [&](TableRow& row) {
        const std::string& token = row.texts[0];
        if (wanted.contains(token))
            poses.emplace(token, pose_in(row.numbers[1], row.numbers[2],
                                         fmt::format("{}: token {}", file.string(), in_quotes(token))));
    });
    return poses;
}

/// The pose of a token; none, and why.
MatrixPose pose_of(const PosesByToken& poses, const std::string& token, const fs::path& file) {
    const auto found = poses.find(token);
    return found != poses.end()
               ? found->second
               : MatrixPose{std::nullopt, {}, fmt::format("{}: no token {}", file.string(), in_quotes(token))};
}

/// The folders of tables, v1.0-mini and the like.
std::vector<fs::path> folders_of_tables(const fs::path& folder) {
    std::vector<fs::path> found;
    std::error_code ignored;
    for (const auto& [name, kind] : items_in(folder, ignored))
        if (name.starts_with("v1.0-") && is_file(folder / name / "sample_data.json"))
            found.push_back(folder / name);
    std::ranges::sort(found);
    return found;
}

struct Sweep {
    std::string file, ego_pose, sensor;
    std::int64_t stamp_us = 0;
};

/// Those of a table whose files are there, by time; images and radar are none.
std::vector<Sweep> sweeps_in(const fs::path& table, const fs::path& folder, std::vector<std::string>& warnings) {
    std::vector<Sweep> sweeps;
    std::size_t missing = 0, scenes = 0;
    const auto read = [&](RepeatedWarning& outside) {
        for_each_row(table, {"filename", "ego_pose_token", "calibrated_sensor_token", "prev", "timestamp"},
                     [&](TableRow& row) {
                         const std::string& file = row.texts[0];
                         if (!file.ends_with(".pcd.bin"))
                             return;
                         if (const std::string trouble = trouble_with(folder, file); !trouble.empty()) {
                             if (trouble.find("does not exist") == std::string::npos)
                                 outside.add(fmt::format("{}: {}.", table.string(), trouble));
                             else
                                 ++missing;
                             return;
                         }
                         constexpr double most_us = 1e17; // some 3000 years
                         const std::vector<double>& stamp = row.numbers[4];
                         if (stamp.size() != 1 || !(std::abs(stamp[0]) < most_us))
                             throw Error(fmt::format("{}: {}: \"timestamp\" is missing, expected microseconds",
                                                     table.string(), in_quotes(file)));
                         constexpr std::size_t most_sweeps = 1 << 22;
                         if (sweeps.size() == most_sweeps)
                             throw Error(fmt::format("{}: more than {} sweeps", table.string(), most_sweeps));
                         scenes += row.texts[3].empty();
                         sweeps.push_back({file, row.texts[1], row.texts[2], static_cast<std::int64_t>(stamp[0])});
                     });
    };
    {
        RepeatedWarning outside(warnings); // ends with their count
        read(outside);
    }
    if (missing > 0)
        warnings.push_back(
            fmt::format("{}: {} named there that do not exist; left out.", table.string(), counted(missing, "sweep")));
    if (scenes > 1)
        warnings.push_back(fmt::format("{} scenes, by time; each has its own world (--frames picks sweeps).", scenes));
    std::ranges::stable_sort(sweeps, {}, &Sweep::stamp_us);
    return sweeps;
}

} // namespace

std::optional<Listing> list_nuscenes(const fs::path& folder) {
    const auto tables = folders_of_tables(folder);
    if (tables.empty())
        return std::nullopt;
    Listing listing = listing_of_sweeps();
    Capture& capture = listing.capture;
    if (tables.size() > 1)
        capture.warnings.push_back(fmt::format("{}: {} folders of tables; {} is used.", folder.string(), tables.size(),
                                               tables.front().filename().string()));
    const fs::path ego_file = tables.front() / "ego_pose.json", sensor_file = tables.front() / "calibrated_sensor.json",
                   sweep_file = tables.front() / "sample_data.json";
    const std::vector<Sweep> sweeps = sweeps_in(sweep_file, folder, capture.warnings);
    if (sweeps.empty())
        throw NoFrames(sweep_file.string() + ": none of its LIDAR_TOP/*.pcd.bin is here");
    std::unordered_set<std::string> egos, sensors;
    for (const Sweep& sweep : sweeps) {
        egos.insert(sweep.ego_pose);
        sensors.insert(sweep.sensor);
    }
    const auto world_from_ego = unless_damaged(capture.warnings, [&] { return poses_by_token(ego_file, egos); });
    const auto ego_from_sensor = unless_damaged(capture.warnings, [&] { return poses_by_token(sensor_file, sensors); });
    for (const Sweep& sweep : sweeps) {
        CaptureEntry entry;
        const std::string name = fs::path(sweep.file).filename().string();
        entry.name = name.substr(0, name.size() - std::string_view(".pcd.bin").size());
        entry.cloud = folder / sweep.file;
        entry.stamp_s = static_cast<double>(sweep.stamp_us) * 1e-6;
        if (world_from_ego && ego_from_sensor) {
            const MatrixPose ego = pose_of(*world_from_ego, sweep.ego_pose, ego_file),
                             sensor = pose_of(*ego_from_sensor, sweep.sensor, sensor_file);
            if (ego.world_from_camera && sensor.world_from_camera)
                entry.world_from_camera = *ego.world_from_camera * *sensor.world_from_camera;
            for (const MatrixPose& pose : {ego, sensor})
                if (!pose.warning.empty())
                    entry.warnings.push_back(pose.warning + "; pose not used.");
        }
        capture.entries.push_back(std::move(entry));
    }
    return listing;
}

} // namespace scanshade
