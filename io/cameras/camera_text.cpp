// Cameras as text: 3x3 matrices, BundleFusion's info.txt, and COLMAP's cameras.txt.
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// "m_depthWidth = 640": the value's words, or nothing where the key is missing.
std::vector<std::string_view> info_value(const std::vector<TextLine>& lines, std::string_view key, int& line_number) {
    for (const TextLine& line : lines) {
        const auto all = words(line.text);
        if (all.size() < 3 || all[0] != key || all[1] != "=")
            continue;
        line_number = line.number;
        return {all.begin() + 2, all.end()};
    }
    return {};
}

double info_number(const fs::path& file, const std::vector<TextLine>& lines, std::string_view key, std::size_t count,
                   std::size_t index) {
    int line = 1;
    const auto values = info_value(lines, key, line);
    if (values.empty())
        refuse_camera(file, fmt::format("\"{}\" is missing", key));
    const auto value = values.size() == count ? number(values[index]) : std::nullopt;
    if (!value || !std::isfinite(*value))
        throw Error(fmt::format("{}: \"{}\": expected {}", at_line(file, line), key, counted(count, "finite number")));
    return *value;
}

} // namespace

/// BundleFusion's info.txt: lines of "key = values", matrices 4x4 row by row.
CameraFile camera_from_info(const fs::path& file, const std::vector<TextLine>& lines) {
    const auto entry = [&](std::size_t i) { return info_number(file, lines, "m_calibrationDepthIntrinsic", 16, i); };
    CameraFile result;
    Pinhole& pinhole = result.camera.pinhole;
    pinhole = {entry(0), entry(5), entry(2), entry(6), {}};
    check_numbers(file, pinhole, {"fx", "fy", "cx", "cy"});
    const double width = info_number(file, lines, "m_depthWidth", 1, 0);
    const double height = info_number(file, lines, "m_depthHeight", 1, 0);
    if (!(width >= 1 && width <= widest_image && height >= 1 && height <= widest_image))
        refuse_camera(file, fmt::format("m_depthWidth {} and m_depthHeight {} are not an image size", width, height));
    pinhole.size = {static_cast<int>(width), static_cast<int>(height)};
    const double units = info_number(file, lines, "m_depthShift", 1, 0);
    if (units <= 0)
        refuse_camera(file, fmt::format("m_depthShift is {}, expected units per metre", units));
    result.depth_units_per_metre = units;
    return result;
}

/// Lines of "key = value": fx_depth fy_depth mx_depth my_depth depthWidth depthHeight, and the same of color.
CameraFile camera_from_scan(const fs::path& file, const std::vector<TextLine>& lines) {
    const auto camera_of = [&](const std::string& image) {
        const auto value = [&](const std::string& key) { return info_number(file, lines, key, 1, 0); };
        Camera camera;
        Pinhole& pinhole = camera.pinhole;
        pinhole = {value("fx_" + image), value("fy_" + image), value("mx_" + image), value("my_" + image), {}};
        check_numbers(file, pinhole, {"fx_" + image, "fy_" + image, "mx_" + image, "my_" + image});
        const double width = value(image + "Width"), height = value(image + "Height");
        if (!(width >= 1 && width <= widest_image && height >= 1 && height <= widest_image))
            refuse_camera(file,
                          fmt::format("{}Width {} and {}Height {} are not an image size", image, width, image, height));
        pinhole.size = {static_cast<int>(width), static_cast<int>(height)};
        return camera;
    };
    CameraFile result;
    result.camera = camera_of("depth");
    int line = 1;
    if (!info_value(lines, "fx_color", line).empty())
        result.colour = ColourCamera{camera_of("color"), Eigen::Isometry3d::Identity()};
    return result;
}

