// WebDataset's samples: KEY.depth.png, KEY.rgb.jpg and KEY.json beside each other, in a tar or unpacked. A key ends at
// the name's first dot.
#include "io/captures/listing/layouts.h"

#include "io/captures/listing/trajectory.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

struct Sample {
    std::string colour, depth; ///< the parts of their names after the key
    bool json = false;
};

bool is_one_of(std::string_view part, std::initializer_list<std::string_view> names) {
    return std::ranges::count(names, part) > 0;
}

/// "0001.depth.png" -> ".depth.png" belongs to "0001".
void take_part(Sample& sample, const std::string& ending) {
    const fs::path whole = "x" + ending;
    const std::string part = whole.stem().string(); // "x.depth"
    if (ending == ".json")
        sample.json = true;
    else if (is_one_of(part, {"x.depth", "x.depth_map", "x.depthmap"}) && has_depth_extension(whole))
        sample.depth = ending;
    else if (has_colour_extension(whole) && (is_one_of(part, {"x.rgb", "x.color", "x.colour", "x.image", "x.img"}) ||
                                             (part == "x" && sample.colour.empty()))) // KEY.jpg
        sample.colour = ending;
}

/// Numbers of lists in lists, one after the other; none for anything else.
void flatten(const Json& value, std::vector<double>& numbers, int levels = 3) {
    constexpr std::size_t most = 32;
    if (value.is_number())
        numbers.push_back(value.get<double>());
    else if (value.is_array() && levels > 0)
        for (const Json& each : value)
            if (numbers.size() < most)
                flatten(each, numbers, levels - 1);
}

/// The first of these keys that is there, and its numbers.
struct Found {
    const char* key = nullptr;
    std::vector<double> numbers;
};
Found first_of(const Json& facts, std::initializer_list<const char*> keys) {
    for (const char* key : keys)
        if (const auto at = facts.find(key); at != facts.end() && !at->is_null()) {
            Found found{key, {}};
            flatten(*at, found.numbers);
            return found;
        }
    return {};
}

std::optional<double> number_at(const Json& facts, std::initializer_list<const char*> keys) {
    const Found found = first_of(facts, keys);
    return found.key && found.numbers.size() == 1 ? std::optional(found.numbers[0]) : std::nullopt;
}

/// fx, fy, cx, cy of a matrix of 9, a list of 4, or keys of their own, at the top or in "camera".
std::optional<Camera> camera_of(const Json& facts, const fs::path& file) {
    Camera camera;
    camera.origin = file.string();
    const auto of_its_own = facts.find("camera");
    const Json& inner = of_its_own != facts.end() && of_its_own->is_object() ? *of_its_own : facts;
    const auto fx = number_at(inner, {"fx", "fl_x"}), fy = number_at(inner, {"fy", "fl_y"}),
               cx = number_at(inner, {"cx"}), cy = number_at(inner, {"cy"});
    if (fx && fy && cx && cy) {
        camera.pinhole = {*fx, *fy, *cx, *cy, {}};
    } else {
        const Found k = first_of(facts, {"K", "intrinsics", "intrinsic", "camera_matrix", "intrinsic_matrix", "cam_K"});
        if (!k.key)
            return std::nullopt;
        if (k.numbers.size() == 9)
            camera.pinhole = {k.numbers[0], k.numbers[4], k.numbers[2], k.numbers[5], {}};
        else if (k.numbers.size() == 4)
            camera.pinhole = {k.numbers[0], k.numbers[1], k.numbers[2], k.numbers[3], {}};
        else
            throw Error(fmt::format("{}: \"{}\" has {}, expected 9 of a matrix or fx, fy, cx, cy", file.string(), k.key,
                                    counted(k.numbers.size(), "number")));
    }
    const Found lens = first_of(inner, {"distortion"});
    if (lens.numbers.size() == 5)
        camera.distortion = {lens.numbers[0], lens.numbers[1], lens.numbers[2], lens.numbers[3], lens.numbers[4]};
    else if (lens.key || inner.contains("fisheye"))
        throw Error(file.string() + ": a lens other than \"distortion\": [k1, k2, p1, p2, k3]; give --camera");
    const auto width = number_at(inner, {"width", "w"}), height = number_at(inner, {"height", "h"});
    if (width && height)
        camera.pinhole.size = image_size(*width, *height, file.string());
    return camera;
}

/// Which pose a JSON file may have, and whether that has to be turned round.
struct PoseKey {
    const char* key;
    bool camera_from_world = false;
    bool says_so = true;
};
constexpr std::array pose_keys = {PoseKey{"world_from_camera"},
                                  PoseKey{"camera_to_world"},
                                  PoseKey{"cam2world"},
                                  PoseKey{"c2w"},
                                  PoseKey{"T_world_camera"},
                                  PoseKey{"camera_from_world", true},
                                  PoseKey{"world_to_camera", true},
                                  PoseKey{"world2cam", true},
                                  PoseKey{"w2c", true},
                                  PoseKey{"pose", false, false},
                                  PoseKey{"camera_pose", false, false}};

class Reader {
  public:
    Reader(const fs::path& folder, Capture& capture) : folder_(folder), capture_(capture) {}

