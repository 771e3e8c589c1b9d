#include "ao/horizon/view_error.h"

#include "projection/base/hash.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tbb/parallel_for.h>

namespace scanshade::horizon {

namespace {

/// Fitted to generated terrain; no units.
struct Factors {
    float relief;     ///< errors of heights for relief between cells, over the bend
    float missing;    ///< of what is hidden, over the share of surface that is missing
    float directions; ///< of what is hidden, times the number of directions
};

constexpr Factors exact_factors{1.8F, 1.0F, 0.3F}, rvt_factors{1.4F, 1.0F, 2.0F};

/// Cells to either side over which squares are pooled: near ones know the place better, many have less chance in them.
constexpr int pooled_near = 4, pooled_far = 12;
constexpr int bent = 2; ///< the same of bends

/// Unit variance: four bytes of a hash.
float white(int row, int column, unsigned stream) {
    const std::uint32_t bits = hash(hash(static_cast<std::uint32_t>(row), stream), static_cast<std::uint32_t>(column));
    const auto sum = static_cast<int>((bits & 255U) + (bits >> 8 & 255U) + (bits >> 16 & 255U) + (bits >> 24));
    constexpr float mean = 510, deviation = 147.8F;
    return (static_cast<float>(sum) - mean) / deviation;
}

/// Numbers of cells that are known, summed from the north-west corner.
class KnownCells {
  public:
    explicit KnownCells(const cv::Mat1f& z) : sums_(z.rows + 1, z.cols + 1, 0) {
        for (int r = 0; r < z.rows; ++r)
            for (int c = 0, row = 0; c < z.cols; ++c) {
                row += static_cast<int>(!std::isnan(z(r, c)));
                sums_(r + 1, c + 1) = sums_(r, c + 1) + row;
            }
    }
    /// Of the cells nearer than each power of two and than the radius: the share without data, beyond the border, too.
    [[nodiscard]] float missing(int row, int column, int radius) const {
        float sum = 0;
        int octaves = 0;
        for (int half = 1; half <= std::max(radius, 1); half *= 2, ++octaves) {
            const int top = std::max(row - half, 0), bottom = std::min(row + half + 1, sums_.rows - 1);
            const int left = std::max(column - half, 0), right = std::min(column + half + 1, sums_.cols - 1);
            const int known = sums_(bottom, right) - sums_(top, right) - sums_(bottom, left) + sums_(top, left);
            const auto side = static_cast<float>(2 * half + 1);
            sum += 1 - static_cast<float>(known) / (side * side);
        }
        return sum / static_cast<float>(octaves);
    }

  private:
    cv::Mat1i sums_;
};

/// What relief between cells does to a height, of a bend in cells: gentle relief is nearly bilinear, and walls stand
/// where they are found.
float hidden_by(float bend, float factor) {
    constexpr float gentle = 0.6F, steep = 3;
    return factor * bend * std::pow(bend, gentle) / (1 + steep * bend * bend);
}

/// Heights with errors once more. `slope`: of a height over one cell.
cv::Mat1f changed(const cv::Mat1f& z, const cv::Mat1f& errors, float factor, float slope, int first_row) {
    constexpr unsigned stream = 77;
    cv::Mat1f square = bend_of(z), own;
    cv::multiply(square, square, square);
    if (!errors.empty()) { // they bend the surface, too
        own = bend_of(errors);
        cv::multiply(own, own, own);
        own = mean_of_known(own, bent);
    }
    cv::Mat1f other(z.size());
    tbb::parallel_for(0, z.rows, [&](int r) {
        for (int c = 0; c < z.cols; ++c) {
            const float bend = square(r, c) - (own.empty() ? 0 : own(r, c));
            const float hidden =
                bend > 0 ? hidden_by(std::sqrt(bend) * slope, factor) / slope * white(first_row + r, c, stream)
                         : 0; // not of NaN
            const float error = errors.empty() || std::isnan(errors(r, c)) ? 0 : errors(r, c);
            other(r, c) = z(r, c) + error + hidden;
        }
    });
    return other;
}

/// How much more the first errors hid than the second ones, which are as large: as much where relief is large against
/// them. Where there is nothing but errors, slopes grow by sqrt(2), and what is hidden by less than the first time.
float of_first_errors(float bias, float hidden) {
    constexpr float most = 0.95F;
    hidden = std::clamp(hidden, 1e-6F, most);
    const float slope2 = hidden * hidden / (1 - hidden * hidden);
    const float level = std::sqrt(2 * slope2 / (1 + 2 * slope2)) / hidden - 1; // change over hidden, of level heights
    const float share = std::clamp(bias / hidden / level, 0.0F, 1.0F);
    constexpr float least = 0.65F, more = 1.3F; // as steps of cells are not independent of one another
    return 1 + ((least + more * hidden) / level - 1) * share * share;
}

/// Changes of the view around cells.
struct Pooled {
    Pooled(const cv::Mat1f& change, const cv::Mat1f& closed_there, int half)
        : mean(mean_of_known(change, half)), closed(mean_of_known(closed_there, half)) {
        cv::multiply(change, change, square);
        square = mean_of_known(square, half);
    }
    /// Of what the first errors did. `levels`: views fall with the size of errors, and not with their square.
    [[nodiscard]] float square_at(int r, int c, bool levels) const {
        const float bias = -mean(r, c), first = levels ? of_first_errors(bias, closed(r, c)) * bias : bias;
        return std::max(square(r, c) - bias * bias, 0.0F) + first * first;
    }

