// Cameras as text: matrices, four numbers, and BundleFusion's info.txt.
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <utility>

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

namespace {

/// Words that stand before a matrix: "K = [", "array([[".
bool is_title(std::string_view word) {
    constexpr std::array titles{"K",     "M",        "A",      "=",      ":",         "K:",         "K=",
                                "array", "np.array", "tensor", "matrix", "intrinsic", "intrinsics", "camera_matrix"};
    return std::ranges::find(titles, word) != titles.end();
}

/// Whether every word is a number with a comma for its point: "140,0 0,0 79,5".
bool has_decimal_commas(const std::vector<TextLine>& lines) {
    std::size_t all = 0;
    for (const TextLine& line : lines)
        for (const std::string_view word : words(line.text)) {
            const std::size_t comma = word.find(',');
            if (comma == 0 || comma == std::string_view::npos || comma + 1 == word.size() ||
                word.find_first_not_of("+-0123456789,eE") != std::string_view::npos ||
                word.find(',', comma + 1) != std::string_view::npos)
                return false;
            ++all;
        }
    return all == 4 || all == 9 || all == 12 || all == 16;
}

/// Six numbers as "width height fx fy cx cy" or with the size last, whichever has its principal point near the middle.
std::optional<Pinhole> with_size(const std::vector<double>& m) {
    const auto fits = [](double width, double height, double cx, double cy) {
        constexpr double off = 0.2;
        return width == std::floor(width) && height == std::floor(height) && width >= 1 && height >= 1 &&
               width <= widest_image && height <= widest_image && std::abs(cx / width - 0.5) < off &&
               std::abs(cy / height - 0.5) < off;
    };
    const bool first = fits(m[0], m[1], m[4], m[5]), last = fits(m[4], m[5], m[2], m[3]);
    if (first == last)
        return std::nullopt;
    const std::size_t size = first ? 0 : 4, k = first ? 2 : 0;
    return Pinhole{m[k], m[k + 1], m[k + 2], m[k + 3], {static_cast<int>(m[size]), static_cast<int>(m[size + 1])}};
}

} // namespace

/// A matrix 3x3, 3x4 or 4x4 row by row, on as many lines as it likes, or fx fy cx cy, also with the size before or
/// behind them; with commas, semicolons and brackets, as numpy prints it.
CameraFile camera_from_matrix(const fs::path& file, const std::vector<TextLine>& lines) {
    std::vector<double> m;
    std::size_t in_first_row = 0;
    int uneven_line = 0; // whose count is not the first row's
    const bool decimal_commas = has_decimal_commas(lines);
    for (const TextLine& line : lines) {
        const std::size_t before = m.size();
        if (trimmed(line.text).starts_with('#') || trimmed(line.text).starts_with("//"))
            continue;
        std::string plain(line.text);
        if (decimal_commas)
            std::ranges::replace(plain, ',', '.');
        std::ranges::replace_if(
            plain, [](char c) { return std::string_view("[](){},;").find(c) != std::string_view::npos; }, ' ');
        for (const std::string_view word : words(plain)) {
            if (m.empty() && is_title(word))
                continue;
            const auto value = number(word);
            if (!value || !std::isfinite(*value))
                throw Error(fmt::format("{}: {} is not a finite number, expected a camera matrix",
                                        at_line(file, line.number), in_quotes(word)));
            m.push_back(*value);
        }
        const std::size_t row = m.size() - before;
        if (in_first_row == 0)
            in_first_row = row;
        else if (row > 0 && row != in_first_row && uneven_line == 0)
            uneven_line = line.number;
    }
    CameraFile result;
    if (m.size() == 4) {
        result.camera.pinhole = {m[0], m[1], m[2], m[3], {}};
        check_numbers(file, result.camera.pinhole, {"fx", "fy", "cx", "cy"});
        return result;
    }
    if (const auto sized = m.size() == 6 ? with_size(m) : std::nullopt) {
        result.camera.pinhole = *sized;
        check_numbers(file, result.camera.pinhole, {"fx", "fy", "cx", "cy"});
        return result;
    }
    if (m.size() != 9 && m.size() != 12 && m.size() != 16)
        throw Error(fmt::format(
            "{}: {}, expected a camera matrix of 3x3, 3x4 or 4x4, or fx fy cx cy",
            uneven_line > 0 ? at_line(file, uneven_line) + " is shorter or longer than the first row" : file.string(),
            counted(m.size(), "number")));
    const std::size_t columns = m.size() == 9 ? 3 : 4;
    const auto at = [&](std::size_t row, std::size_t column) { return m[row * columns + column]; };
    if (columns == 3 && m[2] == 0 && m[5] == 0 && (m[6] != 0 || m[7] != 0)) { // column by column, as of MATLAB
        std::swap(m[2], m[6]);
        std::swap(m[5], m[7]);
        std::swap(m[1], m[3]);
    }
    const bool more =
        columns == 4 && (at(0, 3) != 0 || at(1, 3) != 0 || at(2, 3) != 0 ||
                         (m.size() == 16 && (at(3, 0) != 0 || at(3, 1) != 0 || at(3, 2) != 0 || at(3, 3) != 1)));
    if (more || at(1, 0) != 0 || at(2, 0) != 0 || at(2, 1) != 0 || at(2, 2) != 1)
        refuse_camera(file, "not a camera matrix stored by rows: expected fx 0 cx, 0 fy cy, 0 0 1");
    if (at(0, 1) != 0)
        refuse_camera(file, fmt::format("skew {}, a pinhole camera here has none", at(0, 1)));
    result.camera.pinhole = {at(0, 0), at(1, 1), at(0, 2), at(1, 2), {}};
    check_numbers(file, result.camera.pinhole, {"fx", "fy", "cx", "cy"});
    return result;
}

} // namespace scanshade
