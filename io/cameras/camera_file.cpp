// Cameras on disk: finds a file's format by its content, and the format to write by its name.
#include "io/cameras/camera_formats.h"
#include "io/cameras/known_cameras.h"
#include "io/files.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade {

namespace fs = std::filesystem;

void refuse_camera(const fs::path& file, const std::string& why) { throw Error(file.string() + ": " + why); }

void check_numbers(const fs::path& file, const Pinhole& camera, const std::array<std::string, 4>& names) {
    const std::array<double, 4> values{camera.fx, camera.fy, camera.cx, camera.cy};
    for (std::size_t i = 0; i < values.size(); ++i)
        if (!std::isfinite(values[i]))
            refuse_camera(file, fmt::format("{} is {}, expected a finite number", names[i], values[i]));
    for (std::size_t i = 0; i < 2; ++i) {
        if (values[i] == 0)
            refuse_camera(file, fmt::format("{} is 0, expected a focal length in pixels", names[i]));
    }
    if (values[0] < 0)
        refuse_camera(file, fmt::format("{} is {}, expected a positive focal length", names[0], values[0]));
}

Eigen::Isometry3d rigid_from(const fs::path& file, const Eigen::Matrix4d& matrix, const std::string& key) {
    constexpr double close = 1e-3;
    const Eigen::Matrix3d turn = matrix.topLeftCorner<3, 3>();
    const bool rotation =
        turn.determinant() > 0 && (turn * turn.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < close;
    if (!rotation || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
        refuse_camera(file, fmt::format("\"{}\" is not a rotation and a shift", key));
    Eigen::Isometry3d rigid = Eigen::Isometry3d::Identity();
    rigid.linear() = Eigen::Quaterniond(turn).normalized().toRotationMatrix();
    rigid.translation() = matrix.topRightCorner<3, 1>();
    return rigid;
}

namespace {

constexpr std::size_t largest_file = 1 << 20; // a camera is a page of text; larger files are given by mistake

struct FormatRow {
    const char* name;
    CameraFormat format;
    const char* extension; ///< the first row of an extension is what it means without --format
};
constexpr FormatRow formats[] = {
    {"scanshade", CameraFormat::scanshade, ".json"}, {"open3d", CameraFormat::open3d, ".json"},
    {"opencv", CameraFormat::opencv, ".yml"},        {"ros", CameraFormat::ros, ".yaml"},
    {"kalibr", CameraFormat::kalibr, ".yaml"},       {"colmap", CameraFormat::colmap, ".txt"}};

/// YAML has keys at the start of lines. A file with such a key that is not JSON counts as YAML.
bool is_yaml(const std::string& bytes) {
    if (bytes.starts_with("%YAML") || bytes.starts_with("---"))
        return true;
    for (const char* key : {"camera_matrix:", "cam0:", "image_width:", "distortion_model:"})
        if (bytes.find(key) != std::string::npos)
            return true;
    return false;
}

CameraFile read_any(const fs::path& file, const std::string& bytes) {
    const auto lines = text_lines(bytes);
    const auto first = bytes.find_first_not_of("\xEF\xBB\xBF \t\r\n");
    if (first != std::string::npos && (bytes[first] == '{' || bytes[first] == '['))
        return camera_from_json(file, bytes);
    if (first != std::string::npos && bytes[first] == '<')
        return camera_from_xml(file, bytes);
    if (is_yaml(bytes))
        return camera_from_yaml(file, bytes);
    if (bytes.find("m_calibration") != std::string::npos)
        return camera_from_info(file, lines);
    return is_colmap(lines) ? camera_from_colmap(file, lines) : camera_from_matrix(file, lines);
}

/// With fy < 0, y is upwards and rows still go down. Turned downwards, the camera sees the same: a pixel's row does not
/// change, y changes its sign, and with it the tangential distortion p1.
void turn_y_down(CameraFile& file) {
    Camera& camera = file.camera;
    if (!(camera.pinhole.fy < 0))
        return;
    if (file.colour)
        throw Error(fmt::format("{}: fy is {}, which flips the y axis, beside a secondary camera: expected a positive "
                                "number, as it is not known whether that camera's pose is flipped, too",
                                camera.origin, camera.pinhole.fy));
    file.warnings.push_back(
        fmt::format("{}: fy is {}: y is upwards, as in ICL-NUIM. The camera is used with y downwards, "
                    "and the capture's poses are turned likewise.",
                    camera.origin, camera.pinhole.fy));
    camera.pinhole.fy = -camera.pinhole.fy;
    if (camera.distortion.model == LensModel::brown_conrady)
        camera.distortion.p1 = -camera.distortion.p1;
    file.y_was_up = true;
}

void refuse_what_is_only_ours(const CameraFile& camera, CameraFormat format) {
    if (format == CameraFormat::scanshade)
        return;
    if (camera.colour && format != CameraFormat::kalibr)
        throw Error("this format holds one camera, and there is a secondary camera for colour; write .json "
                    "(ours) or --format kalibr");
    if (camera.depth_correction.any())
        throw Error(fmt::format("this format has no depth correction, and there is one ({}); write .json (ours)",
                                describe(camera.depth_correction)));
    if (camera.pose_time_offset_s != 0)
        throw Error(fmt::format("this format has no time offset, and there is one ({:g} s); write .json (ours)",
                                camera.pose_time_offset_s));
}

} // namespace

CameraFile read_camera_file(const fs::path& file) {
    const std::string bytes = read_at_most(largest_file, file, "a camera file");
    if (trimmed(bytes).empty())
        refuse_camera(file, "empty file, expected a camera");
    CameraFile result = read_any(file, bytes);
    result.camera.origin = file.string();
    if (result.colour)
        result.colour->camera.origin = file.string();
    turn_y_down(result);
    return result;
}

CameraFile camera_from_argument(const std::string& text) {
    std::vector<std::string_view> parts;
    for (std::string_view rest = text;;) {
        const auto comma = rest.find(',');
        parts.push_back(trimmed(rest.substr(0, comma)));
        if (comma == std::string_view::npos)
            break;
        rest.remove_prefix(comma + 1);
    }
    if (parts.size() != 4 || is_there(text)) {
        if (!is_there(text)) {
            if (const auto known = known_camera(text))
                return {.camera = *known, .depth_units_per_metre = {}, .warnings = {}};
            throw Misuse(fmt::format("--camera {}: neither a file, nor fx,fy,cx,cy, nor one of {}", in_quotes(text),
                                     fmt::join(known_camera_names(), ", ")));
        }
        CameraFile result = read_camera_file(text);
        result.camera.origin = "--camera " + text;
        return result;
    }
    std::array<double, 4> values{};
    for (std::size_t i = 0; i < 4; ++i) {
        const auto value = number(parts[i]);
        const bool usable = value && std::isfinite(*value) && (i >= 2 || (i == 0 ? *value > 0 : *value != 0));
        if (!usable)
            throw Misuse(
                fmt::format("--camera {}: {} is {}, expected fx,fy,cx,cy in pixels (fx positive, fy not 0) or a file",
                            text, std::array{"fx", "fy", "cx", "cy"}[i], in_quotes(parts[i])));
        values[i] = *value;
    }
    CameraFile result;
    result.camera.pinhole = {values[0], values[1], values[2], values[3], {}};
    result.camera.origin = "--camera " + text;
    turn_y_down(result);
    return result;
}

std::vector<std::string> camera_format_names() {
    std::vector<std::string> names;
    for (const FormatRow& row : formats)
        names.emplace_back(row.name);
    return names;
}

CameraFormat camera_format(const fs::path& file, const std::string& name) {
    for (const FormatRow& row : formats)
        if (name.empty() ? file.extension() == row.extension : name == row.name)
            return row.format;
    throw Misuse(name.empty()
                     ? fmt::format("{}: which camera format? Known are .json (ours), .yml (OpenCV), .yaml (ROS), "
                                   ".txt (COLMAP), or name one of {} with --format",
                                   file.string(), fmt::join(camera_format_names(), ", "))
                     : fmt::format("'{}' is no camera format, expected one of {}", name,
                                   fmt::join(camera_format_names(), ", ")));
}

void write_camera_file(const fs::path& file, const CameraFile& camera, CameraFormat format,
                       const CameraQuality& quality) {
    check(camera.camera);
    if (camera.colour)
        check(camera.colour->camera);
    const std::string text = during(file.string(), [&] {
        refuse_what_is_only_ours(camera, format);
        switch (format) {
        case CameraFormat::open3d:
            return camera_as_open3d(camera.camera);
        case CameraFormat::opencv:
            return camera_as_opencv(camera.camera, quality);
        case CameraFormat::ros:
            return camera_as_ros(camera.camera);
        case CameraFormat::kalibr:
            return camera_as_kalibr(camera);
        case CameraFormat::colmap:
            return camera_as_colmap(camera.camera);
        case CameraFormat::scanshade:
            break;
        }
        return camera_as_json(camera, quality.details);
    });
    write_atomically(file, text);
}

} // namespace scanshade
