#include "apps/relief/surface.h"

#include "ao/horizon/horizon.h"
#include "apps/relief/gridding.h"
#include "apps/relief/ground_filter.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <optional>

namespace scanshade::relief {

namespace fs = std::filesystem;

namespace {

/// 1, 2 or 5 times a power of ten, about as large as the spacing of points.
double usual_cell_m(double spacing) {
    const double power = std::pow(10, std::floor(std::log10(spacing)));
    for (const double step : {1.0, 2.0, 5.0})
        if (spacing <= step * power * 1.0001)
            return step * power;
    return 10 * power;
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

/// What is known of a survey before its cells are.
struct Summary {
    Eigen::AlignedBox2d all, taken;
    double count = 0; ///< of those taken
    std::optional<double> first_z{};

    void add(std::span<const Eigen::Vector3d> points, const Taken& taken_points) {
        for (std::size_t i = 0; i < points.size(); ++i) {
            if (points[i].allFinite())
                all.extend(points[i].head<2>());
            if (!taken_points[i])
                continue;
            taken.extend(points[i].head<2>());
            first_z = first_z.value_or(points[i].z());
            ++count;
        }
    }
    /// As if the points of the surface lay in rows and columns.
    [[nodiscard]] double spacing_m(double unit_m) const {
        const Eigen::Vector2d sides = taken.sizes() * unit_m;
        return std::sqrt(std::max(sides.x() * sides.y(), 1e-6) / count);
    }
};

/// Calls with points of a file, and which of them are taken.
using SeeFile = std::function<void(std::span<const Eigen::Vector3d>, const Taken&)>;
/// Shows one file.
using ShowFile = std::function<void(std::size_t file, const SeeFile&)>;

/// What points of a cell differ by, but for the slope, as deviations of one point.
void add_residuals(std::span<const Eigen::Vector3d> points, const Taken& taken, Gridding gridding, double step,
                   std::vector<float>& residuals) {
    if (std::ranges::find(taken, true) == taken.end())
        return;
    gridding.cells = cells_of(extent_of(points), step, gridding.cells.cell); // of the file alone
    const Cells& cells = gridding.cells;
    SumRows sums(gridding);
    sums.add(points, taken);
    cv::Mat1f means(cells.size, std::nanf(""));
    constexpr double z_unit = 1.0 / (1 << 30), place_unit = 1.0 / (1 << 24);
    for (int r = 0; r < means.rows; ++r)
        for (int c = 0; sums.row(r) && c < means.cols; ++c)
            if (const Sum& sum = sums.row(r)[c]; sum.count > 0)
                means(r, c) = static_cast<float>(static_cast<double>(sum.z) * z_unit / sum.count);
    const horizon::Slopes slopes = horizon::slopes_of({means, 1});
    int row = 0, column = 0;
    for (std::size_t i = 0; i < taken.size(); ++i) {
        const Eigen::Vector3d& point = points[i];
        if (!taken[i] || !cells.find(point, row, column))
            continue;
        const Sum& sum = sums.row(row)[column];
        if (sum.count < 2)
            continue;
        const double count = sum.count;
        const double east = point.x() / cells.cell - cells.column0 - column -
                            static_cast<double>(sum.x) * place_unit / count,
                     south =
                         cells.row_end - point.y() / cells.cell - row - static_cast<double>(sum.y) * place_unit / count,
                     above = point.z() - gridding.base - static_cast<double>(sum.z) * z_unit / count -
                             slopes.east(row, column) * east + slopes.north(row, column) * south;
        residuals.push_back(static_cast<float>(std::abs(above) * std::sqrt(count / (count - 1))));
    }
}

/// Standard deviation of one point's height in the unit of heights, of a few files of the survey.
double point_noise(const Gridding& gridding, double step, std::size_t files, const ShowFile& show) {
    constexpr std::size_t most_files = 4, least = 30;
    const std::size_t seen = std::min(files, most_files);
    std::vector<float> residuals;
    for (std::size_t i = 0; i < seen; ++i)
        show(i * files / seen, [&](std::span<const Eigen::Vector3d> points, const Taken& taken) {
            add_residuals(points, taken, gridding, step, residuals);
        });
    return residuals.size() < least ? std::nan("") : median(std::move(residuals)) / median_of_gaussian;
}

/// How the survey becomes cells. `survey`: its system and classes, no points. `files`: how many `show` has.
Gridding gridding_of(const Summary& summary, const SurveyPoints& survey, const SurfaceOptions& options, double most,
                     std::size_t files, const ShowFile& show, std::vector<std::string>& notes) {
    if (!summary.first_z)
        throw Error("no point is of the surface that was asked for");
    const double cell_m = cell_size_m(options.cell_m, summary.spacing_m(survey.crs.unit_m), notes);
    Gridding gridding;
    gridding.cells = cells_of(summary.all, survey.step, cell_m / survey.crs.unit_m, most);
    gridding.surface = options.surface, gridding.base = std::floor(*summary.first_z);
    gridding.fill = options.fill_m > 0 ? options.fill_m / cell_m : std::max(3 / cell_m, 6.0);
    gridding.errors = options.errors;
    if (!options.errors)
        return gridding;
    const double unit = survey.crs.height_unit_m;
    gridding.noise = options.height_noise_m / unit;
    if (gridding.noise == 0) {
        constexpr double usual_m = 0.03; // of airborne lidar on hard ground
        // The highest points have no mean to differ from.
        const double noise =
            options.surface == Surface::top ? std::nan("") : point_noise(gridding, survey.step, files, show);
        notes.push_back(std::isnan(noise)
                            ? fmt::format("Too few cells have two points of the surface to tell their noise: {} m is "
                                          "assumed for expected errors; --height-noise sets it.",
                                          usual_m)
                            : fmt::format("Points of the surface have a noise of {:.2g} m.", noise * unit));
        gridding.noise = std::isnan(noise) ? usual_m / unit : noise;
    }
    if (options.surface == Surface::ground && !survey.ground_classified)
        gridding.noise = std::hypot(gridding.noise, filter_error_m() / unit);
    return gridding;
}

rasters::Grid grid_of(const Cells& cells, const rasters::Crs& crs) {
    rasters::Grid grid;
    grid.cell = cells.cell, grid.x0 = cells.column0 * cells.cell, grid.y0 = cells.row_end * cells.cell;
    grid.crs = crs;
    return grid;
}

/// Files are read once for what they hold, and again, from the north on, when their rows are needed.
class SurveyReader final : public SurfaceReader {
  public:
    SurveyReader(const std::vector<fs::path>& files, const SurfaceOptions& options, std::vector<std::string>& warnings)
        : surface_(options.surface), sums_(gridding_) {
        Summary summary;
        for (const fs::path& file : files)
            survey(file, summary, warnings);
        if (surface_ == Surface::ground && !whole_.ground_classified)
            throw Error(
                "no point is classified as ground: the filter needs all points in memory (--memory), or another "
                "--surface");
        finish_notes(whole_);
        notes = whole_.notes;
        for (const Part& part : parts_)
            if (surface_ == Surface::ground && part.taken == 0 && part.points > 0)
                notes.push_back(unclassified_note(part.file));
        constexpr double most = 1LL << 40;
        gridding_ = gridding_of(
            summary, whole_, options, most, parts_.size(),
            [&](std::size_t file, const SeeFile& see) { show(parts_[file], see); }, notes);
        const Cells& cells = gridding_.cells;
        size = cells.size, base = gridding_.base, grid = grid_of(cells, whole_.crs);
        for (Part& part : parts_)
            part.first_row = static_cast<int>(std::max(cells.row_end - 1 - cells.index(part.north), 0.0));
        std::ranges::stable_sort(parts_, {}, &Part::first_row);
    }

    void read(int first, cv::Mat1f& z) override {
        source.create(z.size());
        errors = gridding_.errors ? cv::Mat1f(z.size()) : cv::Mat1f();
        for (int row = first; row < first + z.rows;) {
            while (row >= block_rows_.end)
                next_block();
            const cv::Range from(row - block_rows_.start,
                                 std::min(first + z.rows, block_rows_.end) - block_rows_.start);
            const cv::Range to(row - first, row - first + from.size());
            block_.z.rowRange(from).copyTo(z.rowRange(to));
            block_.source.rowRange(from).copyTo(source.rowRange(to));
            if (gridding_.errors)
                block_.errors.rowRange(from).copyTo(errors.rowRange(to));
            row += from.size();
        }
    }

  private:
    struct Part {
        fs::path file;
        std::size_t points = 0, taken = 0;
        double north = 0;
        int first_row = 0;
    };

    void survey(const fs::path& file, Summary& summary, std::vector<std::string>& warnings) {
        SurveyPoints one;
        one.crs = whole_.crs, one.files = whole_.files; // what came before
        one.ends.assign(one.files.size(), 0), one.extensions.resize(one.files.size());
        add_file(one, file);
        std::ranges::move(one.warnings, std::back_inserter(warnings));
        whole_.crs = one.crs, whole_.step = std::max(whole_.step, one.step);
        whole_.files = {file}; // the first is enough to compare with
        Part part{file, one.points.size(), 0, 0, 0};
        const Taken taken = taken_of(one);
        whole_.ground_classified = whole_.ground_classified || one.ground_classified;
        part.taken = static_cast<std::size_t>(std::ranges::count(taken, true));
        summary.add(one.points, taken);
        Eigen::AlignedBox2d box;
        for (const Eigen::Vector3d& point : one.points)
            if (point.allFinite())
                box.extend(point.head<2>());
        part.north = box.isEmpty() ? 0 : box.max().y();
        if (!box.isEmpty())
            parts_.push_back(part);
    }

    /// By classes; whether the survey has any is known in the end.
    [[nodiscard]] Taken taken_of(const SurveyPoints& one) const {
        std::vector<std::string> same_notes;
        SurveyPoints classified;
        classified.points = one.points, classified.classes = one.classes, classified.ground_classified = true;
        return points_taken(classified, surface_, same_notes);
    }

    void show(const Part& part, const SeeFile& see) const {
        SurveyPoints one;
        add_file(one, part.file);
        const Taken taken = taken_of(one);
        if (one.points.size() != part.points || static_cast<std::size_t>(std::ranges::count(taken, true)) != part.taken)
            throw Error(fmt::format("{}: other points than when it was read first", part.file.string()));
        see(one.points, taken);
    }

    void next_block() {
        const int from = block_rows_.end, rim = block_rim(gridding_);
        block_rows_ = {from, block_end(gridding_, from)};
        sums_.drop_before(from - rim);
        for (; next_ < parts_.size() && parts_[next_].first_row < block_rows_.end + rim; ++next_)
            show(parts_[next_],
                 [&](std::span<const Eigen::Vector3d> points, const Taken& taken) { sums_.add(points, taken); });
        block_ = block_of(gridding_, sums_, block_rows_);
    }

    Surface surface_;
    SurveyPoints whole_; ///< no points
    std::vector<Part> parts_;
    Gridding gridding_;
    SumRows sums_;
    std::size_t next_ = 0;
    cv::Range block_rows_{0, 0};
    SurfaceRows block_;
};

} // namespace

SurfaceInMemory::SurfaceInMemory(SurfaceRaster surface) : surface_(std::move(surface)) {
    const rasters::Raster& raster = surface_.raster;
    size = raster.z.size(), base = raster.base, grid = raster.grid, notes = raster.notes;
}

void SurfaceInMemory::read(int first, cv::Mat1f& z) {
    const cv::Range rows(first, first + z.rows);
    surface_.raster.z.rowRange(rows).copyTo(z);
    source = surface_.source.rowRange(rows);
    errors = surface_.errors.empty() ? cv::Mat1f() : cv::Mat1f(surface_.errors.rowRange(rows));
}

std::unique_ptr<SurfaceReader> open_surface(const std::vector<fs::path>& files, const SurfaceOptions& options,
                                            std::vector<std::string>& warnings) {
    return std::make_unique<SurveyReader>(files, options, warnings);
}

SurfaceRaster surface_of(const SurveyPoints& survey, const SurfaceOptions& options) {
    SurfaceRaster result;
    std::vector<std::string>& notes = result.raster.notes;
    const Taken taken = points_taken(survey, options.surface, notes);
    Summary summary;
    summary.add(survey.points, taken);
    const std::size_t files = std::max(survey.ends.size(), std::size_t{1});
    const auto show = [&](std::size_t file, const SeeFile& see) {
        const std::size_t begin = file == 0 ? 0 : survey.ends[file - 1],
                          end = survey.ends.empty() ? survey.points.size() : survey.ends[file];
        see(std::span(survey.points).subspan(begin, end - begin),
            Taken(taken.begin() + static_cast<std::ptrdiff_t>(begin),
                  taken.begin() + static_cast<std::ptrdiff_t>(end)));
    };
    constexpr double most = 1 << 28;
    const Gridding gridding = gridding_of(summary, survey, options, most, files, show, notes);
    const cv::Size size = gridding.cells.size;
    require_memory(static_cast<std::uint64_t>(size.area()) * (sizeof(Sum) + 2 * sizeof(float)), "a grid of cells");
    SumRows sums(gridding);
    sums.add(survey.points, taken);
    cv::Mat1f z(size);
    result.source.create(size);
    if (options.errors)
        result.errors.create(size);
    for (cv::Range rows(0, 0); rows.end < size.height;) {
        rows = {rows.end, block_end(gridding, rows.end)};
        const SurfaceRows block = block_of(gridding, sums, rows);
        block.z.copyTo(z.rowRange(rows));
        block.source.copyTo(result.source.rowRange(rows));
        if (options.errors)
            block.errors.copyTo(result.errors.rowRange(rows));
    }
    result.raster.z = z, result.raster.base = gridding.base, result.raster.grid = grid_of(gridding.cells, survey.crs);
    return result;
}

std::vector<int> cells_of_points(const SurveyPoints& survey, const SurfaceRaster& surface, Surface kind) {
    const rasters::Grid& grid = surface.raster.grid;
    const Cells cells = cells_of(extent_of(survey.points), survey.step, grid.cell);
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
