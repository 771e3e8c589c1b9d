// Rendered recordings: NICE-SLAM's copy of Replica, and ICL-NUIM.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

struct ReplicaCamera {
    Camera camera;
    double units_per_metre = 6553.5;
    bool assumed = true;
};

/// {"camera": {w h fx fy cx cy scale}} beside the room's folder, or in it.
ReplicaCamera replica_camera(const fs::path& room) {
    for (const fs::path& file : {room / "cam_params.json", room / ".." / "cam_params.json"}) {
        if (!is_file(file))
            continue;
        const Json all = json_in(file);
        const auto camera = all.find("camera");
        const auto value = [&](const char* key) {
            if (camera == all.end() || !camera->is_object() || !camera->contains(key) || !(*camera)[key].is_number())
                throw Error(fmt::format("{}: \"camera\": \"{}\" is missing or no number", file.string(), key));
            return (*camera)[key].get<double>();
        };
        const cv::Size size = image_size(value("w"), value("h"), file.string());
        return {{{value("fx"), value("fy"), value("cx"), value("cy"), size}, {}, file.lexically_normal().string()},
                value("scale"),
                false};
    }
    return {{{600, 600, 599.5, 339.5, {1200, 680}}, {}, "assumed: Replica as NICE-SLAM renders it"}};
}

/// Rows of 16 numbers, camera to world.
std::vector<MatrixPose> matrix_rows(const fs::path& file) {
    const std::string bytes = read_list_file(file);
    std::vector<MatrixPose> poses;
    for (const TextLine& line : text_lines(bytes)) {
        const auto all = words(line.text);
        if (all.empty())
            continue;
        Eigen::Matrix4d matrix = Eigen::Matrix4d::Constant(std::nan(""));
        for (std::size_t i = 0; i < std::min<std::size_t>(all.size(), 16); ++i)
            if (const auto value = number(all[i]))
                matrix(static_cast<int>(i / 4), static_cast<int>(i % 4)) = *value;
        if (all.size() != 16 || matrix.hasNaN())
            poses.push_back({std::nullopt, {}, at_line(file, line.number) + ": expected 16 numbers; pose not used."});
        else
            poses.push_back(checked_pose(matrix, at_line(file, line.number)));
    }
    return poses;
}

bool has_prefix(const fs::path& file, std::string_view prefix) { return file.stem().string().starts_with(prefix); }

} // namespace

std::optional<Listing> list_replica(const fs::path& folder) {
    const FolderFiles depths = depth_images_in(folder_named(folder, {"results"})).only([](const fs::path& file) {
        return has_prefix(file, "depth");
    });
    if (depths.empty())
        return std::nullopt;
    const bool has_poses = is_file(folder / "traj.txt");
    const ImagesByStem colours(colour_images_in(folder / "results"));
    const std::vector<MatrixPose> poses = has_poses ? matrix_rows(folder / "traj.txt") : std::vector<MatrixPose>();
    const ReplicaCamera camera = replica_camera(folder);
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = depth_encoding(fmt::format("{}", camera.units_per_metre), camera.camera.origin);
    capture.depth.stated = !camera.assumed;
    capture.registration = Registration::yes;
    capture.registration_reason = "rendered by one camera";
    for (std::size_t i = 0; i < depths.size(); ++i) {
        CaptureEntry entry;
        entry.name = depths[i].stem().string();
        entry.depth = depths[i];
        entry.colour = colours.of("frame" + entry.name.substr(5));
        if (i < poses.size()) {
            entry.world_from_camera = poses[i].world_from_camera;
            if (!poses[i].warning.empty())
                entry.warnings.push_back(poses[i].warning);
        } else if (has_poses) {
            entry.warnings.push_back(fmt::format("traj.txt has no row for frame {}.", i));
        }
        capture.entries.push_back(std::move(entry));
    }
    if (!has_poses)
        capture.warnings.push_back(fmt::format("{}: there is no traj.txt; no poses.", folder.string()));
    listing.find_camera = [camera](cv::Size size, std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        if (camera.assumed && size != camera.camera.pinhole.size)
            return std::nullopt;
        if (camera.assumed)
            warnings.push_back("there is no cam_params.json; NICE-SLAM's fx 600 fy 600 cx 599.5 cy 339.5 and 6553.5 "
                               "units per metre are assumed.");
        return CameraFile{camera.camera, {}, Registration::unknown, {}};
    };
    return listing;
}

