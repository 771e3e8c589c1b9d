#include "apps/relief/surface.h"

#include "ao/horizon/horizon.h"
#include "ao/horizon/view_error.h"
#include "apps/relief/ground_filter.h"
#include "apps/relief/triangles.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/point_classes.h"
#include "io/images/image_check.h"
#include "io/rasters/las_crs.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/statistics.h"

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
    [[nodiscard]] std::size_t number(int row, int column) const {
        return static_cast<std::size_t>(row) * static_cast<std::size_t>(size.width) + static_cast<std::size_t>(column);
    }
    /// Row and column on the map, the same in all pieces of it.
    [[nodiscard]] std::pair<int, int> place(int number) const {
        const auto wrapped = [](double value) {
            return static_cast<int>(static_cast<std::int64_t>(value) & 0x3fffffff);
        };
        return {wrapped(-row_end + number / size.width), wrapped(column0 + number % size.width)};
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

/// The points of a cell.
struct Sum {
    double x = 0, y = 0, z = 0, count = 0;
};

std::vector<Sum> sums_of(const SurveyPoints& survey, const Taken& taken, const Cells& cells, Surface surface,
                         double base) {
    require_memory(static_cast<std::uint64_t>(cells.size.area()) * sizeof(Sum), "a grid of cells");
    std::vector<Sum> sums(static_cast<std::size_t>(cells.size.area()));
    int row = 0, column = 0;
    for (std::size_t i = 0; i < taken.size(); ++i) {
        const Eigen::Vector3d& point = survey.points[i];
        if (!taken[i] || !cells.find(point, row, column))
            continue;
        Sum& sum = sums[cells.number(row, column)];
        const double z = point.z() - base;
        if (surface == Surface::top) {
            sum.z = sum.count == 0 ? z : std::max(sum.z, z);
            sum.x = column + 0.5, sum.y = row + 0.5, sum.count = 1;
            continue;
        }
        sum.x += point.x() / cells.cell - cells.column0, sum.y += cells.row_end - point.y() / cells.cell;
        sum.z += z, sum.count += 1;
    }
    return sums;
}

/// What lies in each cell: a vertex of the surface, in cells from the raster's corner.
std::vector<Vertex> vertices_of(const std::vector<Sum>& sums) {
    std::vector<Vertex> vertices;
    for (std::size_t i = 0; i < sums.size(); ++i)
        if (const Sum& sum = sums[i]; sum.count > 0)
            vertices.push_back({sum.x / sum.count, sum.y / sum.count, sum.z / sum.count, static_cast<int>(i)});
    return vertices;
}

/// The size that was asked for, or a usual one.
double cell_size_m(double cell_m, double spacing, std::vector<std::string>& notes) {
    constexpr double fine = 3;
    if (cell_m == 0) {
        cell_m = usual_cell_m(spacing);
        notes.push_back(fmt::format("Cells of {:.4g} m, about a point each; --cell sets another size.", cell_m));
    } else if (fine * cell_m < spacing) {
        notes.push_back(fmt::format("Points of the surface are {:.2g} m apart on average: most heights of cells of "
                                    "{:.4g} m are interpolated, and show no relief of their own.",
                                    spacing, cell_m));
    }
    return cell_m;
}

/// Cells farther than `fill` from the nearest measured one lose their height.
cv::Mat1b source_of(cv::Mat1f& z, const cv::Mat1f& distance, double fill) {
    cv::Mat1b sources(z.size());
    for (int r = 0; r < z.rows; ++r)
        for (int c = 0; c < z.cols; ++c) {
            if (distance(r, c) > fill)
                z(r, c) = std::nanf("");
            const Source source = std::isnan(z(r, c))   ? Source::nothing
                                  : distance(r, c) == 0 ? Source::measured
                                                        : Source::interpolated;
            sources(r, c) = static_cast<std::uint8_t>(source);
        }
    return sources;
}

/// Standard deviation of one point's height in the unit of heights: what points of a cell differ by, but for the slope.
double point_noise(const SurveyPoints& survey, const Taken& taken, const Cells& cells, const std::vector<Sum>& sums,
                   double base) {
    cv::Mat1f means(cells.size, std::nanf(""));
    for (std::size_t i = 0; i < sums.size(); ++i)
        if (sums[i].count > 0)
            means(static_cast<int>(i) / means.cols, static_cast<int>(i) % means.cols) =
                static_cast<float>(sums[i].z / sums[i].count);
    const horizon::Slopes slopes = horizon::slopes_of({means, 1});
    std::vector<float> residuals;
    int row = 0, column = 0;
    for (std::size_t i = 0; i < taken.size(); ++i) {
        const Eigen::Vector3d& point = survey.points[i];
        if (!taken[i] || !cells.find(point, row, column))
            continue;
        const Sum& sum = sums[cells.number(row, column)];
        if (sum.count < 2)
            continue;
        const double east = point.x() / cells.cell - cells.column0 - sum.x / sum.count,
                     north = sum.y / sum.count - (cells.row_end - point.y() / cells.cell),
                     above = point.z() - base - sum.z / sum.count - slopes.east(row, column) * east -
                             slopes.north(row, column) * north;
        residuals.push_back(static_cast<float>(std::abs(above) * std::sqrt(sum.count / (sum.count - 1))));
    }
    constexpr std::size_t least = 30;
    return residuals.size() < least ? std::nan("") : median(std::move(residuals)) / median_of_gaussian;
}

/// The same as it is set or measured, larger where a filter decides what is ground.
double vertex_noise(const SurveyPoints& survey, const Taken& taken, const Cells& cells, const std::vector<Sum>& sums,
                    double base, const SurfaceOptions& options, std::vector<std::string>& notes) {
    const double unit = survey.crs.height_unit_m;
    double noise = options.height_noise_m / unit;
    if (noise == 0) {
        constexpr double usual_m = 0.03; // of airborne lidar on hard ground
        // The highest points have no mean to differ from.
        noise = options.surface == Surface::top ? std::nan("") : point_noise(survey, taken, cells, sums, base);
        notes.push_back(std::isnan(noise)
                            ? fmt::format("Too few cells have two points of the surface to tell their noise: {} m is "
                                          "assumed for expected errors; --height-noise sets it.",
                                          usual_m)
                            : fmt::format("Points of the surface have a noise of {:.2g} m.", noise * unit));
        noise = std::isnan(noise) ? usual_m / unit : noise;
    }
    const bool filtered = options.surface == Surface::ground && !survey.ground_classified;
    return filtered ? std::hypot(noise, filter_error_m() / unit) : noise;
}

/// Errors of vertices by their cells' places on the map.
void draw_errors(std::vector<Vertex>& vertices, const std::vector<Sum>& sums, double noise, const Cells& cells) {
    constexpr unsigned stream = 3;
    for (Vertex& vertex : vertices) {
        const auto [row, column] = cells.place(vertex.cell);
        const double count = sums[static_cast<std::size_t>(vertex.cell)].count;
        vertex.error = static_cast<float>(noise / std::sqrt(count)) * horizon::drawn_error(row, column, 0, stream);
    }
}

/// Between points the surface bends as it does where it is known: by the bend of one cell, times a power of the
/// distance.
void add_errors_of_gaps(cv::Mat1f& errors, const cv::Mat1f& z, const cv::Mat1f& distance, const Cells& cells) {
    constexpr float factor = 0.45F, power = 1.2F, steepest = 0.4F; // fitted (`developers_bench relief-errors`)
    constexpr int around = 12;
    constexpr unsigned stream = 41;
    cv::Mat1f bends = horizon::bend_of(z), own = horizon::bend_of(errors);
    // Walls bend more, and end.
    const auto most = static_cast<float>(steepest * steepest * cells.cell * cells.cell);
    double sum = 0, count = 0;
    for (int r = 0; r < z.rows; ++r)
        for (int c = 0; c < z.cols; ++c) {
            const float square = bends(r, c) * bends(r, c) - own(r, c) * own(r, c);
            bends(r, c) = distance(r, c) > 0 ? std::nanf("") : std::min(square, most);
            if (!std::isnan(bends(r, c)))
                sum += bends(r, c), count += 1;
        }
    const auto usual = static_cast<float>(count > 0 ? sum / count : 0);
    const cv::Mat1f means = horizon::mean_of_known(bends, around);
    for (int r = 0; r < z.rows; ++r)
        for (int c = 0; c < z.cols; ++c) {
            const float d = distance(r, c), mean = std::isnan(means(r, c)) ? usual : means(r, c);
            if (d == 0 || !(mean > 0))
                continue;
            const auto [row, column] = cells.place(r * z.cols + c);
            const int octave = std::clamp(static_cast<int>(std::lround(std::log2(d))), 0, 16);
            errors(r, c) +=
                factor * std::sqrt(mean) * std::pow(d, power) * horizon::drawn_error(row, column, octave, stream);
        }
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
    const double cell_m = cell_size_m(options.cell_m, spacing_m(survey, taken), notes);
    const Cells cells = cells_of(survey, cell_m / survey.crs.unit_m);
    const auto first = static_cast<std::size_t>(std::ranges::find(taken, true) - taken.begin());
    const double base = std::floor(survey.points[first].z());
    const std::vector<Sum> sums = sums_of(survey, taken, cells, options.surface, base);
    std::vector<Vertex> vertices = vertices_of(sums);
    if (options.errors)
        draw_errors(vertices, sums, vertex_noise(survey, taken, cells, sums, base, options, notes), cells);
    rasters::Grid& grid = result.raster.grid;
    grid.cell = cells.cell, grid.x0 = cells.column0 * cells.cell, grid.y0 = cells.row_end * cells.cell;
    grid.crs = survey.crs;
    cv::Mat1b unmeasured(cells.size, std::uint8_t(255));
    for (const Vertex& vertex : vertices)
        unmeasured(vertex.cell / cells.size.width, vertex.cell % cells.size.width) = 0;
    cv::Mat1f* errors = options.errors ? &result.errors : nullptr;
    const bool between = options.surface == Surface::ground || cv::countNonZero(unmeasured) > 0;
    cv::Mat1f z = between ? heights_at_centres(vertices, cells.size, errors) : cv::Mat1f(cells.size, std::nanf(""));
    if (errors && !between)
        *errors = cv::Mat1f(cells.size, 0.0F);
    // A highest point and a mean are a cell's own; so is ground outside all triangles.
    for (const Vertex& vertex : vertices) {
        const cv::Point at(vertex.cell % cells.size.width, vertex.cell / cells.size.width);
        if (options.surface != Surface::ground || std::isnan(z(at))) {
            z(at) = static_cast<float>(vertex.z);
            if (errors)
                (*errors)(at) = vertex.error;
        }
    }
    cv::Mat1f distance; // in cells, from the nearest measured one
    cv::distanceTransform(unmeasured, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    if (errors)
        add_errors_of_gaps(*errors, z, distance, cells);
    const double fill = options.fill_m > 0 ? options.fill_m / cell_m : std::max(3 / cell_m, 6.0);
    result.source = source_of(z, distance, fill);
    result.raster.z = z, result.raster.base = base;
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
