// Cameras as text: 3x3 matrices and BundleFusion's info.txt.
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

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

} // namespace scanshade
