// Cameras as YAML: OpenCV's own, ROS's camera_info, Kalibr's camchain. (yaml-cpp reads all three, because
// OpenCV's parser never returns from some damaged files.)
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <yaml-cpp/yaml.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

// --- reading ---

YAML::Node parsed(const fs::path& file, const std::string& text) {
    try {
        return YAML::Load(text);
    } catch (const YAML::Exception& failure) {
        throw Error(fmt::format("{}: not YAML: {}", at_line(file, failure.mark.line + 1), failure.msg));
    }
}

/// The same as JSON. Refuses what aliases make endless.
nlohmann::json as_json(const fs::path& file, const YAML::Node& node, std::size_t& left, int depth = 0) {
    constexpr int deepest = 16;
    if (left-- == 0 || depth > deepest)
        refuse_camera(file, "nested too deep, or too many values for a camera");
    if (node.IsScalar()) {
        const auto value = number(node.Scalar());
        return value && std::isfinite(*value) ? nlohmann::json(*value) : nlohmann::json(as_utf8(node.Scalar()));
    }
    nlohmann::json json = node.IsMap() ? nlohmann::json::object() : nlohmann::json::array();
    for (const auto& entry : node)
        if (node.IsMap() && entry.first.IsScalar())
            json[as_utf8(entry.first.Scalar())] = as_json(file, entry.second, left, depth + 1);
        else if (node.IsSequence())
            json.push_back(as_json(file, entry, left, depth + 1));
    return json;
}
nlohmann::json as_json(const fs::path& file, const YAML::Node& node) {
    std::size_t most_values = 100000;
    return as_json(file, node, most_values);
}

/// The numbers that stand in a map itself: what else it says than a camera.
nlohmann::json numbers_in(const YAML::Node& node) {
    nlohmann::json found = nlohmann::json::object();
    for (const auto& entry : node)
        if (entry.first.IsScalar() && entry.second.IsScalar())
            if (const auto value = number(entry.second.Scalar()); value && std::isfinite(*value))
                found[as_utf8(entry.first.Scalar())] = *value;
    return found;
}

/// The key's plain value; "" where there is none.
std::string word_of(const YAML::Node& parent, const std::string& key) {
    const YAML::Node node = parent[key];
    return node.IsDefined() && node.IsScalar() ? node.Scalar() : "";
}

double number_of(const YAML::Node& node) {
    return node.IsScalar() ? number(node.Scalar()).value_or(std::nan("")) : std::nan("");
}

/// The first of these keys that is there, or the first one.
std::string first_of(const YAML::Node& root, std::initializer_list<const char*> keys) {
    const auto* const found = std::ranges::find_if(keys, [&](const char* key) { return root[key].IsDefined(); });
    return found == keys.end() ? *keys.begin() : *found;
}

