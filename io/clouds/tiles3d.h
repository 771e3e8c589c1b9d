// Clouds as 3D Tiles 1.1 (OGC 22-025r4), for globes and web pages: an octree of binary glTF, coarse points first.
#pragma once

#include "io/clouds/cloud_file.h"

#include <cstddef>
#include <Eigen/Geometry>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

struct TilesetOptions {
    std::size_t most_points = 50000; ///< of a tile, unless as many have the same place
    std::size_t most_tiles = 10000;  ///< of a tileset.json; what is below goes into tilesets that it names
};

struct TilesetScene {
    std::string name = {};
    std::span<const Eigen::Vector3d> points = {}; ///< in the tiles' axes, z up
    std::span<const cv::Vec3b> colours = {};      ///< BGR as images store them; one per point
    std::vector<AddedField> fields = {};          ///< names as glTF asks, values finite
    /// The tiles' axes to those of the Earth's centre; none: the cloud has no place on it.
    std::optional<Eigen::Isometry3d> earth_from_tiles = {};
};

/// What became of the scene.
struct TilesWritten {
    std::size_t points = 0, tiles = 0;
    std::size_t left_out = 0;                 ///< points without coordinates
    int levels = 0;                           ///< of the octree
    std::vector<std::filesystem::path> files; ///< in the folder; tileset.json is the first
};

/// Writes tileset.json and the tiles r.glb, r0.glb, r03.glb ... to `folder`, which is replaced as a whole once all are
/// there. Each point is in one tile: children add to their parents (refine ADD). A tile's geometric error is the
/// spacing of its points in the unit of the coordinates, half its parent's; 0 where nothing is below. Positions are
/// floats about the middle of each tile. Throws Error where no point has coordinates, OutOfMemory, and Outage.
TilesWritten write_tiles3d(const std::filesystem::path& folder, const TilesetScene& scene,
                           const TilesetOptions& options = {});

/// The same for a cloud larger than the memory: its points go through files beside the tiles, which take up to 40 bytes
/// each. The tiles are byte for byte those of write_tiles3d().
class LargeTileset {
  public:
    /// As many points as `at_once` are in memory, 80 bytes each.
    LargeTileset(std::filesystem::path folder, TilesetOptions options, std::size_t at_once = 1 << 22);
    ~LargeTileset(); ///< removes what is not finished
    LargeTileset(const LargeTileset&) = delete;
    LargeTileset& operator=(const LargeTileset&) = delete;

    /// The next points. Fields are those of the first call. Throws Outage naming the file.
    void add(const TilesetScene& some);
    /// Once. Throws as write_tiles3d().
    TilesWritten finish(const std::optional<Eigen::Isometry3d>& earth_from_tiles);

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

} // namespace scanshade
