#include "ao/horizon/padded.h"

#include <algorithm>
#include <cmath>
#include <tbb/parallel_for.h>

namespace scanshade::horizon {

namespace {

constexpr int block_columns = 64;

} // namespace

int index_within(int i, int count, Border border) {
    if (i >= 0 && i < count)
        return i;
    if (border == Border::nothing)
        return -1;
    if (border == Border::repeated)
        return std::clamp(i, 0, count - 1);
    if (count == 1)
        return 0;
    const int period = 2 * (count - 1), folded = (i % period + period) % period;
    return folded < count ? folded : period - folded;
}

Padded::Padded(const cv::Mat1f& z, int rim, Border border, float scale, float unit)
    : rim_(rim), stride_(z.cols + 2 * rim), rows_(z.rows + 2 * rim),
      z_(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(stride_), std::nanf("")),
      blocks_(static_cast<int>(stride_) / block_columns + 1) {
    std::vector<int> columns;
    for (int c = -rim; c < z.cols + rim; ++c)
        columns.push_back(index_within(c, z.cols, border));
    tbb::parallel_for(-rim, z.rows + rim, [&](int r) {
        const int from = index_within(r, z.rows, border);
        if (from < 0)
            return;
        float* to = &z_[index(r, -rim)];
        for (std::size_t i = 0; i < columns.size(); ++i)
            if (columns[i] >= 0)
                to[i] = z(from, columns[i]) * scale / unit;
    });
    if (border == Border::nothing)
        find_holes(z);
}

void Padded::find_holes(const cv::Mat1f& z) {
    holes_.assign(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(blocks_), 0);
    bool any = false;
    for (int r = 0; r < z.rows; ++r)
        for (int c = 0; c < z.cols; ++c)
            if (std::isnan(z(r, c))) {
                holes_[static_cast<std::size_t>((r + rim_) * blocks_ + (c + rim_) / block_columns)] = 1;
                any = true;
            }
    if (any)
        find_known();
}

void Padded::find_known() {
    known_.assign(z_.size(), 0);
    for (std::size_t i = 0; i + static_cast<std::size_t>(stride_) + 1 < z_.size(); ++i) {
        const float sum = z_[i] + z_[i + 1] + z_[i + static_cast<std::size_t>(stride_)] +
                          z_[i + static_cast<std::size_t>(stride_) + 1];
        known_[i] = !std::isnan(sum);
    }
}

const unsigned char* Padded::known(int row, int column, int count) const {
    if (known_.empty())
        return nullptr;
    const int first = column / block_columns, last = (column + count - 1 + 2 * rim_) / block_columns;
    for (int r = row; r <= row + 2 * rim_; ++r)
        for (int b = first; b <= last; ++b)
            if (holes_[static_cast<std::size_t>(r) * static_cast<std::size_t>(blocks_) + static_cast<std::size_t>(b)])
                return &known_[index(row, column)];
    return nullptr;
}

} // namespace scanshade::horizon
