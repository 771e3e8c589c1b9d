// Layouts of folders other than TUM's: 7-Scenes, colour and depth folders, depth images alone, clouds.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/clouds/format.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <set>

namespace scanshade {

namespace fs = std::filesystem;

// --- 7-Scenes and BundleFusion: frame-NNNNNN.color.jpg, .depth.png, .pose.txt ---

namespace {

struct SceneFrame {
    fs::path colour, depth, pose;
};

/// "frame-000200.depth.png" -> "frame-000200" and "depth"; nothing for other names.
std::optional<std::pair<std::string, std::string>> scene_part(const std::string& name) {
    constexpr std::string_view start = "frame-";
    const auto first = name.find('.'), second = name.find('.', std::min(first, name.size() - 1) + 1);
    const bool three_parts =
        name.starts_with(start) && second != std::string::npos && name.find('.', second + 1) == std::string::npos;
    if (!three_parts || !whole_number(name.substr(start.size(), first - start.size())))
        return std::nullopt;
    return std::pair(name.substr(0, first), name.substr(first + 1, second - first - 1));
}

std::string name_list(const std::vector<std::string>& names) { return fmt::format("{}", fmt::join(names, ", ")); }

CaptureEntry scene_entry(const std::string& name, const SceneFrame& frame, const fs::path& folder, bool colours,
                         bool poses) {
    CaptureEntry entry;
    entry.name = name;
    entry.depth = frame.depth;
    entry.colour = frame.colour;
    if (frame.depth.empty()) {
        entry.problem = fmt::format("{} does not exist, though {} does", (folder / (name + ".depth.*")).string(),
                                    (frame.colour.empty() ? frame.pose : frame.colour).filename().string());
        return entry;
    }
    std::vector<std::string> missing;
    if (colours && frame.colour.empty())
        missing.emplace_back("no colour image");
    if (poses && frame.pose.empty())
        missing.emplace_back("no pose file");
    if (!missing.empty())
        entry.warnings.push_back(
            fmt::format("{} has no partner: {}.", frame.depth.filename().string(), name_list(missing)));
    if (frame.pose.empty())
        return entry;
    const MatrixPose pose = read_matrix_pose(frame.pose);
    entry.problem = pose.problem;
    entry.world_from_camera = pose.world_from_camera;
    if (!pose.warning.empty())
        entry.warnings.push_back(pose.warning);
    return entry;
}

std::optional<CameraFile> scene_camera(const fs::path& folder, cv::Size size, std::vector<std::string>& warnings) {
    if (auto camera = camera_in(folder, warnings))
        return camera;
    if (size != cv::Size(640, 480))
        return std::nullopt;
    CameraFile published;
    published.camera = {
        {585, 585, 320, 240, size}, {}, "assumed: 7-Scenes' published default, no camera file in the capture"};
    warnings.push_back(fmt::format(
        "{}: no camera file; 7-Scenes' published default fx 585 fy 585 cx 320 cy 240 is assumed.", folder.string()));
    return published;
}

} // namespace

std::optional<Listing> list_seven_scenes(const fs::path& folder) {
    std::map<std::string, SceneFrame, decltype(&natural_less)> frames(&natural_less);
    bool any_depth = false, any_colour = false, any_pose = false;
    for (const fs::path& file : files_in(folder)) {
        const auto name_and_part = scene_part(file.filename().string());
        if (!name_and_part)
            continue;
        const auto& [name, part] = *name_and_part;
        if (part == "color" && has_colour_extension(file))
            frames[name].colour = file, any_colour = true;
        if (part == "depth" && has_depth_extension(file))
            frames[name].depth = file, any_depth = true;
        if (part == "pose" && lower_extension(file) == ".txt")
            frames[name].pose = file, any_pose = true;
    }
    if (!any_depth)
        return std::nullopt;
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = usual_encoding("mm", "7-Scenes layout");
    capture.registration = Registration::no;
    capture.registration_reason = "7-Scenes colour and depth are unregistered in this layout";
    for (const auto& [name, frame] : frames)
        capture.entries.push_back(scene_entry(name, frame, folder, any_colour, any_pose));
    listing.find_camera = [folder](cv::Size size, std::vector<std::string>& warnings) {
        return scene_camera(folder, size, warnings);
    };
    return listing;
}

// --- colour and depth in folders of their own: Redwood / Open3D, RealSense tools, slambook ---

namespace {

/// rgbd.match: "depth/00000.png color/00000.jpg" per line, in either order.
void entries_from_match(const fs::path& folder, const fs::path& depth_folder, Capture& capture) {
    const fs::path list = folder / "rgbd.match";
    const std::string bytes = read_list_file(list);
    for (const TextLine& line : text_lines(bytes)) {
        auto names = words(line.text);
        if (names.empty() || names[0].starts_with('#'))
            continue;
        if (names.size() != 2) {
            capture.warnings.push_back(fmt::format("{}: {}, expected 2 file names; line not used.",
                                                   at_line(list, line.number), counted(names.size(), "word")));
            continue;
        }
        const std::string depth_start = depth_folder.filename().string() + "/";
        if (!names[0].starts_with(depth_start) && names[1].starts_with(depth_start))
            std::swap(names[0], names[1]);
        CaptureEntry entry;
        const std::string depth(names[0]), colour(names[1]);
        entry.name = fs::path(depth).stem().string();
        entry.depth = folder / depth;
        if (const auto trouble = trouble_with(folder, depth); !trouble.empty())
            entry.problem = fmt::format("{}: {}", at_line(list, line.number), trouble);
        if (const auto trouble = trouble_with(folder, colour); trouble.empty())
            entry.colour = folder / colour;
        else
            entry.warnings.push_back(
                fmt::format("{}: {}; processed without colour.", at_line(list, line.number), trouble));
        capture.entries.push_back(std::move(entry));
    }
}

/// Pairs by equal stems; where no stem is shared but there are as many of each, by order.
void entries_from_names(const FolderFiles& depths, const FolderFiles& colours, Capture& capture) {
    const ImagesByStem by_stem(colours);
    std::size_t shared = 0;
    for (const fs::path& depth : depths)
        shared += by_stem.of(depth.stem().string()).empty() ? 0 : 1;
    const bool by_order = shared == 0 && !colours.empty() && colours.size() == depths.size();
    if (by_order)
        capture.warnings.push_back(
            fmt::format("colour and depth share no file names; paired by order ({} with {}, ...).",
                        colours[0].filename().string(), depths[0].filename().string()));
    capture.entries.reserve(depths.size());
    for (std::size_t i = 0; i < depths.size(); ++i) {
        CaptureEntry& entry = capture.entries.emplace_back();
        entry.name = depths[i].stem().string();
        entry.depth = depths[i];
        entry.colour = by_order ? StoredPath(colours[i]) : by_stem.of(entry.name);
        if (entry.colour.empty() && !colours.empty())
            entry.warnings.push_back(fmt::format("{} has no colour image.", depths[i].string()));
    }
    if (!by_order && shared < colours.size())
        capture.warnings.push_back(fmt::format("{} without a depth image of the same name; not used.",
                                               counted(colours.size() - shared, "colour image")));
}

/// trajectory.log by index in recording order; pose.txt by the number in the depth image's name (row N, from 1; from 0
/// where an image is numbered 0).
void add_poses(const fs::path& folder, Capture& capture, std::vector<std::string>& used) {
    if (is_file(folder / "trajectory.log")) {
        used.emplace_back("trajectory.log");
        const auto poses = read_redwood_log(folder / "trajectory.log", capture.warnings);
        for (std::size_t i = 0; i < capture.entries.size(); ++i)
            if (const auto pose = poses.find(i); pose != poses.end())
                capture.entries[i].world_from_camera = pose->second;
            else
                capture.entries[i].warnings.push_back(fmt::format("trajectory.log has no pose for frame {}.", i));
        return;
    }
    if (!is_file(folder / "pose.txt"))
        return;
    used.emplace_back("pose.txt");
    const auto poses = read_pose_rows(folder / "pose.txt", capture.warnings);
    const auto number_in = [](const CaptureEntry& entry) { return whole_number(entry.name); };
    const bool from_zero = std::any_of(capture.entries.begin(), capture.entries.end(),
                                       [&](const CaptureEntry& entry) { return number_in(entry) == 0; });
    for (CaptureEntry& entry : capture.entries) {
        const auto number = number_in(entry);
        const auto pose = number ? poses.find(*number + (from_zero ? 1 : 0)) : poses.end();
        if (pose != poses.end())
            entry.world_from_camera = pose->second;
        else
            entry.warnings.push_back(fmt::format("pose.txt has no row for {}.", entry.name));
    }
}

} // namespace

std::optional<Listing> list_image_folders(const fs::path& folder) {
    const auto depth_folder = folder_named(folder, {"depth", "depths", "Depth", "depth_images"});
    if (!depth_folder)
        return std::nullopt;
    const auto depths = depth_images_in(depth_folder);
    if (depths.empty())
        return std::nullopt;
    const auto colour_folder = folder_named(folder, {"color", "colour", "rgb", "image", "images", "Color", "RGB"});

    Listing listing;
    Capture& capture = listing.capture;
    const bool matched = is_file(folder / "rgbd.match");
    capture.depth = assumed_encoding(depths.front());
    capture.registration_reason = "nothing in the capture says whether colour and depth are registered";
    if (matched)
        entries_from_match(folder, *depth_folder, capture);
    else
        entries_from_names(depths, colour_images_in(colour_folder), capture);
    add_poses(folder, capture, listing.used);
    listing.find_camera = [folder](cv::Size, std::vector<std::string>& warnings) {
        return camera_in(folder, warnings);
    };
    return listing;
}

std::optional<Listing> list_redwood(const fs::path& folder) {
    const bool redwood = is_file(folder / "rgbd.match") || is_file(folder / "trajectory.log");
    return redwood ? list_image_folders(folder) : std::nullopt;
}

// --- images or clouds directly in the folder ---

namespace {

/// Whether to list a file as a depth image: its header says so, or it is too damaged to tell and must be reported.
bool may_be_depth(const fs::path& file) {
    try {
        const ImageFacts facts = peek(file);
        return facts.channels == 1 && (facts.bits == 16 || facts.floats);
    } catch (const Outage&) {
        throw;
    } catch (const Error&) {
        return true;
    }
}

} // namespace

std::optional<Listing> list_depth_images(const fs::path& folder) {
    Listing listing;
    Capture& capture = listing.capture;
    std::size_t others = 0;
    for (const fs::path& file : files_in(folder)) {
        if (!has_depth_extension(file))
            continue;
        if (!may_be_depth(file)) {
            ++others;
            continue;
        }
        CaptureEntry entry;
        entry.name = file.stem().string();
        entry.depth = file;
        capture.entries.push_back(std::move(entry));
    }
    if (capture.entries.empty())
        return std::nullopt;
    capture.depth = assumed_encoding(capture.entries.front().depth);
    capture.registration_reason = "there is no colour";
    if (others > 0)
        capture.warnings.push_back(fmt::format("{}: {} left out, neither 16-bit nor float of one channel.",
                                               folder.string(), counted(others, "image")));
    listing.find_camera = [folder](cv::Size, std::vector<std::string>& warnings) {
        return camera_in(folder, warnings);
    };
    return listing;
}

namespace {

/// COLMAP's own .bin files hold no bare floats.
bool is_colmap_model(const fs::path& file) {
    return std::set<std::string>{"cameras.bin", "images.bin", "points3D.bin", "frames.bin", "rigs.bin"}.contains(
        file.filename().string());
}

/// A file of text that begins with points.
bool is_cloud_in_text(const fs::path& file) {
    constexpr std::size_t enough = 4096;
    const std::string extension = lower_extension(file);
    return (extension == ".txt" || extension == ".asc" || extension == ".csv" || extension.starts_with(".xyz")) &&
           is_cloud(read_bytes(file, enough), file);
}

} // namespace

std::optional<Listing> list_clouds(const fs::path& folder) {
    const auto files = files_in(folder);
    std::vector<fs::path> clouds;
    std::ranges::copy_if(files, std::back_inserter(clouds),
                         [](const fs::path& file) { return has_cloud_extension(file) && !is_colmap_model(file); });
    if (clouds.empty()) // beside others a text is more likely a list
        std::ranges::copy_if(files, std::back_inserter(clouds), &is_cloud_in_text);
    const auto is_table = [](const fs::path& file) { return lower_extension(file) == ".csv"; };
    if (!std::ranges::all_of(files, is_table)) // a table beside others is what they were recorded with
        std::erase_if(clouds, is_table);
    Listing listing;
    for (const fs::path& file : clouds) {
        CaptureEntry entry;
        entry.name = file.stem().string();
        entry.cloud = file;
        listing.capture.entries.push_back(std::move(entry));
    }
    if (listing.capture.entries.empty())
        return std::nullopt;
    listing.capture.depth = depth_encoding("m", "of clouds: metres by custom, or the unit that the file names");
    listing.capture.registration_reason = "colours belong to the points";
    listing.find_camera = [](cv::Size, std::vector<std::string>&) { return std::nullopt; };
    return listing;
}

} // namespace scanshade
