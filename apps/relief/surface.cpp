#include "apps/relief/surface.h"

#include "ao/horizon/horizon.h"
#include "apps/relief/ground_filter.h"
#include "apps/relief/triangles.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/point_classes.h"
#include "io/images/image_check.h"
#include "io/rasters/las_crs.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace scanshade::relief {

namespace fs = std::filesystem;

namespace {

constexpr std::uint8_t ground = 2, key_point = 8, water = 9, road = 11;

bool is_ground(std::uint8_t kind) { return kind == ground || kind == key_point || kind == water || kind == road; }

/// Coordinates of the globe, in steps that only degrees need, and heights of another unit than x and y.
bool probably_degrees(const Cloud& cloud, double step) {
    constexpr double finest_m = 2e-6;
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& point : cloud.points)
        if (point.allFinite())
            box.extend(point);
    if (box.isEmpty() || step == 0 || step > finest_m)
        return false;
    return box.min().x() >= -360 && box.max().x() <= 360 && box.min().y() >= -90 && box.max().y() <= 90 &&
           box.sizes().z() > box.sizes().head<2>().maxCoeff();
}

void add(SurveyPoints& survey, const fs::path& file, bool first) {
    const Cloud cloud = read_cloud(file, survey.warnings);
    const std::string_view header = cloud.records ? std::string_view(cloud.records->header) : std::string_view();
    rasters::Crs crs;
    if (header.starts_with("LASF")) {
        crs = during(file.string(), [&] { return rasters::crs_of_las(header); });
        survey.step = std::max({survey.step, std::abs(cloud.records->scale[0]), std::abs(cloud.records->scale[1])});
    }
    if (crs.geographic || (!crs.known && probably_degrees(cloud, survey.step)))
        throw Error(file.string() +
                    ": coordinates are degrees, in which slopes mean nothing; project them first, such as "
                    "by PDAL's filters.reprojection");
    if (first)
        survey.crs = crs;
    else if (crs.epsg != survey.crs.epsg || crs.unit_m != survey.crs.unit_m ||
             crs.height_unit_m != survey.crs.height_unit_m)
        throw Error(
            fmt::format("{}: its coordinate system (EPSG {}, units of {} m, heights of {} m) is not that of the "
                        "files before (EPSG {}, {} m, {} m)",
                        file.string(), crs.epsg, crs.unit_m, crs.height_unit_m, survey.crs.epsg, survey.crs.unit_m,
                        survey.crs.height_unit_m));
    std::vector<std::uint8_t> classes = classes_of(cloud, file);
    classes.resize(cloud.points.size());
    survey.ground_classified = survey.ground_classified || std::ranges::find(classes, ground) != classes.end();
    survey.points.insert(survey.points.end(), cloud.points.begin(), cloud.points.end());
    survey.classes.insert(survey.classes.end(), classes.begin(), classes.end());
    survey.extensions.push_back(cloud.records ? extension(*cloud.records) : ".ply");
    survey.files.push_back(file), survey.ends.push_back(survey.points.size());
}

/// The cells of a survey, in the unit of its coordinates.
struct Cells {
    double cell = 0;
    double column0 = 0, row_end = 0; ///< numbers of the first column and behind the northern row, from the map's origin
    cv::Size size;
    double slack = 1e-6; ///< of a coordinate, in cells

    /// False for points without coordinates, and for those outside.
    bool find(const Eigen::Vector3d& point, int& row, int& column) const {
        const double x = index(point.x()) - column0, y = row_end - 1 - index(point.y());
        if (!(x >= 0 && x <= size.width && y >= -1 && y < size.height))
            return false;
        // Points on the outer border belong to the last cells.
        row = std::max(static_cast<int>(y), 0), column = std::min(static_cast<int>(x), size.width - 1);
        return true;
    }
    /// Cells are half-open; coordinates on a line, give or take their rounding, belong to the north-east.
    [[nodiscard]] double index(double coordinate) const { return std::floor(coordinate / cell + slack); }
};

Cells cells_of(const SurveyPoints& survey, double cell) {
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector3d& point : survey.points)
        if (point.allFinite())
            box.extend(point.head<2>());
    if (box.isEmpty())
        throw Error("no point has coordinates");
    Cells cells;
    cells.cell = cell;
    constexpr double half = 0.501;
    cells.slack = std::max(cells.slack, half * survey.step / cell);
    cells.column0 = cells.index(box.min().x());
    cells.row_end = std::max(std::ceil(box.max().y() / cell - cells.slack), cells.index(box.min().y()) + 1);
    const double columns = std::max(std::ceil(box.max().x() / cell - cells.slack) - cells.column0, 1.0);
    const double rows = cells.row_end - cells.index(box.min().y());
    if (columns * rows > static_cast<double>(most_pixels))
        throw Error(fmt::format("{:.0f} x {:.0f} cells, at most {} are computed; a larger --cell has fewer. The points "
                                "lie in x {:.1f} .. {:.1f}, y {:.1f} .. {:.1f}: one far from all others does the same",
                                columns, rows, most_pixels, box.min().x(), box.max().x(), box.min().y(),
                                box.max().y()));
    cells.size = {static_cast<int>(columns), static_cast<int>(rows)};
    return cells;
}

