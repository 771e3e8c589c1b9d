// Cameras as JSON: ours, and Open3D's.
#include "io/cameras/camera_formats.h"
#include "io/shallow_json.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

namespace scanshade {

namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

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

/// Python's json writes NaN and Infinity, which JSON does not have. The parser's own message would not say so.
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
        refuse_camera(
            file, fmt::format("{}: \"{}\" holds NaN or infinity, expected a number", place, key_before(text, offset)));
    const std::string_view rest = text.substr(offset, text.find('\n', offset) - offset);
    refuse_camera(file, rest.empty() ? fmt::format("{}: not JSON: the text ends there", place)
                                     : fmt::format("{}: not JSON from {} on", place, in_quotes(rest)));
}

Json parse(const fs::path& file, const std::string& text) {
    try {
        return shallow_json<Json>(text);
    } catch (const Json::parse_error& failure) {
        explain_syntax(file, text, failure);
    } catch (const Error& failure) {
        refuse_camera(file, failure.what());
    } catch (const Json::exception& failure) {
        refuse_camera(file, json_problem(failure.id, failure.what()));
    }
}

const Json& member(const fs::path& file, const Json& object, const std::string& key) {
    const auto found = object.find(key);
    if (found == object.end())
        refuse_camera(file, fmt::format("\"{}\" is missing", key));
    return *found;
}

double number_of(const fs::path& file, const Json& value, const std::string& key) {
    if (!value.is_number())
        refuse_camera(file, fmt::format("\"{}\" is {}, expected a number", key, in_quotes(value.dump())));
    const double found = value.get<double>();
    if (!std::isfinite(found))
        refuse_camera(file, fmt::format("\"{}\" is not finite, expected a number", key));
    return found;
}

int size_of(const fs::path& file, const Json& object, const std::string& key) {
    const double value = number_of(file, member(file, object, key), key);
    if (value != std::floor(value) || value < 1 || value > widest_image)
        refuse_camera(
            file, fmt::format("\"{}\" is {}, expected a whole number of pixels, 1 .. {}", key, value, widest_image));
    return static_cast<int>(value);
}

std::vector<double> numbers_of(const fs::path& file, const Json& object, const std::string& key, std::size_t count) {
    const Json& list = member(file, object, key);
    if (!list.is_array())
        refuse_camera(file, fmt::format("\"{}\" is not a list of {} numbers", key, count));
    if (list.size() != count)
        refuse_camera(file, fmt::format("\"{}\" has {}, expected {}", key, counted(list.size(), "number"), count));
    std::vector<double> values;
    for (const Json& value : list)
        values.push_back(number_of(file, value, key));
    return values;
}

/// Open3D's matrix stores columns one after another: fx 0 0, 0 fy 0, cx cy 1.
Pinhole from_columns(const fs::path& file, const std::vector<double>& m) {
    if (m[6] == 0 && m[7] == 0 && (m[2] != 0 || m[5] != 0))
        refuse_camera(
            file, "\"intrinsic_matrix\" is stored row by row; Open3D's layout stores columns: fx 0 0 0 fy 0 cx cy 1");
    if (m[2] != 0 || m[5] != 0 || m[8] != 1 || m[1] != 0)
        refuse_camera(file,
                      "\"intrinsic_matrix\" is not a camera matrix stored by columns: expected fx 0 0 0 fy 0 cx cy 1");
    if (m[3] != 0)
        refuse_camera(file, fmt::format("\"intrinsic_matrix\" has skew {}, a pinhole camera here has none", m[3]));
    const Pinhole camera{m[0], m[4], m[6], m[7], {}};
    check_numbers(
        file, camera,
        {"\"intrinsic_matrix\" fx", "\"intrinsic_matrix\" fy", "\"intrinsic_matrix\" cx", "\"intrinsic_matrix\" cy"});
    return camera;
}

/// Our name of a key, or the one by which others know it: librealsense says ppx and ppy.
std::string either(const Json& object, const char* ours, const char* theirs) {
    return !object.contains(ours) && object.contains(theirs) ? theirs : ours;
}

