#include "apps/compare/map_set.h"

#include "apps/json.h"
#include "io/clouds/format.h"
#include "io/images/image_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <array>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

bool holds_map(const fs::path& file) { return has_ao_extension(file); }
bool holds_cloud(const fs::path& file) { return has_cloud_extension(file); }

std::map<std::string, fs::path> maps_in(const fs::path& folder, bool (*holds)(const fs::path&) = holds_map) {
    std::map<std::string, fs::path> files;
    if (!fs::is_directory(folder))
        return files;
    for (const auto& entry : fs::directory_iterator(folder)) {
        const fs::path& file = entry.path();
        if (!fs::is_regular_file(file) || file.filename().string().starts_with('.') || !holds(file))
            continue;
        const auto [there, fresh] = files.emplace(entry.path().stem().string(), entry.path());
        if (!fresh)
            throw Error(fmt::format("{}: {} and {} are maps of the same name; remove one of them", folder.string(),
                                    there->second.filename().string(), entry.path().filename().string()));
    }
    return files;
}

std::map<std::string, fs::path> maps_or_clouds(const fs::path& maps, const fs::path& clouds) {
    std::map<std::string, fs::path> files = maps_in(maps);
    return files.empty() ? maps_in(clouds, holds_cloud) : files;
}

json read_json(const fs::path& file) {
    json text = parsed_or_discarded(read_bytes(file));
    if (text.is_discarded())
        throw Error(file.string() + ": not JSON");
    return text;
}

/// The value at a path of keys, if it exists and has that type.
template <class Value>
std::optional<Value> at(const json& text, std::initializer_list<std::string> keys) {
    const json* place = &text;
    for (const std::string& key : keys) {
        if (!place->is_object() || !place->contains(key))
            return std::nullopt;
        place = &(*place)[key];
    }
    if (std::is_arithmetic_v<Value> ? !place->is_number() : !place->is_string())
        return std::nullopt;
    return place->get<Value>();
}

void learn_from_manifest(MapSet& set) {
    const fs::path file = set.path / "manifest.json";
    if (!fs::exists(file))
        return;
    const json manifest = read_json(file);
    if (const auto path = at<std::string>(manifest, {"capture", "path"}))
        set.capture = *path;
    if (const auto method = at<std::string>(manifest, {"method"}))
        set.radius_m = at<double>(manifest, {"settings", "method " + *method, *method + ".radius"});
}

void learn_from_truth(MapSet& set) {
    set.capture = set.path;
    const fs::path file = set.path / "truth/truth.json";
    if (!fs::exists(file))
        return;
    const json note = read_json(file);
    set.radius_m = at<double>(note, {"radius_m"});
    set.sensor = at<std::string>(note, {"sensor"}).value_or("");
}

std::string some_names(const MapSet& set) {
    std::string names;
    int shown = 0;
    for (const auto& [name, file] : set.files) {
        if (shown++ == 3)
            return names + ", ...";
        names += (names.empty() ? "" : ", ") + name;
    }
    return names;
}

} // namespace

MapSet find_maps(const fs::path& path) {
    MapSet set{path, "", {}, {}, {}, {}, {}};
    if (fs::is_directory(path / "ao") || fs::is_directory(path / "clouds")) {
        set.kind = "run";
        set.files = maps_or_clouds(path / "ao", path / "clouds");
        set.confidence = maps_in(path / "confidence");
        learn_from_manifest(set);
    } else if (fs::is_directory(path / "truth")) {
        set.kind = "truth";
        set.files = maps_or_clouds(path / "truth/ao", path / "truth");
        learn_from_truth(set);
    } else if (fs::is_directory(path)) {
        set.kind = "folder";
        set.files = maps_or_clouds(path, path);
    } else if (fs::is_regular_file(path)) {
        set.kind = "map";
        set.files.emplace(path.stem().string(), path);
    } else {
        throw Error(fmt::format(
            "{}: not there; a run's output, a folder of maps, a map or a generated capture expected", path.string()));
    }
    if (set.files.empty())
        throw Error(fmt::format("{}: no maps found (.png, .tiff or .exr expected), and no clouds", path.string()));
    return set;
}

MapSet truth_of(const MapSet& run) {
    if (run.capture.empty())
        throw Error(
            fmt::format("{}: no manifest.json says which capture it was made from; name the truth as second PATH",
                        run.path.string()));
    if (!fs::is_directory(run.capture / "truth"))
        throw Error(fmt::format("{}: made from {}, which has no truth (generated captures have)", run.path.string(),
                                run.capture.string()));
    return find_maps(run.capture);
}

std::vector<MapPair> paired(const MapSet& a, const MapSet& b) {
    if (a.kind == "map" && b.kind == "map")
        return {{a.files.begin()->first, a.files.begin()->second, b.files.begin()->second}};
    std::vector<MapPair> pairs;
    for (const auto& [name, file] : a.files)
        if (const auto other = b.files.find(name); other != b.files.end())
            pairs.push_back({name, file, other->second});
    if (pairs.empty())
        throw Error(fmt::format("no map of {} has the name of one of {} ({} against {})", a.path.string(),
                                b.path.string(), some_names(a), some_names(b)));
    return pairs;
}

} // namespace scanshade