// --- ICL-NUIM: associations.txt (depth first, frame numbers), *.gt.freiburg; its renderer's y is up ---

namespace {

/// The other download: ray lengths as text, and POV-Ray's cameras.
void refuse_povray(const fs::path& folder) {
    for (const fs::path& file : files_in(folder))
        if (const std::string name = file.filename().string(); name.starts_with("scene_") && name.ends_with(".depth"))
            throw Error(fmt::format("{}: ICL-NUIM's files for POV-Ray are not read; its download for TUM's tools is",
                                    file.string()));
}

} // namespace

std::optional<Listing> list_icl_nuim(const fs::path& folder) {
    std::optional<fs::path> truth;
    for (const fs::path& file : files_in(folder))
        if (file.filename().string().ends_with(".gt.freiburg"))
            truth = file;
    const fs::path list = folder / "associations.txt";
    if (!truth)
        refuse_povray(folder);
    if (!truth || !is_file(list))
        return std::nullopt;
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("tum", "ICL-NUIM layout");
    capture.registration = Registration::yes;
    capture.registration_reason = "rendered by one camera";
    std::map<std::uint64_t, Eigen::Isometry3d> poses;
    for (const StampedPose& row : read_tum_trajectory(*truth, capture.warnings)) {
        // The world and the camera mirrored in y: rotations stay rotations.
        const Eigen::DiagonalMatrix<double, 3> mirror(1, -1, 1);
        Eigen::Isometry3d pose = row.world_from_camera;
        pose.linear() = (mirror * pose.linear() * mirror).eval();
        pose.translation() = (mirror * pose.translation()).eval();
        constexpr double most_frames = 1 << 24;
        if (row.stamp_s >= 0 && row.stamp_s < most_frames)
            poses.emplace(static_cast<std::uint64_t>(std::lround(row.stamp_s)), pose);
    }
    const std::string bytes = read_list_file(list);
    for (const TextLine& line : text_lines(bytes)) {
        const auto all = words(line.text);
        if (all.empty() || all[0].starts_with('#'))
            continue;
        const auto frame = all.size() == 4 ? whole_number(all[0]) : std::nullopt;
        if (!frame) {
            capture.warnings.push_back(fmt::format("{}: expected a number, a depth image, a number, a colour image; "
                                                   "line not used.",
                                                   at_line(list, line.number)));
            continue;
        }
        CaptureEntry entry;
        const std::string depth(all[1]), colour(all[3]);
        entry.name = fs::path(depth).stem().string();
        entry.depth = folder / depth;
        if (const auto trouble = trouble_with(folder, depth); !trouble.empty())
            entry.problem = fmt::format("{}: {}", at_line(list, line.number), trouble);
        if (const auto trouble = trouble_with(folder, colour); trouble.empty())
            entry.colour = folder / colour;
        else
            entry.warnings.push_back(
                fmt::format("{}: {}; processed without colour.", at_line(list, line.number), trouble));
        if (const auto pose = poses.find(*frame); pose != poses.end())
            entry.world_from_camera = pose->second;
        else
            entry.warnings.push_back(fmt::format("{} has no pose for frame {}.", truth->filename().string(), *frame));
        capture.entries.push_back(std::move(entry));
    }
    if (capture.entries.empty())
        return std::nullopt;
    listing.find_camera = [folder](cv::Size size, std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        if (auto camera = camera_in(folder, warnings))
            return camera;
        const Pinhole published{481.2, 480, 319.5, 239.5, {640, 480}};
        if (size.empty() || 3 * size.width != 4 * size.height)
            return std::nullopt;
        warnings.push_back("no camera file; ICL-NUIM's published fx 481.2 fy 480 cx 319.5 cy 239.5 is assumed.");
        return CameraFile{
            {scaled(published, size), {}, "assumed: ICL-NUIM's published camera"}, {}, Registration::unknown, {}};
    };
    return listing;
}

} // namespace scanshade