    cv::Mat1f mean, closed, square;
};

} // namespace

float drawn_error(int row, int column, int octave, unsigned stream) {
    if (octave <= 0)
        return white(row, column, stream);
    const int side = 1 << octave, r = row >> octave, c = column >> octave;
    const float y = static_cast<float>(row - r * side) / static_cast<float>(side),
                x = static_cast<float>(column - c * side) / static_cast<float>(side);
    const std::array weights{(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x};
    float sum = 0, squares = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        const int corner = static_cast<int>(i);
        sum += weights[i] * white(r + corner / 2, c + corner % 2, stream + static_cast<unsigned>(octave));
        squares += weights[i] * weights[i];
    }
    return sum / std::sqrt(squares);
}

cv::Mat1f mean_of_known(const cv::Mat1f& values, int half) {
    cv::Mat1f sums(values.size()), counts(values.size()), means(values.size());
    tbb::parallel_for(0, values.rows, [&](int r) {
        for (int c = 0; c < values.cols; ++c) {
            float sum = 0, count = 0;
            for (int x = std::max(c - half, 0); x <= std::min(c + half, values.cols - 1); ++x)
                if (const float value = values(r, x); !std::isnan(value))
                    sum += value, count += 1;
            sums(r, c) = sum, counts(r, c) = count;
        }
    });
    tbb::parallel_for(0, values.rows, [&](int r) {
        for (int c = 0; c < values.cols; ++c) {
            float sum = 0, count = 0;
            for (int y = std::max(r - half, 0); y <= std::min(r + half, values.rows - 1); ++y)
                sum += sums(y, c), count += counts(y, c);
            means(r, c) = count > 0 ? sum / count : std::nanf("");
        }
    });
    return means;
}

cv::Mat1f bend_of(const cv::Mat1f& z) {
    cv::Mat1f bends(z.size());
    tbb::parallel_for(0, z.rows, [&](int r) {
        for (int c = 0; c < z.cols; ++c) {
            float sum = 0, count = 0;
            const auto add = [&](float a, float b) {
                if (const float bend = (a + b) / 2 - z(r, c); !std::isnan(bend))
                    sum += bend * bend, count += 1;
            };
            if (c > 0 && c + 1 < z.cols)
                add(z(r, c - 1), z(r, c + 1));
            if (r > 0 && r + 1 < z.rows)
                add(z(r - 1, c), z(r + 1, c));
            bends(r, c) = count > 0 ? std::sqrt(sum / count) : std::nanf("");
        }
    });
    return bends;
}

cv::Mat1f svf_error_of(const HeightField& field, const Settings& settings, const cv::Mat1f& errors, cv::Range rows,
                       int first_row) {
    CV_Assert(errors.empty() || errors.size() == field.z.size());
    const Factors& factors = settings.profile == Profile::exact ? exact_factors : rvt_factors;
    const cv::Range more(std::max(rows.start - pooled_far, 0), std::min(rows.end + pooled_far, field.z.rows));
    const Wanted view{.svf = true};
    const cv::Mat1f here = layers_of(field, settings, view, more).svf;
    const HeightField other{
        changed(field.z, errors, factors.relief, static_cast<float>(settings.exaggeration / field.cell), first_row),
        field.cell};
    cv::Mat1f change, closed;
    cv::subtract(layers_of(other, settings, view, more).svf, here, change);
    cv::subtract(1, here, closed);
    const Pooled near(change, closed, pooled_near), far(change, closed, pooled_far);
    const KnownCells known(field.z);
    const int radius = static_cast<int>(settings.radius / field.cell);
    const bool levels = settings.definition == Definition::solid_angle;
    cv::Mat1f expected(rows.size(), field.z.cols, std::nanf(""));
    tbb::parallel_for(rows.start, rows.end, [&](int row) {
        const int r = row - more.start;
        for (int c = 0; c < field.z.cols; ++c) {
            if (std::isnan(field.z(row, c)))
                continue;
            const float heights = (near.square_at(r, c, levels) + far.square_at(r, c, levels)) / 2;
            const float missing = factors.missing * known.missing(row, c, radius) * far.closed(r, c);
            const float directions = factors.directions * far.closed(r, c) / static_cast<float>(settings.directions);
            constexpr float rest = 0.0015F; // that nothing explains
            expected(row - rows.start, c) =
                std::sqrt(heights + missing * missing + directions * directions + rest * rest);
        }
    });
    return expected;
}

int error_reach_of(double cell, const Settings& settings) {
    return reach_of(cell, settings, {.svf = true}) + pooled_far + bent + 1;
}

} // namespace scanshade::horizon
