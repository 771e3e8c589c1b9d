// Rasters of a map: GeoTIFF in and out, with the coordinate system as it is in the file.
#pragma once

#include "io/rasters/crs.h"

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

namespace scanshade::rasters {

/// Where a raster lies: square cells, rows from north to south.
struct Grid {
    double x0 = 0, y0 = 0; ///< north-west corner of the first cell, in the unit of the coordinates
    double cell = 1;       ///< in the same unit
    Crs crs;
};

/// Heights of cell centres, NaN = no data, in the file's unit of heights less `base`.
struct Raster {
    cv::Mat1f z;
    double base = 0; ///< so that single precision keeps heights that the file holds with more digits; else 0
    Grid grid;
    std::vector<std::string> notes; ///< sentences: what was assumed or is unusual
};

/// Reads one band of a GeoTIFF: strips or tiles, integers or floats of 1 to 8 bytes, either byte order, BigTIFF, nodata
/// values, masks, scale and offset, area or point; without tags a world file with .prj, or .aux.xml. Or parts of
/// several, put side by side by GDAL's virtual raster (.vrt). `band` counts from 1; 0 = the only one. Throws Error
/// naming the file for what is damaged, and for rasters in degrees, turned, oblong, or of several bands without `band`.
[[nodiscard]] Raster read_raster(const std::filesystem::path& file, int band = 0);

/// Whether the file begins as a TIFF does.
[[nodiscard]] bool is_tiff(const std::filesystem::path& file);

/// What a file says about its values.
struct RasterText {
    std::string description;                                  ///< TIFF's ImageDescription
    std::vector<std::pair<std::string, std::string>> items{}; ///< of GDAL's metadata
};

/// Writes one band of floats (nodata: nan) or bytes (no nodata) as GeoTIFF: LZW, pixel is area, the grid's keys, and
/// its text in NAME.tif.aux.xml where it has one. BigTIFF from 2 GiB on. Atomic.
void write_raster(const std::filesystem::path& file, const cv::Mat& values, const Grid& grid, const RasterText& text);

} // namespace scanshade::rasters
