// Scenes of Hypersim: rendered images in HDF5 files, of one or more cameras; each camera is a capture.
#include "io/captures/listing/layouts.h"
#include "io/files.h"

#include "io/captures/listing/trajectory.h"
#include "io/content_hash.h"
#include "io/hdf5/hdf5.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unordered_map>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view folder_prefix = "scene_", folder_suffix = "_geometry_hdf5";
constexpr std::string_view file_prefix = "frame.", file_suffix = ".depth_meters.hdf5";
constexpr const char* data_set = "dataset"; // in every file

// --- the camera ---

/// OpenGL's projection by its parts, for images of any size.
struct Projection {
    double x_scale = 1 / std::tan(CV_PI / 6), y_scale = 0; ///< y 0: as x, in square pixels
    double x_shift = 0, y_shift = 0;
    std::string origin = "assumed: 60 degrees across";
    bool assumed = true;

    [[nodiscard]] Camera camera(cv::Size size) const {
        const double w = size.width, h = size.height;
        return {{x_scale * w / 2, y_scale > 0 ? y_scale * h / 2 : x_scale * w / 2, w / 2 * (1 - x_shift) - 0.5,
                 h / 2 * (1 + y_shift) - 0.5, size},
                {},
                origin};
    }
};

/// A line's cells; quotes hold those with commas.
std::vector<std::string> cells(std::string_view line) {
    std::vector<std::string> cells(1);
    bool quoted = false;
    for (const char c : line) {
        if (c == '"')
            quoted = !quoted;
        else if (c == ',' && !quoted)
            cells.emplace_back();
        else
            cells.back() += c;
    }
    return cells;
}

/// The scene's row of metadata_camera_parameters.csv; none where it has no row. Throws Error, too, where the camera is
/// no pinhole: artists tilted the image plane of many scenes.
std::optional<Projection> projection_in(const fs::path& file, const std::string& scene) {
    const std::string bytes = read_list_file(file);
    const auto lines = text_lines(bytes);
    if (lines.empty())
        return std::nullopt;
    const std::vector<std::string> keys = cells(lines[0].text);
    for (const TextLine& line : lines) {
        if (!line.text.starts_with(scene + ","))
            continue;
        const std::string where = fmt::format("{} ({})", at_line(file, line.number), scene);
        const std::vector<std::string> row = cells(line.text);
        const auto entry = [&](int y, int x) {
            const std::string key = fmt::format("M_proj_{}{}", y, x);
            const auto at = static_cast<std::size_t>(std::ranges::find(keys, key) - keys.begin());
            const auto value = at < row.size() ? number(row[at]) : std::nullopt;
            if (!value || !std::isfinite(*value))
                throw Error(fmt::format("{}: {} is missing or no number", where, key));
            return *value;
        };
        const double forward = -entry(3, 2);
        constexpr double tolerance = 1e-5; // a hundredth of a pixel
        for (const auto& [y, x] : {std::pair(0, 1), {0, 3}, {1, 0}, {1, 3}, {3, 0}, {3, 1}, {3, 3}})
            if (const double value = entry(y, x); !(std::abs(value) < tolerance) || !(forward > 0.5))
                throw Error(fmt::format("{}: its image plane is tilted (M_proj_{}{} is {:.3g}), which no pinhole "
                                        "camera can be",
                                        where, y, x, value));
        Projection projection{
            entry(0, 0) / forward, entry(1, 1) / forward, entry(0, 2) / forward, entry(1, 2) / forward, where, false};
        if (!(projection.x_scale > 0 && projection.y_scale > 0))
            throw Error(fmt::format("{}: scales of {} and {}, expected more than 0", where, projection.x_scale,
                                    projection.y_scale));
        return projection;
    }
    return std::nullopt;
}

/// In the scene's folder or any that it lies in.
Projection projection_of(const fs::path& scene) {
    for (fs::path folder = scene;; folder = folder.parent_path()) {
        if (const fs::path file = folder / "metadata_camera_parameters.csv"; is_file(file))
            if (auto found = projection_in(file, scene.filename().string()))
                return *std::move(found);
        if (folder == folder.parent_path())
            return {};
    }
}

// --- the images ---

class HypersimImages final : public FrameContainer {
  public:
    struct Files {
        std::string depth, colour;
    };

