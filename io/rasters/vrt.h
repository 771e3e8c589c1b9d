// GDAL's virtual rasters (.vrt), read.
#pragma once

#include "io/rasters/raster.h"

namespace scanshade::rasters {

/// By its name.
[[nodiscard]] bool is_vrt(const std::filesystem::path& file);
/// As read_raster(). Throws Error, too, for sources that are scaled, changed, or virtual rasters that hold themselves.
[[nodiscard]] Raster read_vrt(const std::filesystem::path& file, int band);

} // namespace scanshade::rasters
