// transforms.json of nerfstudio, instant-ngp and their exporters.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <numbers>

namespace scanshade {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

/// A frame's keys win over those at the top.
class Keys {
  public:
    Keys(const fs::path& file, const Json& top, const Json& frame) : file_(file), top_(top), frame_(frame) {}

    [[nodiscard]] const Json* find(const char* key) const {
        for (const Json* object : {&frame_, &top_})
            if (const auto found = object->find(key); found != object->end() && !found->is_null())
                return &*found;
        return nullptr;
    }
    [[nodiscard]] std::optional<double> number(const char* key) const {
        const Json* value = find(key);
        if (!value)
            return std::nullopt;
        if (!value->is_number())
            throw Error(
                fmt::format("{}: \"{}\" is {}, expected a number", file_.string(), key, in_quotes(value->dump())));
        return value->get<double>();
    }
    [[nodiscard]] std::string text(const char* key) const {
        const Json* value = find(key);
        if (!value)
            return {};
        if (!value->is_string())
            throw Error(fmt::format("{}: \"{}\" is {}, expected text", file_.string(), key, in_quotes(value->dump())));
        return value->get<std::string>();
    }

  private:
    const fs::path& file_;
    const Json &top_, &frame_;
};

/// From, in this order, x_fov (degrees), fl_x, camera_angle_x (radians); y like x where it is missing.
std::optional<std::pair<double, double>> focal_lengths(const Keys& keys, cv::Size size) {
    const auto of_angle = [](double pixels, double radians) { return pixels / 2 / std::tan(radians / 2); };
    const auto along = [&](const char* fov, const char* length, const char* angle,
                           int pixels) -> std::optional<double> {
        if (const auto degrees = keys.number(fov))
            return of_angle(pixels, *degrees * std::numbers::pi / 180);
        if (const auto f = keys.number(length))
            return f;
        if (const auto radians = keys.number(angle))
            return of_angle(pixels, *radians);
        return std::nullopt;
    };
    const auto x = along("x_fov", "fl_x", "camera_angle_x", size.width);
    if (!x)
        return std::nullopt;
    return std::pair(*x, along("y_fov", "fl_y", "camera_angle_y", size.height).value_or(*x));
}

Distortion lens_of(const Keys& keys, const fs::path& file) {
    const std::string model = keys.text("camera_model");
    const Json* fisheye = keys.find("is_fisheye");
    const Json* listed = keys.find("distortion_params"); // k1 k2 k3 k4 p1 p2
    const auto coefficient = [&](const char* name, std::size_t place) {
        if (const auto value = keys.number(name))
            return *value;
        if (!listed)
            return 0.0;
        if (!listed->is_array() || listed->size() != 6 || !(*listed)[place].is_number())
            throw Error(fmt::format("{}: \"distortion_params\" is {}, expected 6 numbers (k1, k2, k3, k4, p1, p2)",
                                    file.string(), in_quotes(listed->dump())));
        return (*listed)[place].get<double>();
    };
    Distortion lens;
    if (model == "OPENCV_FISHEYE" || (fisheye && fisheye->is_boolean() && fisheye->get<bool>()))
        lens.model = LensModel::kannala_brandt;
    else if (!model.empty() && model != "PINHOLE" && model != "SIMPLE_PINHOLE" && model != "SIMPLE_RADIAL" &&
             model != "RADIAL" && model != "OPENCV")
        throw Error(fmt::format("{}: \"camera_model\" is {}, expected PINHOLE, OPENCV, OPENCV_FISHEYE or their simpler "
                                "kinds",
                                file.string(), in_quotes(model)));
    lens.k1 = coefficient("k1", 0);
    lens.k2 = coefficient("k2", 1);
    lens.k3 = coefficient("k3", 2);
    if (lens.model == LensModel::kannala_brandt) {
        lens.k4 = coefficient("k4", 3);
    } else {
        lens.p1 = coefficient("p1", 4);
        lens.p2 = coefficient("p2", 5);
    }
    return lens;
}

/// Their pixels' corners are at whole numbers: the middle of the first is at 0.5.
std::shared_ptr<const Camera> camera_of(const Keys& keys, const fs::path& file, cv::Size image, cv::Size depth,
                                        std::vector<std::string>& warnings) {
    const cv::Size usual = image.empty() ? depth : image;
    const cv::Size size =
        image_size(keys.number("w").value_or(usual.width), keys.number("h").value_or(usual.height), file.string());
    const auto focal = focal_lengths(keys, size);
    if (!focal)
        return nullptr;
    const double cx = keys.number("cx").value_or(size.width / 2.0), cy = keys.number("cy").value_or(size.height / 2.0);
    if (!image.empty() && image != size)
        warnings.push_back(fmt::format("{}: the camera is for {}x{}, the image is {}x{}; scaled.", file.string(),
                                       size.width, size.height, image.width, image.height));
    return camera_for_depth({{focal->first, focal->second, cx - 0.5, cy - 0.5, {}}, lens_of(keys, file), file.string()},
                            size, depth);
}

/// The file of that name in the capture; its extension may be missing. Empty where there is none.
std::string file_named(const fs::path& folder, std::string name) {
    std::ranges::replace(name, '\\', '/');
    for (const char* extension : {"", ".png", ".jpg", ".jpeg", ".bmp", ".exr"})
        if (trouble_with(folder, name + extension).empty())
            return folder / fs::path(name + extension).lexically_normal();
    return {};
}

cv::Size size_of(const std::string& image) {
    try {
        return image.empty() ? cv::Size() : peek(image).size;
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // loading it will say why
        return {};
    }
}

void take_pose(const Keys& keys, const std::string& where, CaptureEntry& entry) {
    const Json* rows = keys.find("transform_matrix");
    rows = rows ? rows : keys.find("transform_matrix_start");
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    std::size_t numbers = 0;
    if (rows && rows->is_array() && (rows->size() == 3 || rows->size() == 4))
        for (std::size_t row = 0; row < rows->size(); ++row)
            for (std::size_t column = 0;
                 (*rows)[row].is_array() && column < std::min<std::size_t>((*rows)[row].size(), 4); ++column)
                if ((*rows)[row][column].is_number()) {
                    matrix(static_cast<int>(row), static_cast<int>(column)) = (*rows)[row][column].get<double>();
                    ++numbers;
                }
    if (!rows || numbers != 4 * rows->size()) {
        entry.warnings.push_back(where + ": no \"transform_matrix\" of 4x4 numbers; no pose.");
        return;
    }
    const MatrixPose pose = checked_pose(from_opengl(matrix), where);
    entry.world_from_camera = pose.world_from_camera;
    if (!pose.warning.empty())
        entry.warnings.push_back(pose.warning);
}

/// instant-ngp loads depth only if it is told the unit, and not told otherwise.
bool has_ngp_depth(const Keys& keys) {
    const Json* loading = keys.find("enable_depth_loading");
    return keys.number("integer_depth_scale") && !(loading && loading->is_boolean() && !loading->get<bool>());
}

/// Of depths of which nothing says the unit: floats far beyond a room's metres are millimetres, as nerfstudio takes
/// all.
DepthEncoding unit_of(const CaptureEntry& first) {
    constexpr float farthest_m = 50;
    DepthEncoding assumed = assumed_encoding(first.depth);
    if (assumed.name != "m")
        return assumed;
    try {
        const cv::Mat1f stored = read_stored_depth(first.depth);
        std::vector<float> depths;
        std::ranges::copy_if(stored, std::back_inserter(depths), [](float z) { return std::isfinite(z) && z > 0; });
        if (const float middle = depths.empty() ? 0 : median(std::move(depths)); middle > farthest_m)
            return usual_encoding("1000",
                                  fmt::format("assumed: floats with a median of {:.4g} are millimetres", middle));
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // loading it will say why
    }
    return assumed;
}

/// The unit that all frames have in common stands for the capture.
DepthEncoding unit_of(const std::vector<CaptureEntry>& entries, const fs::path& file) {
    const double units = entries.front().depth_units_per_metre;
    const bool common = units > 0 && std::ranges::all_of(entries, [&](const CaptureEntry& entry) {
                            return entry.depth_units_per_metre == units;
                        });
    return common ? depth_encoding(fmt::format("{}", units), file.string()) : unit_of(entries.front());
}

} // namespace