    [[nodiscard]] cv::Mat image(Part part, std::size_t place) const override {
        return part == Part::depth ? cv::Mat(depth(frames.at(place).depth))
                                   : cv::Mat(read_colour(frames.at(place).colour));
    }
    [[nodiscard]] cv::Size size(Part part, std::size_t place) const override {
        const Files& files = frames.at(place);
        return part == Part::depth ? size_of(Hdf5File(files.depth).dataset(data_set)) : peek_size(files.colour);
    }
    [[nodiscard]] std::string content_hash(std::size_t place, bool with_colour,
                                           bool /*with_confidence*/) const override {
        const Files& files = frames.at(place);
        return hash_of_file(files.depth) + (with_colour ? "|" + hash_of_file(files.colour) : "");
    }

    std::vector<Files> frames;
    Projection projection;
    std::optional<Pinhole> asked; ///< the user's camera

  private:
    static cv::Size size_of(const Hdf5Dataset& set) {
        const std::vector<std::uint64_t>& shape = set.shape();
        if (!set.number().floats || (shape.size() != 2 && (shape.size() != 3 || shape[2] != 1)))
            throw Error(fmt::format("{}: {}, expected floats of height x width", set.name(), set.described()));
        return image_check::checked_size(shape[1], shape[0], set.name());
    }

    /// z of the stored distances from the camera's centre: shorter by the length of the pixel's ray at z = 1.
    [[nodiscard]] cv::Mat1f depth(const std::string& file) const {
        const Hdf5Dataset set = Hdf5File(file).dataset(data_set);
        const cv::Size size = size_of(set);
        const std::size_t element = set.number().bytes;
        require_memory(size.area() * (element + sizeof(float)), fmt::format("{}: {}", set.name(), set.described()));
        const std::string bytes = set.elements(0, set.shape()[0]);
        const Pinhole camera = asked ? *asked : projection.camera(size).pinhole;
        cv::Mat1f z_m(size);
        const char* at = bytes.data();
        for (int v = 0; v < size.height; ++v)
            for (int u = 0; u < size.width; ++u, at += element) {
                const double distance_m = set.number().at(at);
                z_m(v, u) = distance_m > 0 && std::isfinite(distance_m) // not: NaN, where a ray left the scene
                                ? static_cast<float>(distance_m / camera.ray(u, v).norm())
                                : 0.0F;
            }
        return z_m;
    }
};

// --- the poses ---

/// Row by row, with the frames' numbers. Throws Error naming the file for what cannot be used.
class Poses {
  public:
    explicit Poses(const fs::path& scene, const std::string& camera)
        : folder_(scene / "_detail" / camera), metres_per_unit_(metres_per_unit(scene)) {
        const std::vector<double> indices = numbers("frame_indices", {});
        turns_ = numbers("orientations", {3, 3});
        places_ = numbers("positions", {3});
        if (turns_.size() != 9 * indices.size() || places_.size() != 3 * indices.size())
            throw Error(fmt::format("{}: {} orientations and {} positions for {}", folder_.string(), turns_.size() / 9,
                                    places_.size() / 3, counted(indices.size(), "frame index")));
        constexpr double most = 1e15; // whole numbers below it are exact
        for (std::size_t row = 0; row < indices.size(); ++row)
            if (indices[row] >= 0 && indices[row] < most)
                rows_.emplace(static_cast<std::int64_t>(indices[row]), row);
    }

    [[nodiscard]] std::size_t size() const { return rows_.size(); }

    /// Of a frame by its number.
    [[nodiscard]] MatrixPose of(std::int64_t frame) const {
        const auto found = rows_.find(frame);
        if (found == rows_.end())
            return {std::nullopt, {}, fmt::format("{}: no row for frame {}.", folder_.string(), frame)};
        const std::size_t row = found->second;
        Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
        for (std::size_t y = 0; y < 3; ++y) {
            for (std::size_t x = 0; x < 3; ++x)
                matrix(static_cast<int>(y), static_cast<int>(x)) = turns_[9 * row + 3 * y + x];
            matrix(static_cast<int>(y), 3) = places_[3 * row + y] * metres_per_unit_;
        }
        return checked_pose(from_opengl(matrix), fmt::format("{}: row {} (from 0)", folder_.string(), row));
    }

