#include "projection/sensor/noise_survey.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <utility>

namespace scanshade {
namespace {

constexpr int lag_px = noise_lag_px;
constexpr int far_px = 8; // areas of one value are so large
constexpr std::array<int, 3> longer_px{8, 12, 16};
constexpr int step_px = 3;                      // every third pixel of every third row is plenty
constexpr int bands = 24;                       // equal steps of log z over all depths
constexpr std::size_t enough = 400;             // samples a band needs
constexpr int small_px = 320, small_lag_px = 2; // in images less wide, slopes are shorter

struct Band {
    std::vector<float> spread_m;   // |second difference| of depth
    std::vector<float> adjacent_m; // of neighbouring pixels
    std::vector<float> over_two_m; // over two pixels
    std::vector<DepthSlope> slopes;
    std::array<std::vector<float>, longer_px.size()> longer_m;
    std::vector<float> depths_m; // at their middles; keep_distinct() reduces them to the distinct values
    double z_sum = 0;

    void take(Band&& other) {
        const auto append = [](auto& to, auto& from) {
            if (to.empty())
                to = std::move(from);
            else
                to.insert(to.end(), from.begin(), from.end());
        };
        append(spread_m, other.spread_m);
        append(adjacent_m, other.adjacent_m);
        append(over_two_m, other.over_two_m);
        append(slopes, other.slopes);
        for (std::size_t i = 0; i < longer_m.size(); ++i)
            append(longer_m[i], other.longer_m[i]);
        append(depths_m, other.depths_m);
        z_sum += other.z_sum;
    }
};

int band_of(double z) {
    return static_cast<int>(bands * std::log(z / noise_nearest_m) / std::log(noise_farthest_m / noise_nearest_m));
}

/// 1/z, 0 at holes.
cv::Mat1f inverse_of(const cv::Mat1f& z) {
    cv::Mat1f inverse(z.size());
    for (int y = 0; y < z.rows; ++y)
        std::transform(z[y], z[y] + z.cols, inverse[y], [](float value) { return value > 0 ? 1 / value : 0.0F; });
    return inverse;
}

/// Second difference of 1/z along (dx, dy), as metres of depth at `z_m`; negative where something is unknown.
float second_difference(const cv::Mat1f& inverse, float z_m, int x, int y, int dx, int dy) {
    if (x < dx || y < dy || x + dx >= inverse.cols || y + dy >= inverse.rows)
        return -1;
    const float c = inverse(y, x), a = inverse(y - dy, x - dx), b = inverse(y + dy, x + dx);
    return a > 0 && b > 0 ? std::abs(a + b - 2 * c) * z_m * z_m : -1;
}

/// The values that fill areas exactly, and of which there are several times as many as of those next to them: a frame
/// of one value, the end of a sensor's range, what a file holds where it knows nothing. No noise shows there. Steps of
/// slanted surfaces fill areas, too, but alike.
std::vector<float> constants_of(const cv::Mat1f& z) {
    constexpr std::size_t fewest = 50, by_neighbour = 5;
    constexpr double least_share = 0.005;
    std::vector<float> flat;
    std::size_t valid = 0;
    for (int y = far_px; y < z.rows - far_px; y += step_px)
        for (int x = far_px; x < z.cols - far_px; x += step_px) {
            const float c = z(y, x);
            valid += c > 0;
            if (c > 0 && z(y, x - far_px) == c && z(y, x + far_px) == c && z(y - far_px, x) == c &&
                z(y + far_px, x) == c)
                flat.push_back(c);
        }
    const std::size_t least = std::max(fewest, static_cast<std::size_t>(least_share * static_cast<double>(valid)));
    if (flat.size() < least)
        return {};
    std::sort(flat.begin(), flat.end());
    std::vector<std::pair<float, std::size_t>> counts;
    for (const float value : flat) {
        if (counts.empty() || counts.back().first != value)
            counts.emplace_back(value, 0);
        ++counts.back().second;
    }
    std::vector<float> constants;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        const std::size_t below = i > 0 ? counts[i - 1].second : 0,
                          above = i + 1 < counts.size() ? counts[i + 1].second : 0;
        if (counts[i].second >= std::max(least, by_neighbour * std::max(below, above)))
            constants.push_back(counts[i].first);
    }
    return constants;
}

void collect(const cv::Mat1f& z, std::array<Band, bands>& all) {
    const std::vector<float> constants = constants_of(z);
    const cv::Mat1f inverse = inverse_of(z);
    const int slope_px = z.cols < small_px ? small_lag_px : lag_px;
    for (int y = lag_px; y < z.rows - lag_px; y += step_px)
        for (int x = lag_px; x < z.cols - lag_px; x += step_px) {
            const float c = z(y, x);
            if (!(c > noise_nearest_m && c < noise_farthest_m) ||
                std::binary_search(constants.begin(), constants.end(), c))
                continue;
            Band& band = all[static_cast<std::size_t>(std::min(band_of(c), bands - 1))];
            band.depths_m.push_back(c);
            const bool among_longer = (x - lag_px) / step_px % 2 == (y - lag_px) / step_px % 2; // half are plenty
            for (const auto& [dx, dy] : {std::pair{1, 0}, std::pair{0, 1}}) {
                const float d = second_difference(inverse, c, x, y, lag_px * dx, lag_px * dy),
                            adjacent = second_difference(inverse, c, x, y, dx, dy),
                            over_two = second_difference(inverse, c, x, y, 2 * dx, 2 * dy);
                if (d < 0 || adjacent < 0 || over_two < 0)
                    continue;
                band.spread_m.push_back(d);
                band.adjacent_m.push_back(adjacent);
                band.over_two_m.push_back(over_two);
                const float before = c - z(y - slope_px * dy, x - slope_px * dx),
                            after = z(y + slope_px * dy, x + slope_px * dx) - c;
                if (before * after > 0)
                    band.slopes.push_back(
                        {.z_m = c,
                         .rise_m = std::min(std::abs(before), std::abs(after)),
                         .bend_m = second_difference(inverse, c, x, y, slope_px * dx, slope_px * dy),
                         .off_m = std::abs(z(y + dy, x + dx) - c - after / static_cast<float>(slope_px))});
                for (std::size_t i = 0; among_longer && i < longer_px.size(); ++i)
                    if (const float far = second_difference(inverse, c, x, y, longer_px[i] * dx, longer_px[i] * dy);
                        far >= 0)
                        band.longer_m[i].push_back(far);
                band.z_sum += c;
            }
        }
}

/// Sigma by the means of the smallest differences, assumed Gaussian: the lower 40 % of |N(0, 1)| have the mean 0.2563,
/// the lower 80 % 0.5586, and their median is 0.6745. A second difference of three independent values has sqrt(6) times
/// the deviation of one.
struct Sigmas {
    double few, middle, most;
};
Sigmas sigmas_of(std::vector<float>& spread_m) {
    const auto first = spread_m.begin();
    const auto at = [&](double share) {
        return first + static_cast<std::ptrdiff_t>(share * static_cast<double>(spread_m.size()));
    };
    const auto few = at(0.4), middle = at(0.5), most = at(0.8);
    std::nth_element(first, most, spread_m.end()); // from the largest share down, each within the last
    std::nth_element(first, middle, most);
    std::nth_element(first, few, middle);
    const double of_few = std::accumulate(first, few, 0.0), of_most = std::accumulate(few, most, of_few);
    const auto mean = [&](double sum, auto end) {
        return sum / static_cast<double>(std::max<std::ptrdiff_t>(end - first, 1));
    };
    const double one = std::sqrt(6.0);
    return {mean(of_few, few) / (0.2563 * one), *middle / (0.6745 * one), mean(of_most, most) / (0.5586 * one)};
}

/// Sorts the values and drops duplicates.
void keep_distinct(std::vector<float>& values) {
    std::sort(values.begin(), values.end());
    values.erase(std::unique(values.begin(), values.end()), values.end());
}

/// The median distance between distinct values: the sensor's step, where it has one.
double step_of(const std::vector<float>& depths_m) {
    if (depths_m.size() < 2)
        return 0;
    std::vector<float> gaps(depths_m.size() - 1);
    for (std::size_t i = 0; i < gaps.size(); ++i)
        gaps[i] = depths_m[i + 1] - depths_m[i];
    return median(std::move(gaps));
}

/// Variance of one value by its smallest differences. Those of values in steps are whole steps, half of them often 0,
/// which tells nothing of how large they are: spread evenly over a step (dithered) they tell it, and more by the
/// variance of that (Sheppard). A sensor that smooths steps leaves small differences on them and large ones between
/// them: the smallest tell too little, and the median too much. Then four fifths give hardly more than the median; with
/// edges among them they would.
double variance_of(std::vector<float>& spread_m, double step_m) {
    double share = 0; // of the step
    for (float& value : spread_m) {
        share += std::numbers::phi - 1; // never near where it has been
        share -= std::floor(share);
        value = std::abs(value + static_cast<float>(step_m * (share - 0.5)));
    }
    const auto [few, middle, most] = sigmas_of(spread_m);
    const double without_edges = middle > 0 ? std::clamp((1.2 * middle - most) / (0.1 * middle), 0.0, 1.0) : 0;
    const double sigma = few + 0.5 * without_edges * std::max(middle - few, 0.0);
    return std::max(sigma * sigma - step_m * step_m / 72, 0.0);
}

/// The variance that noise has over more pixels than lag_px, over which it has `variance`, where the sensor takes
/// depths from windows of pixels. Surfaces that bend or end have a share of the differences that grows with the square
/// of the lag, or faster. The lags between which least is added tell that share; what is left of the others is noise.
double wide_variance(double variance, Band& band, double step_m) {
    constexpr double least = 0.5, most = 2.5 * 2.5; // what grows faster is fine structure
    constexpr double slack = 0.2;                   // so much more than over lag_px are surfaces
    std::array<double, longer_px.size()> longer{};
    double surfaces = std::numeric_limits<double>::infinity(), before = variance; // per square of the lag
    for (std::size_t i = 0; i < longer_px.size(); ++i) {
        if (band.longer_m[i].size() < enough)
            return variance;
        longer[i] = variance_of(band.longer_m[i], step_m);
        const int lag = longer_px[i], shorter = i > 0 ? longer_px[i - 1] : lag_px;
        surfaces = std::min(surfaces, std::max(longer[i] - before, 0.0) / (lag * lag - shorter * shorter));
        before = longer[i];
    }
    const double near = std::max(variance - surfaces * lag_px * lag_px, least * variance);
    double noise = near;
    for (std::size_t i = 0; i + 1 < longer_px.size(); ++i)
        noise = std::max(noise, longer[i] - surfaces * longer_px[i] * longer_px[i]);
    return std::clamp(noise - slack * near, near, most * near);
}

/// Among clutter more than a fifth of the differences straddle an edge, so the smaller share decides. A value that
/// comes in steps errs by a root of 1/12 of the step or more.
NoiseBand measured_in(Band& band) {
    const double step = step_of(band.depths_m);
    const Sigmas distant = sigmas_of(band.spread_m), adjacent = sigmas_of(band.adjacent_m),
                 over_two = sigmas_of(band.over_two_m);
    const double dither = distant.most < 0.05 * step ? 0 : step; // else next to nothing would become something
    const bool quantised = step >= 0.5 * distant.most, by_most = quantised || distant.few >= distant.most;
    const double count = static_cast<double>(band.spread_m.size()),
                 variance = std::max(variance_of(band.spread_m, dither), 1e-12),
                 of_pixel = std::max(variance_of(band.adjacent_m, dither), 1e-12);
    NoiseBand measured{.z = band.z_sum / count,
                       .pixel_sigma = std::sqrt(of_pixel),
                       .near_sigma = std::sqrt(variance),
                       .wide_sigma = std::sqrt(wide_variance(variance, band, dither)),
                       .adjacent = by_most ? adjacent.most : adjacent.few,
                       .over_two = std::max(by_most ? over_two.most : over_two.few, 1e-6),
                       .distant = std::max(by_most ? distant.most : distant.few, 1e-6),
                       .weight = count};
    if (quantised && band.spread_m.size() > 20 * band.depths_m.size()) {
        const double of_step = step / std::sqrt(12.0);
        measured.hidden = measured.near_sigma < of_step;
        measured.pixel_sigma = std::max(measured.pixel_sigma, of_step);
        measured.near_sigma = std::max(measured.near_sigma, of_step);
        measured.wide_sigma = std::max(measured.wide_sigma, of_step);
    }
    measured.hidden = measured.hidden || band.depths_m.size() == 1;
    measured.sigma = measured.near_sigma;
    return measured;
}

bool are_interpolated(std::span<const DepthImage> images) {
    return std::ranges::any_of(images, [](const DepthImage& image) { return !image.recorded_m.empty(); });
}

/// The distinct depths before a lens's distortion was removed, in order: interpolation hides their steps.
std::vector<float> recorded_values_of(std::span<const DepthImage> images) {
    std::vector<float> values_m;
    for (const DepthImage& image : images)
        for (int y = 0; y < image.recorded_m.rows; y += step_px)
            for (int x = 0; x < image.recorded_m.cols; x += step_px)
                if (const float z_m = image.recorded_m(y, x); z_m > noise_nearest_m && z_m < noise_farthest_m)
                    values_m.push_back(z_m);
    keep_distinct(values_m);
    return values_m;
}

} // namespace

