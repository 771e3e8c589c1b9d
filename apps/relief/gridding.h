// Points -> sums in cells -> heights, by blocks that lie on the map, so that pieces of a survey have the bits of the
// whole.
#pragma once

#include "apps/relief/survey.h"

#include <deque>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <span>

namespace scanshade::relief {

/// The cells of a survey, in the unit of its coordinates: rows from the north.
class Cells {
  public:
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
    /// On the map: the same whatever else is in the survey.
    [[nodiscard]] int row_on_map(int row) const { return wrapped(row - row_end); }
    [[nodiscard]] int column_on_map(int column) const { return wrapped(column + column0); }
    /// Cells are half-open; coordinates on a line, give or take their rounding, belong to the north-east.
    [[nodiscard]] double index(double coordinate) const { return std::floor(coordinate / cell + slack); }

  private:
    static int wrapped(double value) { return static_cast<int>(static_cast<std::int64_t>(value) & 0x3fffffff); }
};

/// Of points with coordinates. Throws Error where there is none.
[[nodiscard]] Eigen::AlignedBox2d extent_of(std::span<const Eigen::Vector3d> points);

/// `step`: to which coordinates are rounded. Throws Error for more than `most` cells.
[[nodiscard]] Cells cells_of(const Eigen::AlignedBox2d& extent, double step, double cell, double most = 1 << 28);

/// The points of a cell. Whole numbers, so that their order does not matter.
struct Sum {
    std::int64_t z = 0;         ///< less `base`, in 2^-30 of their unit
    std::uint64_t x = 0, y = 0; ///< from the cell's north-west corner, in 2^-24 of a cell
    std::uint32_t count = 0;
};

/// How cells get their heights.
struct Gridding {
    Cells cells;
    Surface surface = Surface::ground;
    double base = 0; ///< heights are less this
    double fill = 6; ///< cells, from the nearest measured one
    bool errors = false;
    double noise = 0; ///< of a point's height, for errors
};

/// Sums of some rows; rows that are done can be dropped.
class SumRows {
  public:
    explicit SumRows(const Gridding& gridding) : gridding_(gridding) {}
    /// Points of which `taken` is true.
    void add(std::span<const Eigen::Vector3d> points, const Taken& taken);
    /// Null where no point is in the row.
    [[nodiscard]] const Sum* row(int row) const;
    void drop_before(int row);

  private:
    const Gridding& gridding_;
    std::deque<std::vector<Sum>> rows_;
    int first_ = 0;
};

struct SurfaceRows {
    cv::Mat1f z;
    cv::Mat1b source;
    cv::Mat1f errors; ///< a draw; empty unless asked for
};

/// Behind the block of rows that holds `row`.
[[nodiscard]] int block_end(const Gridding& gridding, int row);
/// Rows of sums that a block needs beyond its own.
[[nodiscard]] int block_rim(const Gridding& gridding);
/// Heights of a block of rows, on all processors.
[[nodiscard]] SurfaceRows block_of(const Gridding& gridding, const SumRows& sums, cv::Range rows);

} // namespace scanshade::relief
