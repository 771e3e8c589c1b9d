// Points of a survey -> heights of cells: ground by classes or by a filter, gaps filled within a limit.
#pragma once

#include "apps/relief/survey.h"
#include "io/rasters/raster.h"

#include <memory>
#include <vector>

namespace scanshade::relief {

struct SurfaceRaster {
    rasters::Raster raster;
    cv::Mat1b source;   ///< Source of each cell
    cv::Mat1f errors{}; ///< a draw of the heights' errors, in their unit; empty unless asked for
};

struct SurfaceOptions {
    Surface surface = Surface::ground;
    double cell_m = 0;         ///< 0: about a point of the surface a cell
    double fill_m = 0;         ///< how far a cell may be from the nearest measured one; 0: 3 m or 6 cells, the larger
    bool errors = false;       ///< what is believed of them, too
    double height_noise_m = 0; ///< standard deviation of a point's height; 0: as points of one cell differ
};

/// A surface that is read some rows at a time.
class SurfaceReader : public rasters::RasterReader {
  public:
    cv::Mat1b source; ///< of the rows that were read last
    cv::Mat1f errors; ///< the same
};

class SurfaceInMemory final : public SurfaceReader {
  public:
    explicit SurfaceInMemory(SurfaceRaster surface);
    void read(int first, cv::Mat1f& z) override;

  private:
    SurfaceRaster surface_;
};

/// Corners lie on multiples of the cell. Ground is a mean of points in a cell, read at the cell's centre from triangles
/// between those means (Delaunay). Throws Error where no point is of the surface.
[[nodiscard]] SurfaceRaster surface_of(const SurveyPoints& survey, const SurfaceOptions& options);

/// The same of files whose points need not fit into memory: they are read twice, in the end as many at a time as lie in
/// one row of the map. Its bits are those of surface_of(). Throws Error, also where the ground is unclassified.
[[nodiscard]] std::unique_ptr<SurfaceReader> open_surface(const std::vector<std::filesystem::path>& files,
                                                          const SurfaceOptions& options,
                                                          std::vector<std::string>& warnings);

/// The cell of each point, row by row; -1 for points without coordinates, and for those more than 0.3 m above the plane
/// of their cell, which are not of the surface. Of `top` all are.
[[nodiscard]] std::vector<int> cells_of_points(const SurveyPoints& survey, const SurfaceRaster& surface, Surface kind);

} // namespace scanshade::relief
