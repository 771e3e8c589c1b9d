// Visibility maps on disk, found by name: a run's output, a generated capture's truth, a folder of maps, or one map.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Maps that belong together. Names are file names without their extension: a frame keeps its name in every run, and a
/// generated capture's truth carries the stamps of its depth images.
struct MapSet {
    std::filesystem::path path; ///< as asked for
    std::string kind;           ///< "run", "truth", "folder" or "map"
    std::map<std::string, std::filesystem::path> files;
    std::filesystem::path
        capture; ///< of a run: what it was made from, as its manifest says; of truth: the capture itself
    std::map<std::string, std::filesystem::path>
        confidence;                 ///< of a run: maps of how far each of `files` can be believed
    std::string sensor;             ///< of a generated capture: the one simulated, where its truth.json says
    std::optional<double> radius_m; ///< the method's or the truth's, where it is said
};

/// A folder with ao/ in it is a run, one with truth/ao/ a generated capture; else its own images are taken; a file is a
/// map by itself. Throws Error naming the path when it is not there or holds no map.
[[nodiscard]] MapSet find_maps(const std::filesystem::path& path);

/// The truth of the capture that `run` was made from. Throws Error where the run does not say or the capture has none.
[[nodiscard]] MapSet truth_of(const MapSet& run);

/// One view in both sets.
struct MapPair {
    std::string name;
    std::filesystem::path a, b;
};

/// Pairs by name, in the order of names; two single maps are a pair whatever they are called. Throws Error, with names
/// of either side, where nothing pairs.
[[nodiscard]] std::vector<MapPair> paired(const MapSet& a, const MapSet& b);

} // namespace scanshade