std::optional<Listing> list_nerfstudio(const fs::path& folder) {
    fs::path file = folder / "transforms.json";
    if (!is_file(file))
        file = folder / "transforms_train.json";
    if (!is_file(file))
        return std::nullopt;
    const Json top = json_in(file);
    const auto frames = top.is_object() ? top.find("frames") : top.end();
    if (frames == top.end() || !frames->is_array())
        return std::nullopt;
    Listing listing;
    Capture& capture = listing.capture;
    capture.registration = Registration::yes;
    capture.registration_reason = "depth belongs to the image of its frame";
    capture.colour_in_more_pixels = true;
    std::size_t without_depth = 0, masks = 0;
    for (const Json& frame : *frames) {
        if (!frame.is_object())
            continue;
        const Keys keys(file, top, frame);
        CaptureEntry entry;
        try {
            std::string image = keys.text("file_path");
            std::ranges::replace(image, '\\', '/');
            entry.name = image; // for now: their order is that of the paths
            const std::string where = fmt::format("{}: frame {}", file.string(), in_quotes(image));
            const bool ngp = !keys.find("depth_file_path") && keys.find("depth_path");
            const std::string depth = keys.text(ngp ? "depth_path" : "depth_file_path");
            if (depth.empty() || (ngp && !has_ngp_depth(keys))) {
                ++without_depth;
                continue;
            }
            masks += keys.find("mask_path") != nullptr;
            entry.depth = file_named(folder, depth);
            if (entry.depth.empty())
                throw Error(fmt::format("{}: {}", where, trouble_with(folder, depth)));
            entry.colour = file_named(folder, image);
            if (entry.colour.empty())
                entry.warnings.push_back(
                    fmt::format("{}: {}; processed without colour.", where, trouble_with(folder, image)));
            entry.camera = camera_of(keys, file, size_of(entry.colour), size_of(entry.depth), entry.warnings);
            // The first is instant-ngp's, the second nerfstudio's; converters write either.
            for (const char* key : {"integer_depth_scale", "depth_unit_scale_factor"})
                if (const auto scale = keys.number(key); scale && *scale > 0)
                    entry.depth_units_per_metre = 1 / *scale;
            take_pose(keys, where, entry);
            const double of_world = keys.number("applied_scale").value_or(1);
            if (entry.world_from_camera && of_world > 0 && of_world != 1)
                entry.world_from_camera->translation() /= of_world;
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            entry.problem = failure.what();
        }
        capture.entries.push_back(std::move(entry));
    }
    if (capture.entries.empty())
        return std::nullopt;
    std::ranges::stable_sort(capture.entries, &natural_less, &CaptureEntry::name);
    for (CaptureEntry& entry : capture.entries)
        entry.name = fs::path(entry.name).stem().string();
    capture.depth = unit_of(capture.entries, file);
    if (without_depth > 0)
        capture.warnings.push_back(
            fmt::format("{}: {} left out, without depth.", file.string(), counted(without_depth, "frame")));
    if (masks > 0)
        capture.warnings.push_back(fmt::format("{}: masks are not applied.", file.string()));
    if (const auto scale = top.find("applied_scale"); scale != top.end() && scale->is_number() && *scale != 1)
        capture.warnings.push_back(
            fmt::format("{}: poses are divided by its applied_scale of {}.", file.string(), scale->get<double>()));
    settle_own_cameras(listing);
    return listing;
}

} // namespace scanshade
