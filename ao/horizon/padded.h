// A field with a rim, so that a walk needs no test for borders.
#pragma once

#include "ao/horizon/horizon.h"

#include <functional>
#include <vector>

namespace scanshade::horizon {

/// What is beyond the border.
enum class Border {
    nothing,  ///< NaN
    mirrored, ///< without repeating the border cell, again and again where the raster is small
    repeated, ///< the border cell
};

/// The index of the cell that stands for index i of 0 .. count - 1; -1 for none.
[[nodiscard]] int index_within(int i, int count, Border border);

/// Heights times `scale`, divided by `unit` (in single precision, one after the other, as RVT does), with a rim.
class Padded {
  public:
    Padded(const cv::Mat1f& z, int rim, Border border, float scale, float unit);

    [[nodiscard]] std::ptrdiff_t stride() const { return stride_; }
    /// A cell of the raster; its rim lies around it in memory.
    [[nodiscard]] const float* at(int row, int column) const { return &z_[index(row, column)]; }
    /// Squares by their north-west corner, 0 where one of the four cells has no data; null where none of the squares
    /// around `count` cells, as far as the rim, lacks data within the raster.
    [[nodiscard]] const unsigned char* known(int row, int column, int count) const;

  private:
    [[nodiscard]] std::size_t index(int row, int column) const {
        return static_cast<std::size_t>((row + rim_) * stride_ + column + rim_);
    }
    void find_holes(const cv::Mat1f& z);
    void find_known();

    int rim_;
    std::ptrdiff_t stride_;
    int rows_; ///< with the rim
    std::vector<float> z_;
    std::vector<unsigned char> known_; ///< empty where the raster has no holes
    std::vector<unsigned char> holes_; ///< of blocks of columns in each row of the raster with its rim
    int blocks_;
};

} // namespace scanshade::horizon
