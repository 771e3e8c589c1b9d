// Points of a survey -> heights of cells: ground by classes or by a filter, gaps filled within a limit.
#pragma once

#include "io/rasters/raster.h"

#include <cstdint>
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace scanshade::relief {

enum class Surface {
    ground, ///< by the file's classes, or by a filter
    top,    ///< the highest point of each cell
    all,    ///< the mean of all points
};

/// Points in the unit of their coordinate system, of one file or of several that are one survey.
struct SurveyPoints {
    std::vector<Eigen::Vector3d> points; ///< NaN: not to be used
    std::vector<std::uint8_t> classes;   ///< of LAS; 0 where the file has none
    bool ground_classified = false;      ///< a point of class 2 is there
    rasters::Crs crs;
    std::vector<std::filesystem::path> files;
    std::vector<std::string> extensions; ///< ".laz" ..., as clouds are written again
    std::vector<std::size_t> ends;       ///< behind each file's points
    double step = 0;                     ///< to which coordinates are rounded; 0: not known to be
    std::vector<std::string> notes{};    ///< sentences
    std::vector<std::string> warnings{}; ///< sentences that name their file
};

/// Throws Error naming the file for what is damaged, in degrees, or in another coordinate system than the files before.
[[nodiscard]] SurveyPoints read_survey(const std::vector<std::filesystem::path>& files);

enum class Source : std::uint8_t { nothing = 0, measured = 1, interpolated = 2 };

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

/// Corners lie on multiples of the cell. Ground is a mean of points in a cell, read at the cell's centre from triangles
/// between those means (Delaunay). Throws Error where no point is of the surface.
[[nodiscard]] SurfaceRaster surface_of(const SurveyPoints& survey, const SurfaceOptions& options);

/// The cell of each point, row by row; -1 for points without coordinates, and for those more than 0.3 m above the plane
/// of their cell, which are not of the surface. Of `top` all are.
[[nodiscard]] std::vector<int> cells_of_points(const SurveyPoints& survey, const SurfaceRaster& surface, Surface kind);

} // namespace scanshade::relief
