// Cameras on disk: finds a file's format by its content, and the format to write by its name.
#include "io/cameras/camera_formats.h"
#include "io/cameras/known_cameras.h"
#include "io/files.h"
#include "io/output_file.h"
#include "io/text.h"
#include "io/utf16.h"
#include "projection/base/error.h"

#include <algorithm>
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

/// The first character that is not white space; 0 in none.
char first_in(const CameraText& text) {
    const auto first = text.bytes.find_first_not_of("\xEF\xBB\xBF \t\r\n");
    return first == std::string::npos ? '\0' : text.bytes[first];
}
/// A bracket may begin a printed matrix, too.
bool is_json(const CameraText& text) { // Python prints dictionaries with other quotes
    const bool python = text.bytes.find('"') == std::string::npos && text.bytes.find('\'') != std::string::npos;
    return (first_in(text) == '{' && !python) || (first_in(text) == '[' && lower_extension(text.file) == ".json");
}
bool is_xml(const CameraText& text) { return first_in(text) == '<'; }
bool has_keys(const CameraText& text) { return has_camera_keys(text.lines); }
/// YAML has keys at the start of lines. A file with such a key that is not JSON counts as YAML.
bool is_yaml(const CameraText& text) {
    if (text.bytes.starts_with("%YAML") || text.bytes.starts_with("---"))
        return true;
    return std::ranges::any_of(
        std::array{"camera_matrix:", "Camera_Matrix:", "cam0:", "image_width:", "distortion_model:"},
        [&](const char* key) { return text.bytes.find(key) != std::string::npos; });
}
bool is_info(const CameraText& text) { return text.bytes.find("m_calibration") != std::string::npos; }
bool is_scan(const CameraText& text) { return text.bytes.find("fx_depth") != std::string::npos; }
bool is_cameras_txt(const CameraText& text) { return is_colmap(text.lines); }
bool is_anything(const CameraText&) { return true; }

CameraFile read_json(const CameraText& text) { return camera_from_json(text.file, text.bytes); }
CameraFile read_xml(const CameraText& text) { return camera_from_xml(text.file, text.bytes); }
CameraFile read_lines(const CameraText& text) { return camera_from_lines(text.file, text.lines); }
CameraFile read_yaml(const CameraText& text) { return camera_from_yaml(text.file, text.bytes); }
CameraFile read_info(const CameraText& text) { return camera_from_info(text.file, text.lines); }
CameraFile read_scan(const CameraText& text) { return camera_from_scan(text.file, text.lines); }
CameraFile read_colmap(const CameraText& text) { return camera_from_colmap(text.file, text.lines); }
CameraFile read_matrix(const CameraText& text) { return camera_from_matrix(text.file, text.lines); }