/// Whether a point is one of the surface.
using Taken = std::vector<bool>;

Taken unclassified_ground(const SurveyPoints& survey, std::vector<std::string>& notes) {
    constexpr double window_m = 20, least_cell_m = 1;
    const double unit = survey.crs.unit_m, height_unit = survey.crs.height_unit_m;
    const Cells cells = cells_of(survey, least_cell_m / unit);
    cv::Mat1f lowest(cells.size, std::nanf(""));
    int row = 0, column = 0;
    for (const Eigen::Vector3d& point : survey.points)
        if (cells.find(point, row, column)) {
            float& z = lowest(row, column);
            z = std::isnan(z) ? static_cast<float>(point.z() * height_unit)
                              : std::min(z, static_cast<float>(point.z() * height_unit));
        }
    const cv::Mat1f surface = opened_ground(lowest, least_cell_m, window_m);
    Taken taken(survey.points.size());
    for (std::size_t i = 0; i < survey.points.size(); ++i)
        if (cells.find(survey.points[i], row, column)) {
            const double above = survey.points[i].z() * height_unit - surface(row, column);
            taken[i] = above >= -false_depth_m() && above <= ground_tolerance_m();
        }
    notes.push_back(
        fmt::format("No point is classified as ground: a progressive morphological filter with windows of up to {} "
                    "m decides, which is less certain.",
                    window_m));
    return taken;
}

Taken points_taken(const SurveyPoints& survey, Surface surface, std::vector<std::string>& notes) {
    if (surface == Surface::ground && !survey.ground_classified)
        return unclassified_ground(survey, notes);
    Taken taken(survey.points.size());
    for (std::size_t i = 0; i < taken.size(); ++i)
        taken[i] = survey.points[i].allFinite() && (surface != Surface::ground || is_ground(survey.classes[i]));
    for (std::size_t i = 0, begin = 0; i < survey.files.size(); begin = survey.ends[i++]) {
        const auto first = taken.begin() + static_cast<std::ptrdiff_t>(begin),
                   last = taken.begin() + static_cast<std::ptrdiff_t>(survey.ends[i]);
        if (first != last && std::find(first, last, true) == last)
            notes.push_back(fmt::format("No point of {} is classified as ground, while those of other files are: its "
                                        "cells stay empty. Classify it, too, or choose another --surface.",
                                        survey.files[i].string()));
    }
    return taken;
}

/// As if the points of the surface lay in rows and columns.
double spacing_m(const SurveyPoints& survey, const Taken& taken) {
    Eigen::AlignedBox2d box;
    double count = 0;
    for (std::size_t i = 0; i < taken.size(); ++i)
        if (taken[i]) {
            box.extend(survey.points[i].head<2>());
            ++count;
        }
    const Eigen::Vector2d sides = box.sizes() * survey.crs.unit_m;
    return std::sqrt(std::max(sides.x() * sides.y(), 1e-6) / count);
}

/// 1, 2 or 5 times a power of ten, about as large as the spacing of points.
double usual_cell_m(double spacing) {
    const double power = std::pow(10, std::floor(std::log10(spacing)));
    for (const double step : {1.0, 2.0, 5.0})
        if (spacing <= step * power * 1.0001)
            return step * power;
    return 10 * power;
}

/// What lies in each cell: a vertex of the surface, in cells from the raster's corner.
std::vector<Vertex> vertices_of(const SurveyPoints& survey, const Taken& taken, const Cells& cells, Surface surface,
                                double base) {
    struct Sum {
        double x = 0, y = 0, z = 0, count = 0;
    };
    require_memory(static_cast<std::uint64_t>(cells.size.area()) * sizeof(Sum), "a grid of cells");
    std::vector<Sum> sums(static_cast<std::size_t>(cells.size.area()));
    int row = 0, column = 0;
    for (std::size_t i = 0; i < taken.size(); ++i) {
        const Eigen::Vector3d& point = survey.points[i];
        if (!taken[i] || !cells.find(point, row, column))
            continue;
        Sum& sum = sums[static_cast<std::size_t>(row) * static_cast<std::size_t>(cells.size.width) +
                        static_cast<std::size_t>(column)];
        const double z = point.z() - base;
        if (surface == Surface::top) {
            sum.z = sum.count == 0 ? z : std::max(sum.z, z);
            sum.x = column + 0.5, sum.y = row + 0.5, sum.count = 1;
            continue;
        }
        sum.x += point.x() / cells.cell - cells.column0, sum.y += cells.row_end - point.y() / cells.cell;
        sum.z += z, sum.count += 1;
    }
    std::vector<Vertex> vertices;
    for (std::size_t i = 0; i < sums.size(); ++i)
        if (const Sum& sum = sums[i]; sum.count > 0)
            vertices.push_back({sum.x / sum.count, sum.y / sum.count, sum.z / sum.count, static_cast<int>(i)});
    return vertices;
}

} // namespace

