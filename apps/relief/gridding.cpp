#include "apps/relief/gridding.h"

#include "ao/horizon/view_error.h"
#include "apps/relief/triangles.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>
#include <tbb/parallel_for.h>

namespace scanshade::relief {

namespace {

constexpr double z_unit = 1.0 / (1 << 30), place_unit = 1.0 / (1 << 24);

/// Sides of blocks on the map, in cells: a power of two, large against what cells are filled from.
int block_side(const Gridding& gridding) {
    int side = 512;
    while (side < 2 * gridding.fill)
        side *= 2;
    return side;
}

/// The same for columns.
int block_end_column(const Gridding& gridding, int column) {
    const int side = block_side(gridding);
    return std::min(column + side - gridding.cells.column_on_map(column) % side, gridding.cells.size.width);
}

/// A vertex of each cell with points, in cells from the rectangle's corner, which may lie outside the survey.
std::vector<Vertex> vertices_of(const Gridding& gridding, const SumRows& sums, const cv::Rect& cells) {
    constexpr unsigned stream = 3;
    std::vector<Vertex> vertices;
    for (int r = 0; r < cells.height; ++r) {
        const Sum* row = sums.row(cells.y + r);
        const int first = std::max(-cells.x, 0), last = std::min(cells.width, gridding.cells.size.width - cells.x);
        for (int c = first; row && c < last; ++c) {
            const Sum& sum = row[cells.x + c];
            if (sum.count == 0)
                continue;
            const double count = sum.count, z = static_cast<double>(sum.z) * z_unit;
            Vertex vertex{c + 0.5, r + 0.5, z, r * cells.width + c};
            if (gridding.surface != Surface::top) {
                vertex.x = c + static_cast<double>(sum.x) * place_unit / count;
                vertex.y = r + static_cast<double>(sum.y) * place_unit / count;
                vertex.z = z / count;
            }
            if (gridding.errors)
                vertex.error =
                    static_cast<float>(gridding.noise / std::sqrt(gridding.surface == Surface::top ? 1 : count)) *
                    horizon::drawn_error(gridding.cells.row_on_map(cells.y + r),
                                         gridding.cells.column_on_map(cells.x + c), 0, stream);
            vertices.push_back(vertex);
        }
    }
    return vertices;
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

/// Between points the surface bends as it does where it is known: by the bend of one cell, times a power of the
/// distance.
void add_errors_of_gaps(cv::Mat1f& errors, const cv::Mat1f& z, const cv::Mat1f& distance, const Cells& cells,
                        cv::Point corner) {
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
            const int octave = std::clamp(static_cast<int>(std::lround(std::log2(d))), 0, 16);
            errors(r, c) +=
                factor * std::sqrt(mean) * std::pow(d, power) *
                horizon::drawn_error(cells.row_on_map(corner.y + r), cells.column_on_map(corner.x + c), octave, stream);
        }
}

/// Heights of a rectangle of cells.
SurfaceRows surface_within(const Gridding& gridding, const SumRows& sums, const cv::Rect& cells) {
    const std::vector<Vertex> vertices = vertices_of(gridding, sums, cells);
    SurfaceRows found;
    cv::Mat1b unmeasured(cells.size(), std::uint8_t(255));
    for (const Vertex& vertex : vertices)
        unmeasured(vertex.cell / cells.width, vertex.cell % cells.width) = 0;
    cv::Mat1f* errors = gridding.errors ? &found.errors : nullptr;
    const bool between = gridding.surface == Surface::ground || cv::countNonZero(unmeasured) > 0;
    found.z = between ? heights_at_centres(vertices, cells.size(), errors) : cv::Mat1f(cells.size(), std::nanf(""));
    if (errors && !between)
        *errors = cv::Mat1f(cells.size(), 0.0F);
    // A highest point and a mean are a cell's own; so is ground outside all triangles.
    for (const Vertex& vertex : vertices) {
        const cv::Point at(vertex.cell % cells.width, vertex.cell / cells.width);
        if (gridding.surface != Surface::ground || std::isnan(found.z(at))) {
            found.z(at) = static_cast<float>(vertex.z);
            if (errors)
                (*errors)(at) = vertex.error;
        }
    }
    cv::Mat1f distance(cells.size(), 1e9F); // in cells, from the nearest measured one
    if (!vertices.empty())
        cv::distanceTransform(unmeasured, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    if (errors)
        add_errors_of_gaps(*errors, found.z, distance, gridding.cells, cells.tl());
    found.source = source_of(found.z, distance, gridding.fill);
    return found;
}

} // namespace

Eigen::AlignedBox2d extent_of(std::span<const Eigen::Vector3d> points) {
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector3d& point : points)
        if (point.allFinite())
            box.extend(point.head<2>());
    if (box.isEmpty())
        throw Error("no point has coordinates");
    return box;
}

Cells cells_of(const Eigen::AlignedBox2d& box, double step, double cell, double most) {
    Cells cells;
    cells.cell = cell;
    constexpr double half = 0.501;
    cells.slack = std::max(cells.slack, half * step / cell);
    cells.column0 = cells.index(box.min().x());
    cells.row_end = std::max(std::ceil(box.max().y() / cell - cells.slack), cells.index(box.min().y()) + 1);
    const double columns = std::max(std::ceil(box.max().x() / cell - cells.slack) - cells.column0, 1.0);
    const double rows = cells.row_end - cells.index(box.min().y());
    if (columns * rows > most)
        throw Error(
            fmt::format("{:.0f} x {:.0f} cells, at most {:.0f} are computed; a larger --cell has fewer. The points "
                        "lie in x {:.1f} .. {:.1f}, y {:.1f} .. {:.1f}: one far from all others does the same",
                        columns, rows, most, box.min().x(), box.max().x(), box.min().y(), box.max().y()));
    cells.size = {static_cast<int>(columns), static_cast<int>(rows)};
    return cells;
}

void SumRows::add(std::span<const Eigen::Vector3d> points, const Taken& taken) {
    const Cells& cells = gridding_.cells;
    int row = 0, column = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector3d& point = points[i];
        if (!taken[i] || !cells.find(point, row, column) || row < first_)
            continue;
        while (rows_.size() <= static_cast<std::size_t>(row - first_))
            rows_.emplace_back();
        std::vector<Sum>& sums = rows_[static_cast<std::size_t>(row - first_)];
        if (sums.empty())
            sums.resize(static_cast<std::size_t>(cells.size.width));
        Sum& sum = sums[static_cast<std::size_t>(column)];
        const auto z = static_cast<std::int64_t>(std::floor((point.z() - gridding_.base) / z_unit + 0.5));
        if (gridding_.surface == Surface::top) {
            sum.z = sum.count == 0 ? z : std::max(sum.z, z);
            sum.count = 1;
            continue;
        }
        const auto offset = [](double place) {
            return static_cast<std::uint64_t>(std::clamp(place, 0.0, 1.0) / place_unit + 0.5);
        };
        sum.x += offset(point.x() / cells.cell - cells.column0 - column);
        sum.y += offset(cells.row_end - point.y() / cells.cell - row);
        sum.z += z, ++sum.count;
    }
}

