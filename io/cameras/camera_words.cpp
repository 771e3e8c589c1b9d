// Cameras as JSON of others: where in it the camera is, and its keys in our words.
#include "io/cameras/camera_formats.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::json;

/// "focal_length-X": focallengthx.
std::string plain(std::string_view key) {
    std::string text;
    for (const char c : key)
        if (std::isalnum(static_cast<unsigned char>(c)) != 0)
            text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

struct Word {
    std::string_view theirs; ///< plain()
    std::string_view ours;
};
constexpr std::array number_words{Word{"fx", "fx"},
                                  Word{"flx", "fx"},
                                  Word{"focalx", "fx"},
                                  Word{"focallengthx", "fx"},
                                  Word{"fy", "fy"},
                                  Word{"fly", "fy"},
                                  Word{"focaly", "fy"},
                                  Word{"focallengthy", "fy"},
                                  Word{"cx", "cx"},
                                  Word{"ppx", "cx"},
                                  Word{"centerx", "cx"},
                                  Word{"principalpointx", "cx"},
                                  Word{"cy", "cy"},
                                  Word{"ppy", "cy"},
                                  Word{"centery", "cy"},
                                  Word{"principalpointy", "cy"},
                                  Word{"width", "width"},
                                  Word{"w", "width"},
                                  Word{"imagewidth", "width"},
                                  Word{"height", "height"},
                                  Word{"h", "height"},
                                  Word{"imageheight", "height"},
                                  Word{"depthmapfactor", "depthmapfactor"},
                                  Word{"depthscale", "depth_scale"},
                                  Word{"pngdepthscale", "png_depth_scale"},
                                  Word{"depthfactor", "depth_factor"},
                                  Word{"integerdepthscale", "integer_depth_scale"},
                                  Word{"depthunitscalefactor", "depth_unit_scale_factor"}};
/// Matrices and lenses, as lists or objects.
constexpr std::array list_words{Word{"k", "K"},
                                Word{"cameramatrix", "camera_matrix"},
                                Word{"intrinsics", "intrinsics"},
                                Word{"intrinsic", "intrinsic"},
                                Word{"cameraintrinsics", "intrinsics"},
                                Word{"d", "D"},
                                Word{"coeffs", "coeffs"},
                                Word{"dist", "dist"},
                                Word{"distcoeffs", "dist_coeffs"},
                                Word{"distortion", "distortion"},
                                Word{"distortioncoeffs", "distortion_coefficients"},
                                Word{"distortioncoefficients", "distortion_coefficients"}};
/// Two numbers in one list, the same number twice, or an object of both.
struct Pair {
    std::string_view theirs; ///< plain()
    const char *first, *second;
};
constexpr std::array pair_words{Pair{"focallength", "fx", "fy"},
                                Pair{"focal", "fx", "fy"},
                                Pair{"f", "fx", "fy"},
                                Pair{"principalpoint", "cx", "cy"},
                                Pair{"center", "cx", "cy"},
                                Pair{"c", "cx", "cy"},
                                Pair{"imagesize", "width", "height"},
                                Pair{"resolution", "width", "height"},
                                Pair{"imageresolution", "width", "height"},
                                Pair{"size", "width", "height"}};

/// Numbers that others put into quotes.
Json as_number(const Json& value) {
    if (!value.is_string())
        return value;
    const auto found = number(trimmed(value.get_ref<const std::string&>()));
    return found && std::isfinite(*found) ? Json(*found) : value;
}

bool is_number_list(const Json& value, std::size_t count) {
    return value.is_array() && value.size() == count &&
           std::ranges::all_of(value, [](const Json& entry) { return entry.is_number(); });
}

/// Adds what `value` gives to `object`, unless that has it. False where it gives no two numbers.
bool take_pair(const Json& value, const Pair& pair, Json& object) {
    if (object.contains(pair.first) || object.contains(pair.second))
        return false;
    if (value.is_number() && std::string_view(pair.first) == "fx")
        object[pair.first] = object[pair.second] = value;
    else if (is_number_list(value, 2)) {
        object[pair.first] = value[0];
        object[pair.second] = value[1];
    } else if (value.is_object() && value.contains(pair.first) && value.contains(pair.second)) {
        object[pair.first] = value[pair.first];
        object[pair.second] = value[pair.second];
    } else
        return false;
    return true;
}

/// The same object by our names of its keys. Ours, where they are there, count before others.
Json renamed(const Json& theirs) {
    Json ours = Json::object(), others = Json::object();
    for (const auto& [key, value] : theirs.items()) {
        const std::string name = plain(key);
        const auto* const single = std::ranges::find(number_words, name, &Word::theirs);
        const auto* const list = std::ranges::find(list_words, name, &Word::theirs);
        const Json content = single != number_words.end() ? as_number(value) : value;
        const bool fits = single != number_words.end()
                              ? !content.is_structured()
                              : list != list_words.end() && value.is_structured() && !value.empty();
        const std::string word(!fits                          ? std::string_view(key)
                               : single != number_words.end() ? single->ours
                                                              : list->ours);
        (word == key || theirs.contains(word) || ours.contains(word) ? others[key] : ours[word]) = content;
    }
    for (const auto& [key, value] : others.items())
        if (!ours.contains(key))
            ours[key] = value;
    for (const auto& [key, value] : theirs.items())
        if (const auto* const pair = std::ranges::find(pair_words, plain(key), &Pair::theirs);
            pair != pair_words.end() && take_pair(value, *pair, ours))
            ours.erase(key);
    return ours;
}

bool holds_camera(const Json& object) {
    return object.contains("fx") || object.contains("intrinsic_matrix") ||
           std::ranges::any_of(
               std::array{"K", "camera_matrix", "cameraMatrix", "intrinsics", "intrinsic"}, [&](const char* key) {
                   return object.contains(key) &&
                          (object[key].is_array() || (object[key].is_object() && object[key].contains("data")));
               });
}

struct Found {
    std::string path;
    Json camera;
};

/// All cameras in `value`, each with the numbers that stand around it: a size, a unit of depth.
void find_cameras(const Json& value, const std::string& path, const Json& around, std::vector<Found>& found) {
    if (value.is_array()) {
        for (std::size_t i = 0; i < value.size(); ++i)
            if (value[i].is_object())
                find_cameras(value[i], fmt::format("{}[{}]", path, i), around, found);
        return;
    }
    Json object = renamed(value);
    for (const auto& [key, number] : around.items())
        if (!object.contains(key))
            object[key] = number;
    if (holds_camera(object)) {
        found.push_back({path, std::move(object)});
        return;
    }
    Json numbers_here = Json::object();
    constexpr std::size_t enough = 100; // many numbers about many objects would take long
    for (const auto& [key, entry] : object.items())
        if (entry.is_number() && numbers_here.size() < enough)
            numbers_here[key] = entry;
    for (const auto& [key, entry] : value.items())
        if (entry.is_structured())
            find_cameras(entry, path.empty() ? key : path + "." + key, numbers_here, found);
}

bool same_camera(const Json& a, const Json& b) {
    return std::ranges::all_of(
        std::array{"fx", "fy", "cx", "cy", "intrinsic_matrix", "K", "camera_matrix", "intrinsics", "intrinsic"},
        [&](const char* key) { return a.value(key, Json()) == b.value(key, Json()); });
}

/// The camera of depth among several; null where they do not say which it is.
const Found* of_depth(const std::vector<Found>& cameras) {
    if (std::ranges::all_of(cameras, [&](const Found& one) { return same_camera(one.camera, cameras[0].camera); }))
        return cameras.data();
    const Found* chosen = nullptr;
    for (const Found& one : cameras)
        if (plain(one.path).find("depth") != std::string::npos) {
            if (chosen)
                return nullptr;
            chosen = &one;
        }
    return chosen;
}

[[noreturn]] void refuse_without_camera(const fs::path& file, const Json& root) {
    if (root.contains("CalibrationInformation"))
        refuse_camera(file, "Azure Kinect's calibration, whose camera depends on the mode of a recording: it is read "
                            "from the .mkv. Give --camera fx,fy,cx,cy, or Open3D's intrinsic.json");
    if (root.contains("camera_angle_x"))
        refuse_camera(file, "\"camera_angle_x\" alone is no camera: give the folder of this transforms.json as the "
                            "capture, or --camera fx,fy,cx,cy");
    std::vector<std::string> keys;
    constexpr std::size_t most = 6;
    for (const auto& [key, value] : root.items())
        if (keys.size() < most)
            keys.push_back(in_quotes(key));
    refuse_camera(file, fmt::format("\"intrinsic_matrix\" (Open3D's layout) and \"fx\" (ours) are both missing{}{}{}",
                                    keys.empty() ? "" : "; it has ", fmt::join(keys, ", "),
                                    root.size() > most ? " ..." : ""));
}

} // namespace