  private:
    /// Positions are in the asset's units.
    static double metres_per_unit(const fs::path& scene) {
        const fs::path file = scene / "_detail" / "metadata_scene.csv";
        const std::string bytes = read_list_file(file);
        for (const TextLine& line : text_lines(bytes)) {
            const auto row = cells(line.text);
            if (row.size() < 2 || trimmed(row[0]) != "meters_per_asset_unit")
                continue;
            const auto value = number(trimmed(row[1]));
            if (!value || !(*value > 0 && std::isfinite(*value)))
                throw Error(
                    fmt::format("{}: {} is no length in metres", at_line(file, line.number), in_quotes(row[1])));
            return *value;
        }
        throw Error(file.string() + ": no row \"meters_per_asset_unit\"");
    }

    [[nodiscard]] std::vector<double> numbers(const char* what, const std::vector<std::uint64_t>& each) const {
        const Hdf5Dataset set = Hdf5File(folder_ / fmt::format("camera_keyframe_{}.hdf5", what)).dataset(data_set);
        std::vector<std::uint64_t> inner = set.shape();
        inner.erase(inner.begin());
        if (inner != each)
            throw Error(fmt::format("{}: {}, expected N{}{}", set.name(), set.described(), each.empty() ? "" : "x",
                                    fmt::join(each, "x")));
        constexpr std::uint64_t most = 9 << 20;
        return set.numbers(most);
    }

    fs::path folder_;
    double metres_per_unit_ = 0;
    std::vector<double> turns_, places_;
    std::unordered_map<std::int64_t, std::size_t> rows_;
};

// --- the folders ---

/// "scene_cam_00_geometry_hdf5" -> "cam_00"
std::optional<std::string> camera_of_folder(const fs::path& folder) {
    const std::string name = folder.filename().string();
    if (!name.starts_with(folder_prefix) || !name.ends_with(folder_suffix) ||
        name.size() <= folder_prefix.size() + folder_suffix.size())
        return std::nullopt;
    return name.substr(folder_prefix.size(), name.size() - folder_prefix.size() - folder_suffix.size());
}

/// "frame.0042.depth_meters.hdf5" -> 42
std::optional<std::int64_t> frame_of_file(const fs::path& file) {
    const std::string name = file.filename().string();
    if (!name.starts_with(file_prefix) || !name.ends_with(file_suffix) ||
        name.size() <= file_prefix.size() + file_suffix.size())
        return std::nullopt;
    const auto number = whole_number(
        std::string_view(name).substr(file_prefix.size(), name.size() - file_prefix.size() - file_suffix.size()));
    constexpr std::uint64_t most = std::uint64_t(1) << 62;
    return number && *number < most ? std::optional(static_cast<std::int64_t>(*number)) : std::nullopt;
}

FolderFiles depths_in(const fs::path& folder) {
    return files_in(folder).only([](const fs::path& file) { return frame_of_file(file).has_value(); });
}

/// The scene's folders with distances, one for each camera.
std::vector<fs::path> folders_with_depth(const fs::path& scene) {
    std::vector<fs::path> found;
    std::error_code ignored;
    for (const auto& [name, kind] : items_in(scene / "images", ignored))
        if (const fs::path folder = scene / "images" / name;
            kind == FolderItem::Kind::folder && camera_of_folder(folder) && !depths_in(folder).empty())
            found.push_back(folder);
    std::ranges::sort(found);
    return found;
}

void take_poses(Capture& capture, const fs::path& scene, const std::string& camera,
                const std::vector<std::int64_t>& numbers) {
    std::optional<Poses> poses;
    try {
        poses.emplace(scene, camera);
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        capture.warnings.push_back(fmt::format("{}; frames have no poses.", failure.what()));
        return;
    }
    std::size_t with_row = 0;
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        const MatrixPose pose = poses->of(numbers[i]);
        with_row += pose.world_from_camera || pose.warning.find("no row") == std::string::npos;
        capture.entries[i].world_from_camera = pose.world_from_camera;
        if (!pose.warning.empty())
            capture.entries[i].warnings.push_back(pose.warning);
    }
    if (poses->size() > with_row)
        capture.warnings.push_back(fmt::format("{} of the trajectory's {} are not here (some were never published).",
                                               poses->size() - with_row, counted(poses->size(), "frame")));
}

