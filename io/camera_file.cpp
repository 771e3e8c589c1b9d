// Cameras on disk: our JSON, Open3D's, text matrices and BundleFusion's info.txt, told apart by content.
#include "io/camera_file.h"

#include "io/output_file.h"
#include "io/text.h"
#include "projection/error.h"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr std::size_t largest_file = 1 << 20; // a camera is a page of text; a data set's file by mistake is not parsed
constexpr int widest_image = 1 << 16;

[[noreturn]] void refuse(const fs::path& file, const std::string& why) { throw Error(file.string() + ": " + why); }

/// Focal lengths that a pinhole can have; `names` are the words the file uses for fx, fy, cx, cy.
void check_numbers(const fs::path& file, const Pinhole& camera, const std::array<std::string, 4>& names) {
    const std::array<double, 4> values{camera.fx, camera.fy, camera.cx, camera.cy};
    for (std::size_t i = 0; i < values.size(); ++i)
        if (!std::isfinite(values[i]))
            refuse(file, fmt::format("{} is {}, expected a finite number", names[i], values[i]));
    for (std::size_t i = 0; i < 2; ++i) {
        if (values[i] == 0)
            refuse(file, fmt::format("{} is 0, expected a focal length in pixels", names[i]));
        if (values[i] < 0)
            refuse(file,
                   fmt::format("{} is {}, expected a positive focal length (fy < 0 is ICL-NUIM's flipped image axis: "
                               "flip the images or negate it yourself; nothing is mirrored silently)",
                               names[i], values[i]));
    }
}

// --- JSON ---

/// The key whose value holds byte `offset`: the last quoted word before it that a colon follows.
std::string key_before(std::string_view text, std::size_t offset) {
    const auto colon = text.substr(0, offset).rfind(':');
    if (colon == std::string_view::npos)
        return {};
    const auto close = text.substr(0, colon).rfind('"');
    if (close == std::string_view::npos || close == 0)
        return {};
    const auto open = text.substr(0, close).rfind('"');
    return open == std::string_view::npos ? std::string() : std::string(text.substr(open + 1, close - open - 1));
}

/// NaN and Infinity are what Python's json writes and JSON does not know; the parser's own message would not say so.
bool mentions_not_a_number(std::string_view rest) {
    return rest.starts_with("NaN") || rest.starts_with("nan") || rest.starts_with("Inf") || rest.starts_with("inf") ||
           rest.starts_with("-Inf") || rest.starts_with("-inf");
}

[[noreturn]] void explain_syntax(const fs::path& file, std::string_view text, const Json::parse_error& failure) {
    const std::size_t offset = std::min(text.size(), failure.byte > 0 ? failure.byte - 1 : 0);
    const auto line_start = offset == 0 ? std::string_view::npos : text.rfind('\n', offset - 1);
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(offset), '\n');
    const auto column = line_start == std::string_view::npos ? offset + 1 : offset - line_start;
    const std::string place = fmt::format("line {}, column {}", line, column);

    const std::size_t word = text.find_last_of(" \t\r\n,[:", offset == 0 ? 0 : offset - 1);
    const std::size_t word_start = word == std::string_view::npos ? 0 : word + 1;
    if (mentions_not_a_number(text.substr(std::min(word_start, text.size()))))
        refuse(file,
               fmt::format("{}: \"{}\" holds NaN or infinity, expected a number", place, key_before(text, offset)));
    std::string reason = failure.what();
    if (const auto colon = reason.find(": "); colon != std::string::npos)
        reason = reason.substr(colon + 2);
    refuse(file, fmt::format("{}: not JSON: {}", place, reason));
}

Json parse(const fs::path& file, const std::string& text) {
    try {
        return Json::parse(text);
    } catch (const Json::parse_error& failure) {
        explain_syntax(file, text, failure);
    } catch (const Json::exception& failure) { // numbers beyond double
        refuse(file, fmt::format("not usable JSON: {}", failure.what()));
    }
}

const Json& member(const fs::path& file, const Json& object, const std::string& key) {
    const auto found = object.find(key);
    if (found == object.end())
        refuse(file, fmt::format("\"{}\" is missing", key));
    return *found;
}

double number_of(const fs::path& file, const Json& value, const std::string& key) {
    if (!value.is_number())
        refuse(file, fmt::format("\"{}\" is {}, expected a number", key, in_quotes(value.dump())));
    const double found = value.get<double>();
    if (!std::isfinite(found))
        refuse(file, fmt::format("\"{}\" is not finite, expected a number", key));
    return found;
}