Json in_our_words(const fs::path& file, const Json& root, std::vector<std::string>& warnings) {
    std::vector<Found> cameras;
    find_cameras(root, "", Json::object(), cameras);
    if (cameras.empty())
        refuse_without_camera(file, root);
    const Found* const chosen = of_depth(cameras);
    if (!chosen) {
        std::vector<std::string> paths;
        constexpr std::size_t most = 4;
        for (const Found& one : cameras)
            if (paths.size() < most)
                paths.push_back(in_quotes(one.path));
        refuse_camera(file, fmt::format("{} cameras ({}{}), and which took the depth is not said: put it into a file "
                                        "of its own, or give --camera fx,fy,cx,cy",
                                        cameras.size(), fmt::join(paths, ", "), cameras.size() > most ? " ..." : ""));
    }
    if (!chosen->path.empty())
        warnings.push_back(fmt::format("{}: the camera in {} is used{}.", file.string(), in_quotes(chosen->path),
                                       cameras.size() > 1 ? fmt::format(", of {} there", cameras.size()) : ""));
    Json camera = chosen->camera;
    const bool from_corners = root.contains("fl_x"); // as nerfstudio counts pixels
    for (const char* key : {"cx", "cy"})
        if (from_corners && camera.contains(key) && camera[key].is_number())
            camera[key] = camera[key].get<double>() - 0.5;
    return camera;
}

} // namespace scanshade