    CaptureEntry entry(const std::string& key, const Sample& sample) {
        CaptureEntry entry;
        entry.name = key;
        entry.depth = (folder_ / (key + sample.depth)).string();
        if (!sample.colour.empty())
            entry.colour = (folder_ / (key + sample.colour)).string();
        if (!sample.json)
            return entry;
        const fs::path file = folder_ / (key + ".json");
        try {
            const Json facts = json_in(file);
            if (!facts.is_object())
                throw Error(file.string() + ": no JSON object");
            take(facts, file, entry);
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            entry.problem = failure.what();
        }
        return entry;
    }

  private:
    void take(const Json& facts, const fs::path& file, CaptureEntry& entry) {
        if (auto camera = camera_of(facts, file)) {
            // The same camera is not kept, and its size not asked for, once for each of a million frames.
            if (!shared_ || !same(*camera, last_)) {
                last_ = *camera;
                const cv::Size depth = peek_size(entry.depth);
                shared_ = camera_for_depth(*camera, camera->pinhole.size.empty() ? depth : camera->pinhole.size, depth);
            }
            entry.camera = shared_;
        }
        if (const auto scale = number_at(facts, {"depth_units_per_metre", "depth_scale"})) {
            if (!(*scale > 0) || !std::isfinite(*scale))
                throw Error(fmt::format("{}: a depth scale of {}, expected units per metre", file.string(), *scale));
            // Below 1 it must be metres per unit.
            entry.depth_units_per_metre = *scale < 1 ? 1 / *scale : *scale;
        }
        entry.stamp_s = number_at(facts, {"stamp_s", "timestamp_s", "timestamp"});
        for (const PoseKey& row : pose_keys) {
            const Found found = first_of(facts, {row.key});
            if (!found.key)
                continue;
            if (!row.says_so && !std::exchange(guessed_, true))
                capture_.warnings.push_back(
                    fmt::format("{}: \"{}\" is taken as camera to world, with x right, y down, z forward; it "
                                "does not say.",
                                file.string(), row.key));
            take_pose(found, row.camera_from_world, file, entry);
            return;
        }
    }

    static bool same(const Camera& a, const Camera& b) {
        return a.pinhole == b.pinhole && a.distortion == b.distortion;
    }

    static void take_pose(const Found& found, bool camera_from_world, const fs::path& file, CaptureEntry& entry) {
        const std::string where = fmt::format("{}: \"{}\"", file.string(), found.key);
        if (found.numbers.size() != 12 && found.numbers.size() != 16) {
            entry.warnings.push_back(fmt::format("{} has {}, expected 12 or 16 of a matrix; no pose.", where,
                                                 counted(found.numbers.size(), "number")));
            return;
        }
        Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
        for (std::size_t i = 0; i < found.numbers.size(); ++i)
            matrix(static_cast<int>(i / 4), static_cast<int>(i % 4)) = found.numbers[i];
        MatrixPose pose = checked_pose(matrix, where);
        entry.world_from_camera = pose.world_from_camera;
        if (camera_from_world && pose.world_from_camera)
            entry.world_from_camera = pose.world_from_camera->inverse();
        for (std::string* sentence : {&pose.warning, &pose.problem})
            if (!sentence->empty())
                entry.warnings.push_back(std::move(*sentence));
    }

    const fs::path& folder_;
    Capture& capture_;
    bool guessed_ = false;
    Camera last_;
    std::shared_ptr<const Camera> shared_;
};

} // namespace

std::optional<Listing> list_webdataset(const fs::path& folder) {
    std::error_code trouble; // of the layouts, the last ones tell it
    std::map<std::string, Sample, decltype(&natural_less)> samples(&natural_less);
    for (const auto& [name, kind] : items_in(folder, trouble)) {
        const std::size_t dot = name.find('.');
        if (kind != FolderItem::Kind::file || dot == 0 || dot == std::string::npos)
            continue;
        Sample& sample = samples[name.substr(0, dot)];
        take_part(sample, name.substr(dot));
    }
    std::erase_if(samples, [&](const auto& each) { return each.second.depth.empty(); });
    // 7-Scenes and BundleFusion name theirs so, without JSON.
    const bool scenes = std::ranges::all_of(
        samples, [](const auto& each) { return each.first.starts_with("frame-") && !each.second.json; });
    if (samples.empty() || scenes)
        return std::nullopt;
    Listing listing;
    Capture& capture = listing.capture;
    capture.registration = Registration::yes;
    capture.registration_reason = "images of one sample belong together";
    capture.colour_in_more_pixels = true;
    Reader reader(folder, capture);
    bool cameras = false;
    for (const auto& [key, sample] : samples) {
        capture.entries.push_back(reader.entry(key, sample));
        cameras = cameras || capture.entries.back().camera;
    }
    capture.depth = assumed_encoding(capture.entries.front().depth);
    if (cameras)
        settle_own_cameras(listing);
    else
        listing.find_camera = [folder](cv::Size, std::vector<std::string>& warnings) {
            return camera_in(folder, warnings);
        };
    return listing;
}

} // namespace scanshade