Pinhole from_keys(const fs::path& file, const Json& object) {
    const auto value = [&](const std::string& key) { return number_of(file, member(file, object, key), key); };
    const std::string cx = either(object, "cx", "ppx"), cy = either(object, "cy", "ppy");
    const Pinhole camera{value("fx"), value("fy"), value(cx), value(cy), {}};
    check_numbers(file, camera, {"\"fx\"", "\"fy\"", in_quotes(cx), in_quotes(cy)});
    return camera;
}

constexpr std::array model_keys{"camera_model", "distortion_model", "model"};

/// Whether the file names a lens model of four radial coefficients.
bool names_fisheye(const Json& object) {
    constexpr std::array names{"fisheye", "FISHEYE", "equidistant", "EQUIDISTANT", "kannala", "KANNALA"};
    return std::ranges::any_of(model_keys, [&](const char* key) {
        const std::string model = object.contains(key) ? object[key].dump() : "";
        return std::ranges::any_of(names, [&](const char* name) { return model.find(name) != std::string::npos; });
    });
}

constexpr std::array lists{"distortion", "fisheye", "distortion_coefficients", "dist_coeffs", "distCoeffs", "dist",
                           "coeffs",     "D"};
constexpr std::array numbers{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};

/// Ours are `distortion` and `fisheye`. Other names that lenses go by are read, too, for one left out bends planes:
/// lists, and single numbers as instant-ngp has them.
Distortion lens_of(const fs::path& file, const Json& object) {
    const auto is_there = [&](const char* key) { // null and an empty list say that there is no lens
        return object.contains(key) && !object[key].empty();
    };
    std::vector<std::string> found;
    std::ranges::copy_if(lists, std::back_inserter(found), is_there);
    if (const auto* number = std::ranges::find_if(numbers, is_there); number != numbers.end())
        found.emplace_back(*number);
    if (found.empty())
        return {};
    if (found.size() > 1)
        refuse_camera(file,
                      fmt::format("\"{}\" and \"{}\" are both there, one lens expected", found.front(), found.back()));
    const std::string& key = found.front();
    const bool fisheye = key == "fisheye" || names_fisheye(object);
    const Json& list = object[key];
    const bool is_list = std::ranges::count(lists, key) > 0;
    if (is_list && !list.is_object()) {
        if (fisheye)
            return kannala_brandt(numbers_of(file, object, key, 4));
        constexpr std::array usual{4U, 8U, 12U, 14U}; // else 5 are expected
        auto k =
            numbers_of(file, object, key, list.is_array() && std::ranges::count(usual, list.size()) ? list.size() : 5);
        for (; k.size() > 8; k.pop_back())
            if (k.back() != 0)
                refuse_camera(file,
                              fmt::format("\"{}\" number {} is {}: thin-prism and tilted lenses are not supported", key,
                                          k.size(), k.back()));
        return brown_conrady(k);
    }
    const Json& named = is_list ? list : object;
    const auto number = [&](const char* name) {
        return named.contains(name) ? number_of(file, named[name], name) : 0.0;
    };
    if (fisheye)
        return kannala_brandt({number("k1"), number("k2"), number("k3"), number("k4")});
    std::vector<double> coefficients;
    std::ranges::transform(numbers, std::back_inserter(coefficients), number);
    return brown_conrady(coefficients);
}