SurveyPoints read_survey(const std::vector<fs::path>& files) {
    SurveyPoints survey;
    for (std::size_t i = 0; i < files.size(); ++i)
        add(survey, files[i], i == 0);
    survey.notes.insert(survey.notes.end(), survey.crs.notes.begin(), survey.crs.notes.end());
    if (!survey.crs.known)
        survey.notes.push_back("The points name no coordinate system: metres are assumed.");
    return survey;
}

SurfaceRaster surface_of(const SurveyPoints& survey, const SurfaceOptions& options) {
    SurfaceRaster result;
    std::vector<std::string>& notes = result.raster.notes;
    const Taken taken = points_taken(survey, options.surface, notes);
    if (std::ranges::find(taken, true) == taken.end())
        throw Error("no point is of the surface that was asked for");
    double cell_m = options.cell_m;
    const double spacing = spacing_m(survey, taken);
    constexpr double fine = 3;
    if (cell_m == 0) {
        cell_m = usual_cell_m(spacing);
        notes.push_back(fmt::format("Cells of {:.4g} m, about a point each; --cell sets another size.", cell_m));
    } else if (fine * cell_m < spacing) {
        notes.push_back(fmt::format("Points of the surface are {:.2g} m apart on average: most heights of cells of "
                                    "{:.4g} m are interpolated, and show no relief of their own.",
                                    spacing, cell_m));
    }
    const Cells cells = cells_of(survey, cell_m / survey.crs.unit_m);
    const auto first = static_cast<std::size_t>(std::ranges::find(taken, true) - taken.begin());
    const double base = std::floor(survey.points[first].z());
    const std::vector<Vertex> vertices = vertices_of(survey, taken, cells, options.surface, base);
    rasters::Grid grid;
    grid.cell = cells.cell, grid.x0 = cells.column0 * cells.cell, grid.y0 = cells.row_end * cells.cell;
    grid.crs = survey.crs;
    cv::Mat1b unmeasured(cells.size, std::uint8_t(255));
    for (const Vertex& vertex : vertices)
        unmeasured(vertex.cell / cells.size.width, vertex.cell % cells.size.width) = 0;
    cv::Mat1f z = options.surface == Surface::ground || cv::countNonZero(unmeasured) > 0
                      ? heights_at_centres(vertices, cells.size)
                      : cv::Mat1f(cells.size, std::nanf(""));
    // A highest point and a mean are a cell's own; so is ground outside all triangles.
    for (const Vertex& vertex : vertices) {
        float& height = z(vertex.cell / cells.size.width, vertex.cell % cells.size.width);
        if (options.surface != Surface::ground || std::isnan(height))
            height = static_cast<float>(vertex.z);
    }
    cv::Mat1f distance; // in cells, from the nearest measured one
    cv::distanceTransform(unmeasured, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    const double fill = options.fill_m > 0 ? options.fill_m / cell_m : std::max(3 / cell_m, 6.0);
    result.source.create(cells.size);
    for (int r = 0; r < z.rows; ++r)
        for (int c = 0; c < z.cols; ++c) {
            if (distance(r, c) > fill)
                z(r, c) = std::nanf("");
            const Source source = std::isnan(z(r, c))     ? Source::nothing
                                  : unmeasured(r, c) == 0 ? Source::measured
                                                          : Source::interpolated;
            result.source(r, c) = static_cast<std::uint8_t>(source);
        }
    result.raster.z = z, result.raster.base = base, result.raster.grid = grid;
    return result;
}

std::vector<int> cells_of_points(const SurveyPoints& survey, const SurfaceRaster& surface, Surface kind) {
    const rasters::Grid& grid = surface.raster.grid;
    const Cells cells = cells_of(survey, grid.cell);
    CV_Assert(cells.size == surface.raster.z.size());
    const double most_above = ground_tolerance_m() / grid.crs.height_unit_m;
    const horizon::Slopes slopes = horizon::slopes_of({surface.raster.z, grid.cell});
    const auto above = [&](const Eigen::Vector3d& point, int row, int column) {
        const double east = point.x() - grid.x0 - (column + 0.5) * grid.cell,
                     north = point.y() - grid.y0 + (row + 0.5) * grid.cell;
        return point.z() - surface.raster.base - surface.raster.z(row, column) - slopes.east(row, column) * east -
               slopes.north(row, column) * north;
    };
    std::vector<int> found;
    found.reserve(survey.points.size());
    int row = 0, column = 0;
    for (const Eigen::Vector3d& point : survey.points) {
        const bool inside = cells.find(point, row, column);
        const bool of_surface =
            inside && (kind == Surface::top || above(point, row, column) <= most_above); // not of NaN
        found.push_back(of_surface ? row * cells.size.width + column : -1);
    }
    return found;
}

} // namespace scanshade::relief
