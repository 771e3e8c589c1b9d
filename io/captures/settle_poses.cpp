// Opening: poses of the recording or of a file, as cameras with y downwards have them.
#include "io/captures/settle.h"

#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <optional>
#include <set>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// Names of what looks like poses or cameras in a folder that was read as a generic one.
std::vector<std::string> unused_in(const fs::path& folder, const Listing& listing) {
    static const std::set<std::string> folders{"pose",   "poses",       "intrinsic", "intrinsics",
                                               "calib",  "calibration", "camera",    "cameras",
                                               "sparse", "colmap",      "extrinsics"};
    constexpr std::array words{"pose",      "traj",  "odom",   "transform",  "intrinsic",
                               "extrinsic", "calib", "camera", "groundtruth"};
    constexpr std::array endings{".pincam", ".traj", ".log", ".npz"};
    const auto speaks = [&](std::string name) {
        std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
        return std::ranges::any_of(words, [&](const char* word) { return name.find(word) != std::string::npos; }) ||
               std::ranges::any_of(endings, [&](const char* ending) { return name.ends_with(ending); });
    };
    std::set<std::string> used(listing.used.begin(), listing.used.end());
    if (listing.capture.camera)
        used.insert(fs::path(listing.capture.camera->origin).filename().string());
    for (const CaptureEntry& entry : listing.capture.entries) // images may be called so
        used.insert(entry.depth.path().filename().string());
    std::vector<std::string> unused;
    std::error_code ignored;
    for (const auto& [name, kind] : items_in(folder, ignored))
        if (!used.contains(name) && (kind == FolderItem::Kind::folder ? folders.contains(name) : speaks(name)))
            unused.push_back(name);
    std::ranges::sort(unused);
    return unused;
}

} // namespace

void turn_poses_y_down(Capture& capture) {
    const Eigen::DiagonalMatrix<double, 3> mirror(1, -1, 1);
    for (CaptureEntry& entry : capture.entries) {
        if (!entry.world_from_camera)
            continue;
        Eigen::Isometry3d& pose = *entry.world_from_camera;
        pose.linear() = (mirror * pose.linear() * mirror).eval();
        pose.translation() = (mirror * pose.translation()).eval();
        if (!entry.motion)
            continue;
        entry.motion->rotation_per_s = -(mirror * entry.motion->rotation_per_s).eval();
        entry.motion->translation_per_s = (mirror * entry.motion->translation_per_s).eval();
    }
}

void leave_out_equal_poses(Capture& capture) {
    constexpr std::size_t enough = 3; // two frames may be of one place
    const CaptureEntry* first = nullptr;
    std::size_t posed = 0;
    for (const CaptureEntry& entry : capture.entries) {
        if (!entry.world_from_camera)
            continue;
        first = first ? first : &entry;
        ++posed;
        if (entry.world_from_camera->matrix() != first->world_from_camera->matrix())
            return;
    }
    if (posed < enough)
        return;
    for (CaptureEntry& entry : capture.entries) {
        entry.world_from_camera = std::nullopt;
        entry.motion = std::nullopt;
    }
    capture.warnings.push_back(
        fmt::format("all {} poses are equal: none were recorded, or the camera stood still. They "
                    "are not used; --poses FILE gives others.",
                    posed));
}

void take_poses(Capture& capture, const CaptureOptions& options) {
    const std::vector<StampedPose> poses = read_tum_trajectory(options.poses, capture.warnings);
    std::size_t found = 0;
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        CaptureEntry& entry = capture.entries[i];
        entry.world_from_camera = entry.stamp_s ? pose_at(poses, *entry.stamp_s, options.association_limit_s)
                                                : pose_at(poses, static_cast<double>(i), 0.01);
        found += entry.world_from_camera.has_value();
    }
    if (found == 0)
        throw Error(fmt::format("{}: none of its {} poses belongs to a frame of {} (by {})", options.poses.string(),
                                poses.size(), capture.path.string(),
                                capture.entries.front().stamp_s ? "time" : "index"));
    capture.warnings.push_back(
        fmt::format("{} of {} frames have a pose in {}.", found, capture.entries.size(), options.poses.string()));
}

void tell_unused(const fs::path& folder, Listing& listing) {
    const std::vector<std::string> unused = unused_in(folder, listing);
    if (!unused.empty())
        listing.capture.warnings.push_back(
            fmt::format("{}: not used, though their names speak of poses or cameras: {}.", folder.string(),
                        fmt::join(unused, ", ")));
}

} // namespace scanshade