/// OpenCV's samples and programs after them name the same things in several ways.
std::string matrix_key(const YAML::Node& root) {
    return first_of(root, {"camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "K", "k", "M1"});
}
std::string lens_key(const YAML::Node& root) {
    return first_of(root, {"distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "DistCoeffs",
                           "dist_coeffs", "distortion_coeffs", "D", "d", "D1"});
}

/// Numbers of a list, or of a matrix given as rows, cols, data.
std::vector<double> numbers_of(const fs::path& file, const YAML::Node& parent, const std::string& key) {
    const YAML::Node node = parent[key];
    if (!node.IsDefined())
        refuse_camera(file, fmt::format("\"{}\" is missing", key));
    const YAML::Node list = node.IsMap() ? node["data"] : node;
    if (!list.IsDefined() || !list.IsSequence())
        refuse_camera(file, fmt::format("\"{}\" is not a list of numbers", key));
    std::vector<double> values;
    for (const YAML::Node& entry : list) {
        values.push_back(number_of(entry));
        if (!std::isfinite(values.back()))
            refuse_camera(file, fmt::format("\"{}\": value {} is not a finite number", key, values.size()));
    }
    return values;
}

std::vector<double> numbers_of(const fs::path& file, const YAML::Node& parent, const std::string& key,
                               std::size_t count) {
    auto values = numbers_of(file, parent, key); // not const: it is moved out
    if (values.size() != count)
        refuse_camera(file, fmt::format("\"{}\" has {}, expected {}", key, counted(values.size(), "number"), count));
    return values;
}

cv::Size checked_size(const fs::path& file, double width, double height) {
    if (!(width >= 1 && width <= widest_image && height >= 1 && height <= widest_image))
        refuse_camera(file, fmt::format("{}x{} is no image size", width, height));
    return {static_cast<int>(width), static_cast<int>(height)};
}

Pinhole from_matrix(const fs::path& file, const std::vector<double>& m) {
    if (m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
        refuse_camera(file,
                      "\"camera_matrix\" is not a camera matrix stored by rows: expected fx 0 cx, 0 fy cy, 0 0 1");
    if (m[1] != 0)
        refuse_camera(file, fmt::format("\"camera_matrix\" has skew {}, a pinhole camera here has none", m[1]));
    const Pinhole pinhole{m[0], m[4], m[2], m[5], {}};
    check_numbers(file, pinhole,
                  {"\"camera_matrix\" fx", "\"camera_matrix\" fy", "\"camera_matrix\" cx", "\"camera_matrix\" cy"});
    return pinhole;
}

Distortion fisheye(const fs::path& file, const std::string& key, const std::vector<double>& k) {
    if (k.size() != 4)
        refuse_camera(file, fmt::format("\"{}\" has {}, expected 4 of a fisheye", key, counted(k.size(), "number")));
    return kannala_brandt(k);
}

/// k1 k2 p1 p2 [k3 [k4 k5 k6 ...]]: coefficients after k6 must be zero.
Distortion polynomial(const fs::path& file, const std::string& key, const std::vector<double>& k) {
    for (std::size_t i = 8; i < k.size(); ++i)
        if (k[i] != 0)
            refuse_camera(file, fmt::format("\"{}\" number {} is {}: thin-prism and tilted lenses are not supported",
                                            key, i + 1, k[i]));
    if (k.size() != 4 && k.size() != 5 && k.size() != 8 && k.size() != 12 && k.size() != 14 && !k.empty())
        refuse_camera(file, fmt::format("\"{}\" has {}, expected 4, 5 or 8 (k1 k2 p1 p2 k3 k4 k5 k6)", key,
                                        counted(k.size(), "number")));
    return brown_conrady(k);
}

/// OpenCV's and ROS's: both say camera_matrix and distortion_coefficients.
CameraFile from_matrices(const fs::path& file, const YAML::Node& root) {
    CameraFile result;
    result.camera.pinhole = from_matrix(file, numbers_of(file, root, matrix_key(root), 9));
    const std::string width = word_of(root, first_of(root, {"image_width", "image_Width", "width"})),
                      height = word_of(root, first_of(root, {"image_height", "image_Height", "height"}));
    if (!width.empty() || !height.empty())
        result.camera.pinhole.size = checked_size(file, number(width).value_or(0), number(height).value_or(0));
    const std::string key = lens_key(root);
    if (!root[key].IsDefined())
        return result;
    const std::string said = word_of(root, "distortion_model"), model = said.empty() ? "plumb_bob" : said;
    const bool flagged = number(word_of(root, "fisheye_model")).value_or(0) != 0;
    if (model != "plumb_bob" && model != "rational_polynomial" && model != "equidistant" && model != "fisheye")
        refuse_camera(file,
                      fmt::format("\"distortion_model\" is {}, expected plumb_bob, rational_polynomial or equidistant",
                                  in_quotes(model)));
    const auto numbers = numbers_of(file, root, key);
    const bool is_fisheye = flagged || model == "equidistant" || model == "fisheye";
    result.camera.distortion = is_fisheye ? fisheye(file, key, numbers) : polynomial(file, key, numbers);
    return result;
}

/// One camera of a camchain.
Camera of_chain(const fs::path& file, const YAML::Node& node) {
    if (!node.IsMap())
        refuse_camera(file, "\"cam0\" or \"cam1\" is not a map of keys and values");
    const std::string model = word_of(node, "camera_model");
    if (model != "pinhole")
        refuse_camera(file, fmt::format("\"camera_model\" is {}, expected pinhole", in_quotes(model)));
    const auto k = numbers_of(file, node, "intrinsics", 4);
    Camera camera{{k[0], k[1], k[2], k[3], {}}, {}, {}};
    check_numbers(file, camera.pinhole,
                  {"\"intrinsics\" fx", "\"intrinsics\" fy", "\"intrinsics\" cx", "\"intrinsics\" cy"});
    const auto size = numbers_of(file, node, "resolution", 2);
    camera.pinhole.size = checked_size(file, size[0], size[1]);
    const std::string said = word_of(node, "distortion_model"), lens = said.empty() ? "none" : said;
    const std::string key = node["distortion_coeffs"].IsDefined() ? "distortion_coeffs" : lens_key(node);
    if (lens == "equidistant")
        camera.distortion = fisheye(file, key, numbers_of(file, node, key));
    else if (lens == "radtan" || lens == "radial-tangential")
        camera.distortion = polynomial(file, key, numbers_of(file, node, key));
    else if (lens != "none")
        refuse_camera(file,
                      fmt::format("\"distortion_model\" is {}, expected radtan, equidistant or none", in_quotes(lens)));
    return camera;
}

Eigen::Isometry3d pose_in_chain(const fs::path& file, const YAML::Node& node) {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
    bool whole = node.IsSequence() && node.size() == 4;
    for (std::size_t row = 0; row < 4 && whole; ++row) {
        const YAML::Node values = node[row];
        whole = values.IsSequence() && values.size() == 4;
        for (std::size_t column = 0; column < 4 && whole; ++column)
            matrix(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) = number_of(values[column]);
    }
    if (!whole || !matrix.allFinite())
        refuse_camera(file, "\"T_cn_cnm1\" is not 4 rows of 4 numbers");
    return rigid_from(file, matrix, "T_cn_cnm1");
}

/// cam0 is the depth camera; a cam1 with a pose is the secondary camera, which took the colour.
CameraFile from_camchain(const fs::path& file, const YAML::Node& root) {
    CameraFile result;
    result.camera = of_chain(file, root["cam0"]);
    if (const YAML::Node secondary = root["cam1"]; secondary.IsDefined()) {
        if (!secondary.IsMap() || !secondary["T_cn_cnm1"].IsDefined()) {
            result.warnings.push_back(file.string() + ": more than one camera; cam0 is used.");
        } else {
            result.colour = ColourCamera{of_chain(file, secondary), pose_in_chain(file, secondary["T_cn_cnm1"])};
            result.warnings.push_back(file.string() +
                                      ": cam0 is taken as the depth camera, cam1 as the colour camera.");
        }
    }
    return result;
}

// --- writing ---

std::string list(const std::vector<double>& values) { return fmt::format("[{}]", fmt::join(values, ", ")); }

std::string matrix(const char* name, const char* type, int rows, int columns, const std::vector<double>& values) {
    return fmt::format("{}:{}\n  rows: {}\n  cols: {}\n{}  data: {}\n", name, *type ? " !!opencv-matrix" : "", rows,
                       columns, type, list(values));
}

std::vector<double> camera_matrix(const Pinhole& p) { return {p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1}; }

} // namespace

CameraFile camera_from_yaml(const fs::path& file, const std::string& text) {
    const YAML::Node root = parsed(file, text);
    if (!root.IsMap())
        refuse_camera(file, "not a map of keys and values");
    try {
        if (root[matrix_key(root)].IsDefined()) {
            CameraFile result = from_matrices(file, root);
            use_other_keys(file, numbers_in(root), result);
            return result;
        }
        if (root["cam0"].IsDefined()) {
            CameraFile result = from_camchain(file, root);
            use_other_keys(file, numbers_in(root["cam0"]), result);
            return result;
        }
        if (root["intrinsics"].IsDefined() && root["resolution"].IsDefined()) { // EuRoC's sensor.yaml: one of a chain
            CameraFile result;
            result.camera = of_chain(file, root);
            use_other_keys(file, numbers_in(root), result);
            return result;
        }
        std::vector<std::string> warnings;
        if (const nlohmann::json object = as_json(file, root); object.dump().find("\"fx\"") != std::string::npos) {
            CameraFile result = camera_from_keys(file, in_our_words(file, object, warnings));
            result.warnings.insert(result.warnings.begin(), warnings.begin(), warnings.end());
            return result;
        }
    } catch (const YAML::Exception& failure) { // a node of the wrong kind
        refuse_camera(file, failure.msg);
    }
    refuse_camera(file, "\"camera_matrix\" (OpenCV, ROS) and \"cam0\" (Kalibr) are both missing");
}

std::string camera_as_opencv(const Camera& camera, const CameraQuality& quality) {
    const Pinhole& p = camera.pinhole;
    const char* type = "  dt: d\n";
    const auto k = coefficients(camera.distortion);
    std::string text = fmt::format("%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n", p.size.width, p.size.height);
    text += matrix("camera_matrix", type, 3, 3, camera_matrix(p));
    if (camera.distortion.model == LensModel::kannala_brandt)
        text += "fisheye_model: 1\n";
    text += matrix("distortion_coefficients", type, static_cast<int>(k.size()), 1, k);
    if (std::isfinite(quality.rms_px))
        text += fmt::format("avg_reprojection_error: {}\n", quality.rms_px);
    if (!quality.view_rms_px.empty())
        text += matrix("per_view_reprojection_errors", type, static_cast<int>(quality.view_rms_px.size()), 1,
                       quality.view_rms_px);
    return text;
}

std::string camera_as_ros(const Camera& camera) {
    const Pinhole& p = camera.pinhole;
    const char* model = camera.distortion.model == LensModel::kannala_brandt ? "equidistant"
                        : camera.distortion.rational()                       ? "rational_polynomial"
                                                                             : "plumb_bob";
    const auto k = coefficients(camera.distortion);
    return fmt::format("image_width: {}\nimage_height: {}\ncamera_name: camera\n", p.size.width, p.size.height) +
           matrix("camera_matrix", "", 3, 3, camera_matrix(p)) + fmt::format("distortion_model: {}\n", model) +
           matrix("distortion_coefficients", "", 1, static_cast<int>(k.size()), k) +
           matrix("rectification_matrix", "", 3, 3, {1, 0, 0, 0, 1, 0, 0, 0, 1}) +
           matrix("projection_matrix", "", 3, 4, {p.fx, 0, p.cx, 0, 0, p.fy, p.cy, 0, 0, 0, 1, 0});
}

namespace {

std::string in_chain(const char* name, const Camera& camera) {
    const Pinhole& p = camera.pinhole;
    const Distortion& d = camera.distortion;
    const bool fisheye_lens = d.model == LensModel::kannala_brandt;
    if (!fisheye_lens && (d.k3 != 0 || d.rational()))
        throw Error(fmt::format("Kalibr's radtan lens has no k3 to k6, and this camera has them (k3 {:g}, k4 {:g}, k5 "
                                "{:g}, k6 {:g}); write another format",
                                d.k3, d.k4, d.k5, d.k6));
    auto k = coefficients(d);
    k.resize(4);
    return fmt::format(
        "{}:\n  camera_model: pinhole\n  intrinsics: {}\n  distortion_model: {}\n  distortion_coeffs: {}\n"
        "  resolution: [{}, {}]\n",
        name, list({p.fx, p.fy, p.cx, p.cy}), fisheye_lens ? "equidistant" : "radtan", list(k), p.size.width,
        p.size.height);
}

} // namespace

std::string camera_as_kalibr(const CameraFile& camera) {
    std::string text = in_chain("cam0", camera.camera);
    if (!camera.colour)
        return text;
    text += in_chain("cam1", camera.colour->camera) + "  T_cn_cnm1:\n";
    const Eigen::Matrix4d m = camera.colour->colour_from_depth.matrix();
    for (int row = 0; row < 4; ++row)
        text += fmt::format("  - {}\n", list({m(row, 0), m(row, 1), m(row, 2), m(row, 3)}));
    return text;
}

} // namespace scanshade
