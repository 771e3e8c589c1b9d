// GDAL's virtual rasters (.vrt), read and written.
#pragma once

#include "io/rasters/raster.h"

namespace scanshade::rasters {

/// By its name.
[[nodiscard]] bool is_vrt(const std::filesystem::path& file);
/// As open_raster(). Throws Error, too, for sources that are scaled, changed, or virtual rasters.
[[nodiscard]] std::unique_ptr<RasterReader> open_vrt(const std::filesystem::path& file, int band);

/// A raster of one band that lies on the map.
struct VrtTile {
    std::filesystem::path file;
    cv::Size size;
    Grid grid;
};

/// Of one coordinate system and cell size, whole cells apart, as written files have them.
[[nodiscard]] bool share_a_grid(const std::vector<VrtTile>& tiles);

/// Tiles that share a grid side by side, named relative to `file`. `type`: CV_32FC1 (nodata: nan) or CV_8UC1. Atomic.
void write_vrt(const std::filesystem::path& file, const std::vector<VrtTile>& tiles, int type);

} // namespace scanshade::rasters
