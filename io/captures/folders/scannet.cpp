// ScanNet as SensReader's Python exporter writes it: color/, depth/, pose/, intrinsic/.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

std::optional<fs::path> first_file(const fs::path& folder, std::initializer_list<const char*> names) {
    for (const char* name : names)
        if (is_file(folder / name))
            return folder / name;
    return std::nullopt;
}

/// fx, fy, cx and cy from a 4x4 intrinsic matrix.
Camera camera_from_matrix(const fs::path& file) {
    Eigen::Matrix4d k;
    if (const std::string trouble = read_matrix(file, k); !trouble.empty())
        throw Error(trouble);
    return {{k(0, 0), k(1, 1), k(0, 2), k(1, 2), {}}, {}, file.string()};
}

/// SCAN.txt, which ScanNet has beside its recordings: in the folder, or beside it with its name.
std::optional<CameraFile> camera_of_scan(const fs::path& folder) {
    std::vector<fs::path> files;
    for (const fs::path& file : files_in(folder))
        if (lower_extension(file) == ".txt")
            files.push_back(file);
    const fs::path whole = folder.filename().empty() ? folder.parent_path() : folder;
    files.push_back(whole.parent_path() / (whole.filename().string() + ".txt"));
    for (const fs::path& file : files)
        if (is_file(file) && read_bytes(file, 1 << 16).find("fx_depth") != std::string::npos)
            return read_camera_file(file);
    return std::nullopt;
}

/// Exporters may have made colour images smaller than those that the matrix is for.
std::optional<ColourCamera> colour_camera_in(const fs::path& folder, const fs::path& first_colour,
                                             std::vector<std::string>& warnings) {
    const auto file =
        first_file(folder, {"intrinsic/intrinsic_color.txt", "intrinsic_color.txt", "intrinsics_color.txt"});
    if (!file)
        return std::nullopt;
    ColourCamera colour{camera_from_matrix(*file)};
    Pinhole& k = colour.camera.pinhole;
    const cv::Size size = peek(first_colour).size;
    k.size = size;
    const double across = size.width / (2 * k.cx + 1), down = size.height / (2 * k.cy + 1);
    constexpr double off_middle = 0.1; // principal points lie that far off the middle; smaller images are half as large
    if (std::min(std::abs(across - 1), std::abs(down - 1)) > off_middle && std::abs(across / down - 1) < off_middle) {
        k.size = {static_cast<int>(std::lround(size.width / across)),
                  static_cast<int>(std::lround(size.height / down))};
        warnings.push_back(fmt::format("{}: for images of about {}x{}; scaled to {}x{}.", file->string(), k.size.width,
                                       k.size.height, size.width, size.height));
        k = scaled(k, size);
    }
    Eigen::Matrix4d of_colour = Eigen::Matrix4d::Identity(), of_depth = of_colour;
    for (const auto& [name, matrix] : {std::pair("color", &of_colour), std::pair("depth", &of_depth)})
        if (const auto extrinsic = first_file(folder, {fmt::format("intrinsic/extrinsic_{}.txt", name).c_str()}))
            if (const std::string trouble = read_matrix(*extrinsic, *matrix); !trouble.empty())
                throw Error(trouble);
    const MatrixPose apart = checked_pose(of_colour.inverse() * of_depth, (folder / "intrinsic/extrinsic_*").string());
    if (!apart.warning.empty())
        warnings.push_back(apart.warning);
    colour.colour_from_depth = apart.world_from_camera.value_or(Eigen::Isometry3d::Identity());
    return colour;
}

} // namespace

std::optional<Listing> list_scannet(const fs::path& folder) {
    const auto intrinsic =
        first_file(folder, {"intrinsic/intrinsic_depth.txt", "intrinsic_depth.txt", "intrinsics_depth.txt"});
    const FolderFiles depths = depth_images_in(folder_named(folder, {"depth"}));
    const bool poses = is_folder(folder / "pose");
    const bool numbered = !depths.empty() && whole_number(depths.front().stem().string()) &&
                          is_file(folder / "pose" / (depths.front().stem().string() + ".txt"));
    if (depths.empty() || (!intrinsic && !numbered))
        return std::nullopt;
    const FolderFiles colours = colour_images_in(folder_named(folder, {"color"}));
    const ImagesByStem by_stem(colours);
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("mm", "ScanNet layout");
    capture.registration = Registration::no;
    capture.registration_reason = "a camera of its own took the colour";
    for (const fs::path& depth : depths) {
        CaptureEntry entry;
        entry.name = depth.stem().string();
        entry.depth = depth;
        entry.colour = by_stem.of(entry.name);
        if (entry.colour.empty() && !colours.empty())
            entry.warnings.push_back(fmt::format("{} has no colour image.", depth.filename().string()));
        if (const fs::path file = folder / "pose" / (entry.name + ".txt"); is_file(file)) {
            const MatrixPose pose = read_matrix_pose(file);
            entry.world_from_camera = pose.world_from_camera;
            for (const std::string& sentence : {pose.warning, pose.problem.empty() ? "" : pose.problem + "; no pose."})
                if (!sentence.empty())
                    entry.warnings.push_back(sentence);
        } else if (poses) {
            entry.warnings.push_back(fmt::format("{} has no pose file.", depth.filename().string()));
        }
        capture.entries.push_back(std::move(entry));
    }
    listing.find_camera = [=](cv::Size, std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        if (!intrinsic) {
            auto scan = camera_of_scan(folder);
            if (!scan)
                return camera_in(folder, warnings);
            if (colours.empty())
                scan->colour.reset();
            else if (const cv::Size size = peek_size(colours.front()); scan->colour && !size.empty())
                scan->colour->camera = *camera_for_depth(scan->colour->camera, scan->colour->camera.pinhole.size, size);
            scan->registration = Registration::no;
            return scan;
        }
        CameraFile file;
        file.camera = camera_from_matrix(*intrinsic);
        file.registration = Registration::no;
        if (!colours.empty())
            file.colour = colour_camera_in(folder, colours.front(), warnings);
        return file;
    };
    return listing;
}

} // namespace scanshade
