// Rasters of a map: GeoTIFF in and out, with the coordinate system as it is in the file.
#pragma once

#include "io/rasters/crs.h"

#include <filesystem>
#include <memory>
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

/// A raster that is read some rows at a time.
class RasterReader {
  public:
    RasterReader() = default;
    virtual ~RasterReader() = default;
    RasterReader(const RasterReader&) = delete;
    RasterReader& operator=(const RasterReader&) = delete;
    /// Fills all rows of `z`, which is as wide as the raster, from row `first` on. Rows in order are read once each.
    /// Throws Error naming the file.
    virtual void read(int first, cv::Mat1f& z) = 0;

    cv::Size size;
    double base = 0;     ///< as of Raster
    double step = 0;     ///< heights are rounded to multiples of it; 0: not known to be
    bool scaled = false; ///< heights are the file's numbers times its SCALE plus OFFSET
    Grid grid;
    std::vector<std::string> notes;
};

/// Opens one band of a GeoTIFF: strips or tiles, integers or floats of 1 to 8 bytes, either byte order, BigTIFF, nodata
/// values, masks, scale and offset, area or point; without tags a world file with .prj, or .aux.xml. Or parts of
/// several, put side by side by GDAL's virtual raster (.vrt). `band` counts from 1; 0 = the only one. Throws Error
/// naming the file for what is damaged, and for rasters in degrees, turned, oblong, or of several bands without `band`.
[[nodiscard]] std::unique_ptr<RasterReader> open_raster(const std::filesystem::path& file, int band = 0);

/// All rows at once, of at most 2^28 cells.
[[nodiscard]] Raster read_raster(const std::filesystem::path& file, int band = 0);

/// Of a raster in memory.
class MemoryReader final : public RasterReader {
  public:
    explicit MemoryReader(const Raster& raster) : z_(raster.z) {
        size = z_.size(), base = raster.base, grid = raster.grid, notes = raster.notes;
    }
    void read(int first, cv::Mat1f& z) override { z_.rowRange(first, first + z.rows).copyTo(z); }

  private:
    cv::Mat1f z_;
};

/// Whether the file begins as a TIFF does.
[[nodiscard]] bool is_tiff(const std::filesystem::path& file);

/// What a file says about its values.
struct RasterText {
    std::string description;                                  ///< TIFF's ImageDescription
    std::vector<std::pair<std::string, std::string>> items{}; ///< of GDAL's metadata
};

/// How the cells of an overview come from four of the level below.
enum class Overviews { mean, nearest };

/// One band of floats (nodata: nan) or bytes (no nodata) as a cloud-optimized GeoTIFF: tiles of 512, overviews by 2 of
/// the known cells, LZW, pixel is area, the grid's keys, and its text in NAME.tif.aux.xml where it has one. BigTIFF
/// from 2 GiB on. Rows of tiles wait in a file without a name, in the same folder. Throws Outage naming the file.
class RasterWriter {
  public:
    /// `type`: CV_32FC1 or CV_8UC1.
    RasterWriter(std::filesystem::path file, cv::Size size, int type, const Grid& grid, const RasterText& text,
                 Overviews overviews = Overviews::mean);
    ~RasterWriter();
    RasterWriter(RasterWriter&&) noexcept;
    RasterWriter& operator=(RasterWriter&&) = delete;
    /// The next rows, from the north on.
    void write(const cv::Mat& rows);
    /// All rows are there: the file appears.
    void finish();

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

void write_raster(const std::filesystem::path& file, const cv::Mat& values, const Grid& grid, const RasterText& text);

} // namespace scanshade::rasters
