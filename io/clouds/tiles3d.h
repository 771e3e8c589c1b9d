// Clouds as 3D Tiles 1.1 (OGC 22-025r4), for globes and web pages: an octree of binary glTF, coarse points first.
#pragma once

#include "io/clouds/cloud_file.h"

#include <cstddef>
#include <Eigen/Geometry>
#include <filesystem>
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

} // namespace scanshade