NoiseSurvey noise_survey_of(std::span<const DepthImage> images) {
    std::vector<std::array<Band, bands>> each(images.size());
    std::array<Band, bands> all;
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), images.size(), [&](std::size_t i) { collect(images[i].z_m, each[i]); });
        tbb::parallel_for(std::size_t(0), all.size(), [&](std::size_t i) {
            for (std::array<Band, bands>& of_image : each) // in order: results do not depend on timing
                all[i].take(std::move(of_image[i]));
        });
    });
    std::array<std::optional<NoiseBand>, bands> measured;
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), all.size(), [&](std::size_t i) {
            Band& band = all[i];
            keep_distinct(band.depths_m);
            if (band.spread_m.size() >= enough)
                measured[i] = measured_in(band);
        });
    });
    const bool interpolated = are_interpolated(images);
    NoiseSurvey survey;
    if (interpolated)
        survey.values_m = recorded_values_of(images);
    for (std::size_t i = 0; i < all.size(); ++i) {
        if (!interpolated)
            survey.values_m.insert(survey.values_m.end(), all[i].depths_m.begin(), all[i].depths_m.end());
        survey.slopes.insert(survey.slopes.end(), all[i].slopes.begin(), all[i].slopes.end());
        if (measured[i])
            survey.bands.push_back(*measured[i]);
    }
    return survey;
}

} // namespace scanshade