CameraFile camera_from_matrix(const fs::path& file, const std::vector<TextLine>& lines) {
    std::array<double, 9> m{};
    int rows = 0;
    for (const TextLine& line : lines) {
        const auto row = words(line.text);
        if (row.empty() || row[0].starts_with('#'))
            continue;
        if (rows == 3)
            throw Error(at_line(file, line.number) + ": a fourth row, expected a 3x3 matrix");
        if (row.size() != 3)
            throw Error(fmt::format("{}: {}, expected 3 (a row of a 3x3 camera matrix)", at_line(file, line.number),
                                    counted(row.size(), "value")));
        for (std::size_t i = 0; i < 3; ++i) {
            const auto value = number(row[i]);
            if (!value || !std::isfinite(*value))
                throw Error(
                    fmt::format("{}: {} is not a finite number", at_line(file, line.number), in_quotes(row[i])));
            m[static_cast<std::size_t>(rows) * 3 + i] = *value;
        }
        ++rows;
    }
    if (rows != 3)
        refuse_camera(file,
                      fmt::format("{}, expected a 3x3 camera matrix", counted(static_cast<std::size_t>(rows), "row")));
    if (m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
        refuse_camera(file, "not a camera matrix stored by rows: expected fx 0 cx, 0 fy cy, 0 0 1");
    if (m[1] != 0)
        refuse_camera(file, fmt::format("skew {} in line 1, a pinhole camera here has none", m[1]));
    CameraFile result;
    result.camera.pinhole = {m[0], m[4], m[2], m[5], {}};
    check_numbers(file, result.camera.pinhole, {"fx", "fy", "cx", "cy"});
    return result;
}

// --- COLMAP: "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", pixel centres at 0.5 ---

namespace {

struct ColmapModel {
    std::string_view name;
    std::size_t numbers;
    Camera (*read)(const std::vector<double>& p);
};

Camera square(const std::vector<double>& p, Distortion lens) { return {{p[0], p[0], p[1], p[2], {}}, lens, {}}; }
Camera oblong(const std::vector<double>& p, Distortion lens) { return {{p[0], p[1], p[2], p[3], {}}, lens, {}}; }

const ColmapModel colmap_models[] = {
    {"SIMPLE_PINHOLE", 3, [](const auto& p) { return square(p, {}); }},
    {"PINHOLE", 4, [](const auto& p) { return oblong(p, {}); }},
    {"SIMPLE_RADIAL", 4,
     [](const auto& p) {
         return square(p, {p[3], 0, 0, 0, 0});
     }},
    {"RADIAL", 5,
     [](const auto& p) {
         return square(p, {p[3], p[4], 0, 0, 0});
     }},
    {"OPENCV", 8,
     [](const auto& p) {
         return oblong(p, {p[4], p[5], p[6], p[7], 0});
     }},
    {"FULL_OPENCV", 12,
     [](const auto& p) {
         return oblong(p, {p[4], p[5], p[6], p[7], p[8]});
     }},
    {"OPENCV_FISHEYE", 8,
     [](const auto& p) {
         return oblong(p, {p[4], p[5], 0, 0, p[6], p[7], LensModel::kannala_brandt});
     }},
};

bool is_colmap_line(const std::vector<std::string_view>& all) {
    return all.size() >= 5 && whole_number(all[0]) && std::isupper(static_cast<unsigned char>(all[1][0])) &&
           whole_number(all[2]) && whole_number(all[3]);
}

} // namespace

bool is_colmap(const std::vector<TextLine>& lines) {
    return std::any_of(lines.begin(), lines.end(),
                       [](const TextLine& line) { return is_colmap_line(words(line.text)); });
}

CameraFile camera_from_colmap(const fs::path& file, const std::vector<TextLine>& lines) {
    CameraFile result;
    bool found = false;
    for (const TextLine& line : lines) {
        const auto all = words(line.text);
        if (all.empty() || all[0].starts_with('#'))
            continue;
        const std::string place = at_line(file, line.number);
        if (!is_colmap_line(all))
            throw Error(place + ": expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
        if (found) {
            result.warnings.push_back(place + ": more than one camera; the first is used.");
            break;
        }
        const auto model = std::find_if(std::begin(colmap_models), std::end(colmap_models),
                                        [&](const ColmapModel& known) { return known.name == all[1]; });
        if (model == std::end(colmap_models))
            throw Error(fmt::format("{}: the camera model {} is not supported", place, in_quotes(all[1])));
        std::vector<double> numbers;
        for (std::size_t i = 4; i < all.size(); ++i) {
            const auto value = number(all[i]);
            if (!value || !std::isfinite(*value))
                throw Error(fmt::format("{}: {} is not a finite number", place, in_quotes(all[i])));
            numbers.push_back(*value);
        }
        if (numbers.size() != model->numbers)
            throw Error(fmt::format("{}: {} has {}, expected {}", place, model->name, counted(numbers.size(), "number"),
                                    model->numbers));
        if (model->name == "FULL_OPENCV" && (numbers[9] != 0 || numbers[10] != 0 || numbers[11] != 0))
            throw Error(place + ": k4, k5, k6 of a rational lens are not supported");
        result.camera = model->read(numbers);
        Pinhole& pinhole = result.camera.pinhole;
        pinhole.cx -= 0.5; // our pixel centres are integers
        pinhole.cy -= 0.5;
        const auto width = *whole_number(all[2]), height = *whole_number(all[3]);
        if (width < 1 || height < 1 || width > widest_image || height > widest_image)
            throw Error(fmt::format("{}: {}x{} is no image size", place, width, height));
        pinhole.size = {static_cast<int>(width), static_cast<int>(height)};
        check_numbers(file, pinhole, {"fx", "fy", "cx", "cy"});
        found = true;
    }
    if (!found)
        refuse_camera(file, "no camera in it");
    return result;
}

std::string camera_as_colmap(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    const Distortion& d = camera.distortion;
    const std::string start =
        fmt::format("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]; pixel centres at 0.5\n1 {{}} {} {} {} {} {} {}",
                    size.width, size.height, fx, fy, cx + 0.5, cy + 0.5);
    const auto line = [&](const char* model) { return fmt::format(fmt::runtime(start), model); };
    if (d.model == LensModel::kannala_brandt)
        return fmt::format("{} {} {} {} {}\n", line("OPENCV_FISHEYE"), d.k1, d.k2, d.k3, d.k4);
    if (!d.any())
        return line("PINHOLE") + "\n";
    if (d.k3 == 0)
        return fmt::format("{} {} {} {} {}\n", line("OPENCV"), d.k1, d.k2, d.p1, d.p2);
    return fmt::format("{} {} {} {} {} {} 0 0 0\n", line("FULL_OPENCV"), d.k1, d.k2, d.p1, d.p2, d.k3);
}

} // namespace scanshade