int size_of(const fs::path& file, const Json& object, const std::string& key) {
    const double value = number_of(file, member(file, object, key), key);
    if (value != std::floor(value) || value < 1 || value > widest_image)
        refuse(file, fmt::format("\"{}\" is {}, expected a whole number of pixels, 1 .. {}", key, value, widest_image));
    return static_cast<int>(value);
}

std::vector<double> numbers_of(const fs::path& file, const Json& object, const std::string& key, std::size_t count) {
    const Json& list = member(file, object, key);
    if (!list.is_array())
        refuse(file, fmt::format("\"{}\" is not a list of {} numbers", key, count));
    if (list.size() != count)
        refuse(file, fmt::format("\"{}\" has {}, expected {}", key, counted(list.size(), "number"), count));
    std::vector<double> values;
    for (const Json& value : list)
        values.push_back(number_of(file, value, key));
    return values;
}

/// Open3D's matrix stores columns one after another: fx 0 0, 0 fy 0, cx cy 1.
Pinhole from_columns(const fs::path& file, const std::vector<double>& m) {
    if (m[6] == 0 && m[7] == 0 && (m[2] != 0 || m[5] != 0))
        refuse(file,
               "\"intrinsic_matrix\" is stored row by row; Open3D's layout stores columns: fx 0 0 0 fy 0 cx cy 1");
    if (m[2] != 0 || m[5] != 0 || m[8] != 1 || m[1] != 0)
        refuse(file, "\"intrinsic_matrix\" is not a camera matrix stored by columns: expected fx 0 0 0 fy 0 cx cy 1");
    if (m[3] != 0)
        refuse(file, fmt::format("\"intrinsic_matrix\" has skew {}, a pinhole camera here has none", m[3]));
    const Pinhole camera{m[0], m[4], m[6], m[7], {}};
    check_numbers(
        file, camera,
        {"\"intrinsic_matrix\" fx", "\"intrinsic_matrix\" fy", "\"intrinsic_matrix\" cx", "\"intrinsic_matrix\" cy"});
    return camera;
}

Pinhole from_keys(const fs::path& file, const Json& object) {
    const auto value = [&](const std::string& key) { return number_of(file, member(file, object, key), key); };
    const Pinhole camera{value("fx"), value("fy"), value("cx"), value("cy"), {}};
    check_numbers(file, camera, {"\"fx\"", "\"fy\"", "\"cx\"", "\"cy\""});
    return camera;
}

CameraFile from_json(const fs::path& file, const std::string& text) {
    const Json object = parse(file, text);
    if (!object.is_object())
        refuse(file, "expected a JSON object that describes a camera");
    if (!object.contains("intrinsic_matrix") && !object.contains("fx"))
        refuse(file, "\"intrinsic_matrix\" (Open3D's layout) and \"fx\" (ours) are both missing");
    CameraFile result;
    Pinhole& pinhole = result.camera.pinhole;
    pinhole = object.contains("intrinsic_matrix") ? from_columns(file, numbers_of(file, object, "intrinsic_matrix", 9))
                                                  : from_keys(file, object);
    pinhole.size = {size_of(file, object, "width"), size_of(file, object, "height")};
    if (object.contains("distortion")) {
        const auto d = numbers_of(file, object, "distortion", 5);
        result.camera.distortion = {d[0], d[1], d[2], d[3], d[4]};
    }
    if (object.contains("depth_units_per_metre")) {
        const double units = number_of(file, object["depth_units_per_metre"], "depth_units_per_metre");
        if (units <= 0)
            refuse(file, fmt::format("\"depth_units_per_metre\" is {}, expected a positive number", units));
        result.depth_units_per_metre = units;
    }
    if (object.contains("registered")) {
        if (!object["registered"].is_boolean())
            refuse(file, "\"registered\" is not true or false");
        result.registration = object["registered"].get<bool>() ? Registration::yes : Registration::no;
    }
    return result;
}

// --- text ---

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
        refuse(file, fmt::format("\"{}\" is missing", key));
    const auto value = values.size() == count ? number(values[index]) : std::nullopt;
    if (!value || !std::isfinite(*value))
        throw Error(fmt::format("{}: \"{}\": expected {}", at_line(file, line), key, counted(count, "finite number")));
    return *value;
}

