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
    std::filesystem::path capture; ///< of a run: its input, from the manifest; of truth: the capture itself
    std::map<std::string, std::filesystem::path> confidence; ///< of a run: the confidence maps of `files`
    std::string sensor;             ///< of a generated capture: the one simulated, where its truth.json says
    std::optional<double> radius_m; ///< the method's or the truth's, where known
};

/// A folder with ao/ or clouds/ is a run, one with truth/ a generated capture; of other folders the images are taken,
/// or where there are none, the clouds. A file is a single map or cloud. Throws Error naming the path where it does not
/// exist or holds no map.
[[nodiscard]] MapSet find_maps(const std::filesystem::path& path);

/// The truth of the capture that `run` was made from. Throws Error where the run does not name the capture or it has no
/// truth.
[[nodiscard]] MapSet truth_of(const MapSet& run);

/// One view in both sets.
struct MapPair {
    std::string name;
    std::filesystem::path a, b;
};

/// Pairs by name, in the order of names. Two single maps are a pair whatever their names. Throws Error, with names of
/// both sides, where there is no pair.
[[nodiscard]] std::vector<MapPair> paired(const MapSet& a, const MapSet& b);

} // namespace scanshade