/// The one camera's capture. `folder` has its distances.
Listing listing_of(const fs::path& scene, const fs::path& folder, const CaptureOptions& options) {
    const std::string camera = *camera_of_folder(folder);
    const fs::path previews = folder.parent_path() / fmt::format("{}{}_final_preview", folder_prefix, camera);
    auto images = std::make_shared<HypersimImages>();
    if (options.camera.empty())
        images->projection = projection_of(scene);
    else {
        const Camera asked = camera_from_argument(options.camera).camera;
        if (asked.distortion.any())
            throw Error(
                fmt::format("{}: it has a lens, but Hypersim's distances are those of a pinhole camera", asked.origin));
        images->asked = asked.pinhole;
    }
    Listing listing;
    Capture& capture = listing.capture;
    capture.depth = depth_encoding("m", "Hypersim: distances to the camera's centre in metres, turned into z");
    capture.registration = Registration::yes;
    capture.registration_reason = "rendered by one camera";
    std::vector<std::int64_t> numbers;
    std::size_t without_colour = 0;
    for (const fs::path& depth : depths_in(folder)) {
        const std::string name = depth.filename().string(), stem = name.substr(0, name.size() - file_suffix.size());
        CaptureEntry entry;
        entry.name = camera;
        entry.name.append(".").append(stem);
        entry.depth = depth.string();
        for (const char* extension : {".tonemap.jpg", ".color.jpg"})
            if (const fs::path colour = previews / (stem + extension); entry.colour.empty() && is_file(colour))
                entry.colour = colour.string();
        without_colour += entry.colour.empty();
        entry.container = images;
        entry.place = images->frames.size();
        images->frames.push_back({entry.depth, entry.colour});
        numbers.push_back(*frame_of_file(depth));
        capture.entries.push_back(std::move(entry));
    }
    if (without_colour > 0)
        capture.warnings.push_back(fmt::format("{}: no .tonemap.jpg or .color.jpg of {}.", previews.string(),
                                               counted(without_colour, "frame")));
    take_poses(capture, scene, camera, numbers);
    listing.find_camera = [images, scene](cv::Size size,
                                          std::vector<std::string>& warnings) -> std::optional<CameraFile> {
        if (size.empty())
            return std::nullopt;
        if (images->projection.assumed)
            warnings.push_back(fmt::format("no metadata_camera_parameters.csv with a row {} in its folder or above: a "
                                           "field of view of 60 degrees is assumed, as most of Hypersim has.",
                                           in_quotes(scene.filename().string())));
        CameraFile file;
        file.camera = images->projection.camera(size);
        return file;
    };
    return listing;
}

} // namespace

std::optional<Listing> list_hypersim(const fs::path& folder, const CaptureOptions& options) {
    std::error_code ignored;
    fs::path whole = fs::absolute(folder, ignored).lexically_normal();
    if (whole.filename().empty()) // "scene/" ends with an empty name
        whole = whole.parent_path();
    if (camera_of_folder(whole) && !depths_in(whole).empty())
        return listing_of(whole.parent_path().parent_path(), whole, options);
    const auto is_scene = [&](const fs::path& scene) { return is_file(scene / "_detail" / "metadata_scene.csv"); };
    if (whole.filename().string().starts_with(folder_prefix) && is_scene(whole.parent_path().parent_path()))
        throw NoFrames(fmt::format("no frames found in {}: Hypersim's distances are in {}CAMERA{}", folder.string(),
                                   folder_prefix, folder_suffix));
    if (!is_scene(whole))
        return std::nullopt;
    const std::vector<fs::path> cameras = folders_with_depth(whole);
    if (cameras.empty())
        throw NoFrames(fmt::format("no frames found in {}: a scene of Hypersim without images/{}CAMERA{}/frame.*{}",
                                   folder.string(), folder_prefix, folder_suffix, file_suffix));
    if (cameras.size() > 1) {
        std::vector<std::string> names;
        for (const fs::path& camera : cameras)
            names.push_back(camera.lexically_relative(whole).string());
        throw NoFrames(fmt::format("{}: a scene of Hypersim with {} cameras, each a capture: open {}", folder.string(),
                                   cameras.size(), fmt::join(names, ", ")));
    }
    return listing_of(whole, cameras.front(), options);
}

} // namespace scanshade
