// GDAL's virtual rasters (.vrt), read.
#pragma once

#include "io/rasters/raster.h"

namespace scanshade::rasters {

/// By its name.
[[nodiscard]] bool is_vrt(const std::filesystem::path& file);
/// As open_raster(). Throws Error, too, for sources that are scaled, changed, or virtual rasters.
[[nodiscard]] std::unique_ptr<RasterReader> open_vrt(const std::filesystem::path& file, int band);

} // namespace scanshade::rasters