/// librealsense's inverse model undistorts by what others distort with.
void refuse_inverse_lens(const fs::path& file, const Json& object, const Distortion& lens) {
    for (const char* key : model_keys) {
        std::string model = object.contains(key) ? object[key].dump() : "";
        std::ranges::transform(model, model.begin(),
                               [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
        if (lens.any() && model.find("inverse") != std::string::npos)
            refuse_camera(file, fmt::format("\"{}\" is {}: lenses given by their inverse are not read; give a camera "
                                            "without one, or `scanshade refine` the capture",
                                            key, object[key].dump()));
    }
}

/// A matrix row by row, as lists of lists, as nine numbers, or as OpenCV's "data".
constexpr std::array matrices{"K", "camera_matrix", "cameraMatrix", "intrinsics", "intrinsic"};

const Json* matrix_in(const Json& object) {
    for (const char* key : matrices)
        if (const auto found = object.find(key); found != object.end()) {
            const Json& matrix = found->is_object() && found->contains("data") ? (*found)["data"] : *found;
            if (matrix.is_array())
                return &matrix;
        }
    return nullptr;
}

Pinhole from_rows(const fs::path& file, const Json& matrix) {
    std::vector<double> m;
    const auto add = [&](const Json& value) { m.push_back(number_of(file, value, "camera matrix")); };
    for (const Json& row : matrix)
        if (row.is_array())
            std::ranges::for_each(row, add);
        else
            add(row);
    if (m.size() == 4 && !matrix[0].is_array()) {
        const Pinhole camera{m[0], m[1], m[2], m[3], {}};
        check_numbers(file, camera, {"fx", "fy", "cx", "cy"});
        return camera;
    }
    if (m.size() == 9 && m[2] == 0 && m[5] == 0 && (m[6] != 0 || m[7] != 0)) { // column by column, as of ARKit
        std::swap(m[2], m[6]);
        std::swap(m[5], m[7]);
        std::swap(m[1], m[3]);
    }
    if (m.size() != 9 || m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
        refuse_camera(file, "no camera matrix: expected fx 0 cx, 0 fy cy, 0 0 1 row by row, or fx fy cx cy");
    const Pinhole camera{m[0], m[4], m[2], m[5], {}};
    check_numbers(file, camera, {"fx", "fy", "cx", "cy"});
    return camera;
}

enum class Sizes { needed, optional };

Camera one_camera(const fs::path& file, const Json& object, Sizes sizes = Sizes::needed) {
    Camera camera;
    const Json* const matrix = matrix_in(object);
    camera.pinhole = object.contains("intrinsic_matrix")
                         ? from_columns(file, numbers_of(file, object, "intrinsic_matrix", 9))
                     : matrix && !object.contains("fx") ? from_rows(file, *matrix)
                                                        : from_keys(file, object);
    const std::string width = either(object, "width", "w"), height = either(object, "height", "h");
    if ((sizes == Sizes::needed && !matrix) || object.contains(width) || object.contains(height))
        camera.pinhole.size = {size_of(file, object, width), size_of(file, object, height)};
    camera.distortion = lens_of(file, object);
    refuse_inverse_lens(file, object, camera.distortion);
    return camera;
}

DepthCorrection correction_of(const fs::path& file, const Json& object) {
    if (!object.is_object())
        refuse_camera(file, "\"depth_correction\" is not an object of scale, offset_m and curve_per_m");
    const auto value = [&](const std::string& key, double otherwise) {
        return object.contains(key) ? number_of(file, object[key], key) : otherwise;
    };
    const DepthCorrection correction{value("scale", 1), value("offset_m", 0), value("curve_per_m", 0)};
    if (correction.scale <= 0)
        refuse_camera(file, fmt::format("\"scale\" is {}, a positive number expected", correction.scale));
    return correction;
}

constexpr const char* units_per_metre = "depthmapfactor"; // ORB-SLAM's, as camera_from_lines() spells it
constexpr std::array depth_scales{units_per_metre, "depth_scale",         "png_depth_scale",
                                  "depth_factor",  "integer_depth_scale", "depth_unit_scale_factor"};

/// The unit of depths by a key of others, which mean different things by the same name: metres per unit (librealsense
/// 0.001, nerfstudio), millimetres per unit (BOP 0.1 and 1), units per metre (Open3D 1000, NICE-SLAM 6553.5). The
/// number tells them apart, since sensors store 0.01 to 10 mm a unit. Says how it was taken; where it is none of these,
/// that it is not used.
void take_depth_scale(const fs::path& file, const Json& object, CameraFile& result) {
    for (const char* key : depth_scales) {
        if (!object.contains(key))
            continue;
        const double scale = number_of(file, object[key], key);
        const auto take = [&](double units, const char* meaning) {
            result.depth_units_per_metre = units;
            result.warnings.push_back(fmt::format("{}: \"{}\" {:g} was taken as {}: {:g} units per metre.",
                                                  file.string(), key, scale, meaning, units));
        };
        const bool known = key == units_per_metre;
        if (result.depth_units_per_metre || !(scale > 0) || (!known && scale > 10 && scale < 100))
            result.warnings.push_back(fmt::format("{}: \"{}\" {:g} is not used.", file.string(), key, scale));
        else if (known || scale >= 100)
            take(scale, "units per metre");
        else if (scale <= 0.01)
            take(1 / scale, "metres per unit");
        else
            take(1000 / scale, "millimetres per unit, as in BOP");
    }
}

/// What standards write beside a camera and what has no part in it: ROS's rectification, calibrations' own records.
constexpr std::array harmless{
    "R",         "P",   "r",      "p",         "rectification_matrix", "projection_matrix", "binning_x",
    "binning_y", "roi", "header", "refinement"};

bool is_numeric(const Json& value) {
    return value.is_number() || (value.is_array() && !value.empty() && value[0].is_number());
}

/// The keys below `object` whose numbers nothing reads, with those of nested objects behind a point.
void collect_unused(const Json& object, const std::string& path, std::vector<std::string>& unused) {
    constexpr std::array others{"intrinsic_matrix",
                                "fx",
                                "fy",
                                "cx",
                                "cy",
                                "ppx",
                                "ppy",
                                "width",
                                "height",
                                "w",
                                "h",
                                "depth_units_per_metre",
                                "pose_time_offset_s",
                                "image_width",
                                "image_height",
                                "image_Width",
                                "image_Height",
                                "fisheye_model",
                                "colour",
                                "depth_correction"};
    const auto used = [&](const std::string& key) {
        return std::ranges::count(others, key) + std::ranges::count(matrices, key) + std::ranges::count(lists, key) +
                   std::ranges::count(numbers, key) + std::ranges::count(depth_scales, key) +
                   std::ranges::count(harmless, key) >
               0;
    };
    for (const auto& [key, value] : object.items()) {
        if (path.empty() && used(key))
            continue;
        if (is_numeric(value))
            unused.push_back(in_quotes(path + key));
        else if (value.is_object())
            collect_unused(value, path + key + ".", unused);
    }
}

/// Names the numbers in the file that nothing reads: one of them may be what makes the depths wrong.
void name_unused(const fs::path& file, const Json& object, CameraFile& result) {
    constexpr std::size_t most = 12;
    std::vector<std::string> unused;
    collect_unused(object, "", unused);
    const std::size_t all = unused.size();
    unused.resize(std::min(all, most));
    if (!unused.empty())
        result.warnings.push_back(fmt::format("{}: not used: {}{}.", file.string(), fmt::join(unused, ", "),
                                              all > most ? fmt::format(" and {} more", all - most) : ""));
}

/// The secondary camera, which took the colour images.
ColourCamera secondary_camera(const fs::path& file, const Json& object) {
    if (!object.is_object())
        refuse_camera(file, "not an object that describes a camera");
    const Json& rows = member(file, object, "colour_from_depth");
    Eigen::Matrix4d matrix;
    if (!rows.is_array() || rows.size() != 4)
        refuse_camera(file, "\"colour_from_depth\" is not a list of 4 rows");
    for (int row = 0; row < 4; ++row) {
        const auto values = numbers_of(file, {{"colour_from_depth", rows[row]}}, "colour_from_depth", 4);
        matrix.row(row) = Eigen::Vector4d::Map(values.data()).transpose();
    }
    ColourCamera colour{one_camera(file, object), {}};
    colour.colour_from_depth = rigid_from(file, matrix, "colour_from_depth");
    check(colour.camera);
    return colour;
}

} // namespace

CameraFile camera_from_json(const fs::path& file, const std::string& text) {
    const Json root = parse(file, text);
    const bool four = root.is_array() && root.size() == 4 && is_numeric(root);
    const bool matrix = root.is_array() && (root.size() == 9 || root.size() == 3) && is_numeric(root[0]);
    if (!root.is_object() && !four && !matrix && (!root.is_array() || root.empty() || !root[0].is_object()))
        refuse_camera(file, "expected a JSON object that describes a camera");
    std::vector<std::string> warnings;
    const Json object = in_our_words(file, four || matrix ? Json{{"K", root}} : root, warnings);
    CameraFile result;
    result.warnings = std::move(warnings);
    result.camera = one_camera(file, object);
    if (object.contains("depth_units_per_metre")) {
        const double units = number_of(file, object["depth_units_per_metre"], "depth_units_per_metre");
        if (units <= 0)
            refuse_camera(file, fmt::format("\"depth_units_per_metre\" is {}, expected a positive number", units));
        result.depth_units_per_metre = units;
    }
    use_other_keys(file, object, result);
    if (object.contains("registered")) {
        if (!object["registered"].is_boolean())
            refuse_camera(file, "\"registered\" is not true or false");
        result.registration = object["registered"].get<bool>() ? Registration::yes : Registration::no;
    }
    if (object.contains("depth_correction"))
        result.depth_correction = correction_of(file, object["depth_correction"]);
    if (object.contains("pose_time_offset_s"))
        result.pose_time_offset_s = number_of(file, object["pose_time_offset_s"], "pose_time_offset_s");
    if (object.contains("colour"))
        result.colour = during("\"colour\"", [&] { return secondary_camera(file, object["colour"]); });
    return result;
}

CameraFile camera_from_keys(const fs::path& file, const Json& object) {
    CameraFile result;
    result.camera = one_camera(file, object, Sizes::optional);
    use_other_keys(file, object, result);
    return result;
}

void use_other_keys(const fs::path& file, const Json& object, CameraFile& result) {
    take_depth_scale(file, object, result);
    name_unused(file, object, result);
}

namespace {

nlohmann::ordered_json as_object(const Camera& camera) {
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    nlohmann::ordered_json object{
        {"fx", fx}, {"fy", fy}, {"cx", cx}, {"cy", cy}, {"width", size.width}, {"height", size.height}};
    const Distortion& d = camera.distortion;
    if (d.model == LensModel::kannala_brandt)
        object["fisheye"] = coefficients(d);
    else if (d.any())
        object["distortion"] = coefficients(d);
    return object;
}

} // namespace

std::string camera_as_json(const CameraFile& camera, const std::string& details) {
    nlohmann::ordered_json object = as_object(camera.camera);
    if (camera.depth_units_per_metre)
        object["depth_units_per_metre"] = *camera.depth_units_per_metre;
    if (camera.registration != Registration::unknown)
        object["registered"] = camera.registration == Registration::yes;
    if (const DepthCorrection& c = camera.depth_correction; c.any())
        object["depth_correction"] = {{"scale", c.scale}, {"offset_m", c.offset_m}, {"curve_per_m", c.curve_per_m}};
    if (camera.pose_time_offset_s != 0)
        object["pose_time_offset_s"] = camera.pose_time_offset_s;
    if (camera.colour) {
        object["colour"] = as_object(camera.colour->camera);
        const Eigen::Matrix4d matrix = camera.colour->colour_from_depth.matrix();
        for (int row = 0; row < 4; ++row)
            object["colour"]["colour_from_depth"].push_back(
                {matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
    }
    if (!details.empty())
        object["refinement"] = nlohmann::ordered_json::parse(details);
    return object.dump(2) + "\n";
}

std::string camera_as_open3d(const Camera& camera) {
    if (camera.distortion.any())
        throw Error("Open3D's format has no lens distortion; write another format, or undistort first");
    const auto& [fx, fy, cx, cy, size] = camera.pinhole;
    const nlohmann::ordered_json object{
        {"width", size.width},
        {"height", size.height},
        {"intrinsic_matrix", {fx, 0.0, 0.0, 0.0, fy, 0.0, cx, cy, 1.0}}}; // column by column
    return object.dump(2) + "\n";
}

} // namespace scanshade