const Sum* SumRows::row(int row) const {
    const int i = row - first_;
    return i < 0 || static_cast<std::size_t>(i) >= rows_.size() || rows_[static_cast<std::size_t>(i)].empty()
               ? nullptr
               : rows_[static_cast<std::size_t>(i)].data();
}

void SumRows::drop_before(int row) {
    for (; first_ < row; ++first_)
        if (!rows_.empty())
            rows_.pop_front();
}

int block_end(const Gridding& gridding, int row) {
    const int side = block_side(gridding);
    return std::min(row + side - gridding.cells.row_on_map(row) % side, gridding.cells.size.height);
}

int block_rim(const Gridding& gridding) {
    constexpr double least = 20; // of bends' means
    return static_cast<int>(std::ceil(std::max(2 * gridding.fill + 8, least)));
}

SurfaceRows block_of(const Gridding& gridding, const SumRows& sums, cv::Range rows) {
    const cv::Size all = gridding.cells.size, size(all.width, rows.size());
    SurfaceRows found{cv::Mat1f(size), cv::Mat1b(size), gridding.errors ? cv::Mat1f(size) : cv::Mat1f()};
    std::vector<cv::Range> columns;
    for (int column = 0; column < all.width; column = columns.back().end)
        columns.emplace_back(column, block_end_column(gridding, column));
    const int rim = block_rim(gridding);
    tbb::parallel_for(std::size_t{0}, columns.size(), [&](std::size_t i) {
        const cv::Rect own(columns[i].start, rows.start, columns[i].size(), rows.size());
        // The whole block with its rim, also where it begins before the survey does: triangles have the same numbers.
        const int side = block_side(gridding), x = own.x - gridding.cells.column_on_map(own.x) % side,
                  y = own.y - gridding.cells.row_on_map(own.y) % side;
        const cv::Rect more(x - rim, y - rim, side + 2 * rim, side + 2 * rim);
        const SurfaceRows part = surface_within(gridding, sums, more);
        const cv::Rect from(own.tl() - more.tl(), own.size()), to(own.x, 0, own.width, own.height);
        part.z(from).copyTo(found.z(to));
        part.source(from).copyTo(found.source(to));
        if (gridding.errors)
            part.errors(from).copyTo(found.errors(to));
    });
    return found;
}

} // namespace scanshade::relief