using Quality = CameraQuality;
constexpr CameraFormatRow formats[] = {
    {.name = "scanshade",
     .recognised = "JSON with `fx`",
     .content = "lens (`distortion`, also as `dist`, `dist_coeffs`, `D`, ... or `k1`, `k2`, ...), fisheye, depth unit "
                "and correction, registration, a colour camera",
     .is = is_json,
     .read = read_json,
     .extension = ".json",
     .format = CameraFormat::scanshade,
     .written = [](const CameraFile& file, const Quality& quality) { return camera_as_json(file, quality.details); }},
    {.name = "open3d",
     .recognised = "JSON with `intrinsic_matrix`",
     .content = "a pinhole; also `K` or `camera_matrix`, row by row",
     .is = is_json,
     .read = read_json,
     .extension = ".json",
     .format = CameraFormat::open3d,
     .written = [](const CameraFile& file, const Quality&) { return camera_as_open3d(file.camera); }},
    {.name = "pcl",
     .recognised = "XML",
     .content = "a pinhole and the depth unit, beside `.pclzf`",
     .is = is_xml,
     .read = read_xml},
    {.name = "keys",
     .recognised = "lines with `fx`, as `fx = 525`, `fx: 525` or `Camera.fx: 525`",
     .content = "lens and depth unit, as of ORB-SLAM's settings and RealSense Viewer's tables",
     .is = has_keys,
     .read = read_lines},
    {.name = "opencv",
     .recognised = "YAML or XML with `camera_matrix` and `distortion_coefficients`, also by their other names",
     .content = "lens, fisheye",
     .is = is_yaml,
     .read = read_yaml,
     .extension = ".yml",
     .format = CameraFormat::opencv,
     .written = [](const CameraFile& file, const Quality& quality) { return camera_as_opencv(file.camera, quality); }},
    {.name = "ros",
     .recognised = "YAML with `distortion_model`",
     .content = "lens (plumb_bob, rational_polynomial), fisheye (equidistant)",
     .is = is_yaml,
     .read = read_yaml,
     .extension = ".yaml",
     .format = CameraFormat::ros,
     .written = [](const CameraFile& file, const Quality&) { return camera_as_ros(file.camera); }},
    {.name = "kalibr",
     .recognised = "YAML with `cam0`, or one such camera alone, as in EuRoC's `sensor.yaml`",
     .content = "lens (radtan), fisheye (equidistant); `cam1` as the colour camera",
     .is = is_yaml,
     .read = read_yaml,
     .extension = ".yaml",
     .format = CameraFormat::kalibr,
     .written = [](const CameraFile& file, const Quality&) { return camera_as_kalibr(file); }},
    {.name = "bundlefusion",
     .recognised = "lines with `m_calibration`",
     .content = "a pinhole and the depth unit, in `info.txt` or `_info.txt`",
     .is = is_info,
     .read = read_info},
    {.name = "scannet",
     .recognised = "lines with `fx_depth`",
     .content = "pinholes of depth and colour, in `SCAN.txt`",
     .is = is_scan,
     .read = read_scan},
    {.name = "colmap",
     .recognised = "lines of `ID MODEL WIDTH HEIGHT` and numbers",
     .content = "the first camera of `cameras.txt`: lens, fisheye",
     .is = is_cameras_txt,
     .read = read_colmap,
     .extension = ".txt",
     .format = CameraFormat::colmap,
     .written = [](const CameraFile& file, const Quality&) { return camera_as_colmap(file.camera); }},
    {.name = "matrix",
     .recognised = "lines of numbers",
     .content = "a matrix 3x3, 3x4 or 4x4, row by row, or fx fy cx cy",
     .is = is_anything,
     .read = read_matrix},
};

CameraFile read_any(const fs::path& file, const std::string& bytes) {
    const CameraText text{file, bytes, text_lines(bytes)};
    return std::ranges::find_if(formats, [&](const CameraFormatRow& row) { return row.is(text); })->read(text);
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
    if (bytes.starts_with("\x93NUMPY"))
        refuse_camera(file, "a NumPy array, expected text: numpy.savetxt writes it");
    CameraFile result = read_any(file, plain_text(bytes));
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

std::span<const CameraFormatRow> camera_formats() { return formats; }

std::vector<std::string> camera_format_names() {
    std::vector<std::string> names;
    for (const CameraFormatRow& row : formats)
        if (row.format)
            names.emplace_back(row.name);
    return names;
}

CameraFormat camera_format(const fs::path& file, const std::string& name) {
    std::vector<std::string> meanings; // of extensions
    for (const CameraFormatRow& row : formats) {
        if (!row.format)
            continue;
        if (name.empty() ? file.extension() == row.extension : name == row.name)
            return *row.format;
        if (meanings.empty() || !meanings.back().starts_with(fmt::format("{} ", row.extension)))
            meanings.push_back(fmt::format("{} ({})", row.extension, row.name));
    }
    throw Misuse(name.empty()
                     ? fmt::format("{}: which camera format? Known are {}, or name one of {} with --format",
                                   file.string(), fmt::join(meanings, ", "), fmt::join(camera_format_names(), ", "))
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
        return std::ranges::find(formats, std::optional(format), &CameraFormatRow::format)->written(camera, quality);
    });
    write_atomically(file, text);
}

} // namespace scanshade
