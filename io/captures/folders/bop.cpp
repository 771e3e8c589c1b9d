// Scenes of BOP datasets: scene_camera.json with K, depth unit and pose of each image.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

/// A key's numbers; none where it is missing. Throws Error where there are not as many.
std::vector<double> numbers_at(const fs::path& file, const std::string& image, const Json& object, const char* key,
                               std::size_t count) {
    const auto found = object.find(key);
    if (found == object.end())
        return {};
    std::vector<double> numbers;
    for (const Json& value : *found)
        if (value.is_number())
            numbers.push_back(value.get<double>());
    if (numbers.size() != count || found->size() != count)
        throw Error(fmt::format("{}: \"{}\": \"{}\": expected {} numbers", file.string(), image, key, count));
    return numbers;
}

/// A scene's folder, and what is behind the names of one sensor's files and folders.
struct Sensor {
    fs::path scene;
    std::string suffix;
};

/// Of several sensors each has scene_camera_CAM.json, depth_CAM/ and rgb_CAM/, and is opened by its depth_CAM/.
Sensor sensor_at(const fs::path& folder) {
    const fs::path whole = folder.filename().empty() ? folder.parent_path() : folder;
    const std::string name = whole.filename().string(), depth = "depth_";
    if (name.starts_with(depth))
        if (const std::string suffix = name.substr(depth.size() - 1);
            is_file(whole.parent_path() / ("scene_camera" + suffix + ".json")))
            return {whole.parent_path(), suffix};
    return {folder, {}};
}

void take_facts(const fs::path& file, const Json& all, CaptureEntry& entry) {
    const auto image = fmt::format("{}", *whole_number(entry.name));
    const auto found = all.find(image);
    if (found == all.end() || !found->is_object())
        throw Error(fmt::format("{}: \"{}\" is missing, though depth/{} exists", file.string(), image,
                                entry.depth.path().filename().string()));
    const auto k = numbers_at(file, image, *found, "cam_K", 9);
    if (k.empty())
        throw Error(fmt::format("{}: \"{}\": \"cam_K\" is missing", file.string(), image));
    const cv::Size size = peek(entry.depth).size;
    entry.camera = camera_for_depth({{k[0], k[4], k[2], k[5], {}}, {}, file.string()}, size, size);
    const auto scale = found->find("depth_scale"); // to millimetres
    if (scale == found->end() || !scale->is_number() || !(scale->get<double>() > 0))
        throw Error(fmt::format("{}: \"{}\": \"depth_scale\" is missing or not above 0", file.string(), image));
    entry.depth_units_per_metre = 1000 / scale->get<double>();
    const auto r = numbers_at(file, image, *found, "cam_R_w2c", 9), t = numbers_at(file, image, *found, "cam_t_w2c", 3);
    if (r.empty() || t.empty())
        return;
    Eigen::Matrix4d camera_from_world = Eigen::Matrix4d::Identity();
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
            camera_from_world(row, column) = r[static_cast<std::size_t>(3 * row + column)];
        camera_from_world(row, 3) = t[static_cast<std::size_t>(row)] / 1000; // millimetres
    }
    const MatrixPose pose = checked_pose(camera_from_world, fmt::format("{}: \"{}\"", file.string(), image));
    if (pose.world_from_camera)
        entry.world_from_camera = pose.world_from_camera->inverse();
    else
        entry.warnings.push_back(pose.warning);
}

} // namespace

std::optional<Listing> list_bop(const fs::path& folder) {
    const auto& [scene, suffix] = sensor_at(folder);
    const fs::path file = scene / ("scene_camera" + suffix + ".json");
    const auto depths = depth_images_in(folder_named(scene, {"depth" + suffix}));
    if (depths.empty() || !is_file(file))
        return std::nullopt;
    const Json all = json_in(file);
    const ImagesByStem colours(colour_images_in(folder_named(scene, {"rgb" + suffix, "gray" + suffix})));
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = depth_encoding("mm", "each image's depth_scale in " + file.string());
    capture.registration = Registration::yes;
    capture.registration_reason = "BOP's colour and depth are registered";
    for (const fs::path& depth : depths) {
        CaptureEntry entry;
        entry.name = depth.stem().string();
        entry.depth = depth;
        entry.colour = colours.of(entry.name);
        if (!whole_number(entry.name))
            continue;
        try {
            take_facts(file, all, entry);
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            entry.problem = failure.what();
        }
        capture.entries.push_back(std::move(entry));
    }
    const auto without = static_cast<std::size_t>(std::ranges::count_if(
        capture.entries, [](const CaptureEntry& entry) { return entry.problem.empty() && !entry.world_from_camera; }));
    if (without > 0)
        capture.warnings.push_back(fmt::format("{}: {} of {} have no pose.", file.string(), without,
                                               counted(capture.entries.size(), "image")));
    settle_own_cameras(listing);
    return listing;
}

} // namespace scanshade