/// BundleFusion's info.txt: lines of "key = values", matrices 4x4 row by row.
CameraFile from_info(const fs::path& file, const std::vector<TextLine>& lines) {
    const auto entry = [&](std::size_t i) { return info_number(file, lines, "m_calibrationDepthIntrinsic", 16, i); };
    CameraFile result;
    Pinhole& pinhole = result.camera.pinhole;
    pinhole = {entry(0), entry(5), entry(2), entry(6), {}};
    check_numbers(file, pinhole, {"fx", "fy", "cx", "cy"});
    const double width = info_number(file, lines, "m_depthWidth", 1, 0);
    const double height = info_number(file, lines, "m_depthHeight", 1, 0);
    if (!(width >= 1 && width <= widest_image && height >= 1 && height <= widest_image))
        refuse(file, fmt::format("m_depthWidth {} and m_depthHeight {} are not an image size", width, height));
    pinhole.size = {static_cast<int>(width), static_cast<int>(height)};
    const double units = info_number(file, lines, "m_depthShift", 1, 0);
    if (units <= 0)
        refuse(file, fmt::format("m_depthShift is {}, expected units per metre", units));
    result.depth_units_per_metre = units;
    return result;
}

CameraFile from_matrix(const fs::path& file, const std::vector<TextLine>& lines) {
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
        refuse(file, fmt::format("{}, expected a 3x3 camera matrix", counted(static_cast<std::size_t>(rows), "row")));
    if (m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
        refuse(file, "not a camera matrix stored by rows: expected fx 0 cx, 0 fy cy, 0 0 1");
    if (m[1] != 0)
        refuse(file, fmt::format("skew {} in line 1, a pinhole camera here has none", m[1]));
    CameraFile result;
    result.camera.pinhole = {m[0], m[4], m[2], m[5], {}};
    check_numbers(file, result.camera.pinhole, {"fx", "fy", "cx", "cy"});
    return result;
}

} // namespace

CameraFile read_camera_file(const fs::path& file) {
    const std::string bytes = read_bytes(file, largest_file + 1);
    if (bytes.size() > largest_file)
        refuse(file, "more than 1 MiB, too large for a camera file");
    if (trimmed(bytes).empty())
        refuse(file, "empty file, expected a camera");
    const auto lines = text_lines(bytes);
    const auto first = bytes.find_first_of("{[");
    const bool json = first != std::string::npos && bytes.find_first_not_of("\xEF\xBB\xBF \t\r\n") == first;
    CameraFile result = json                                               ? from_json(file, bytes)
                        : bytes.find("m_calibration") != std::string::npos ? from_info(file, lines)
                                                                           : from_matrix(file, lines);
    result.camera.origin = file.string();
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
    std::error_code ignored;
    if (parts.size() != 4 || fs::exists(text, ignored)) {
        if (!fs::exists(text, ignored))
            throw Misuse(fmt::format("--camera {}: neither a file nor fx,fy,cx,cy", in_quotes(text)));
        CameraFile result = read_camera_file(text);
        result.camera.origin = "--camera " + text;
        return result;
    }
    std::array<double, 4> values{};
    for (std::size_t i = 0; i < 4; ++i) {
        const auto value = number(parts[i]);
        const bool usable = value && std::isfinite(*value) && (i >= 2 || *value > 0);
        if (!usable)
            throw Misuse(
                fmt::format("--camera {}: {} is {}, expected fx,fy,cx,cy in pixels (focal lengths positive) or a file",
                            text, std::array{"fx", "fy", "cx", "cy"}[i], in_quotes(parts[i])));
        values[i] = *value;
    }
    CameraFile result;
    result.camera.pinhole = {values[0], values[1], values[2], values[3], {}};
    result.camera.origin = "--camera " + text;
    return result;
}

void write_camera_file(const fs::path& file, const CameraFile& camera) {
    const Pinhole& pinhole = camera.camera.pinhole;
    check(camera.camera);
    nlohmann::ordered_json object{{"fx", pinhole.fx},
                                  {"fy", pinhole.fy},
                                  {"cx", pinhole.cx},
                                  {"cy", pinhole.cy},
                                  {"width", pinhole.size.width},
                                  {"height", pinhole.size.height}};
    const Distortion& d = camera.camera.distortion;
    if (d.any())
        object["distortion"] = {d.k1, d.k2, d.p1, d.p2, d.k3};
    if (camera.depth_units_per_metre)
        object["depth_units_per_metre"] = *camera.depth_units_per_metre;
    if (camera.registration != Registration::unknown)
        object["registered"] = camera.registration == Registration::yes;
    write_atomically(file, object.dump(2) + "\n");
}

} // namespace scanshade
