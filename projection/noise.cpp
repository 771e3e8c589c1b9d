#include "projection/noise.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/depth_jumps.h"
#include "projection/depth_steps.h"
#include "projection/pixel_locking.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <vector>

namespace scanshade {
namespace {

constexpr int lag_px = 4; // longer than most sensors' own smoothing, shorter than most surfaces
constexpr int far_px = 8; // areas of one value are so large
constexpr std::array<int, 3> longer_px{8, 12, 16};
constexpr int step_px = 3; // every third pixel of every third row is plenty
constexpr int bands = 24;  // equal steps of log z over 0.2 .. 50 m
constexpr double nearest_m = 0.2, farthest_m = 50;
constexpr std::size_t enough = 400;             // samples a band needs
constexpr double least_disparity_px = 2.8;      // correlation length
constexpr double much_missing = 1.15;           // of sigma by differences over lag_px, whose pixels correlate
constexpr int small_px = 320, small_lag_px = 2; // in images less wide, slopes are shorter

/// Where depth goes on growing, or falling, over two lags.
struct Slope {
    float z_m;
    float rise_m; // |difference| of depth over the flatter lag
    float bend_m; // |second difference|
    float off_m;  // how far the difference to the next pixel is off its share of the lag's
};

struct Band {
    std::vector<float> spread_m;   // |second difference| of depth
    std::vector<float> adjacent_m; // of neighbouring pixels
    std::vector<Slope> slopes;
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
        append(slopes, other.slopes);
        for (std::size_t i = 0; i < longer_m.size(); ++i)
            append(longer_m[i], other.longer_m[i]);
        append(depths_m, other.depths_m);
        z_sum += other.z_sum;
    }
};

int band_of(double z) { return static_cast<int>(bands * std::log(z / nearest_m) / std::log(farthest_m / nearest_m)); }

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
            if (!(c > nearest_m && c < farthest_m) || std::binary_search(constants.begin(), constants.end(), c))
                continue;
            Band& band = all[static_cast<std::size_t>(std::min(band_of(c), bands - 1))];
            band.depths_m.push_back(c);
            const bool among_longer = (x - lag_px) / step_px % 2 == (y - lag_px) / step_px % 2; // half are plenty
            for (const auto& [dx, dy] : {std::pair{1, 0}, std::pair{0, 1}}) {
                const float d = second_difference(inverse, c, x, y, lag_px * dx, lag_px * dy),
                            adjacent = second_difference(inverse, c, x, y, dx, dy);
                if (d < 0 || adjacent < 0)
                    continue;
                band.spread_m.push_back(d);
                band.adjacent_m.push_back(adjacent);
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

struct Measured {
    double z;
    double near_sigma;        // by differences over lag_px
    double wide_sigma;        // by those over more pixels, too
    double adjacent, distant; // the deviations by adjacent pixels, and over lag_px, steps as they are
    double weight;
    double sigma = 0;    // what is believed of these
    bool hidden = false; // smaller than what a step explains: most values are on the same one
};

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
Measured measured_in(Band& band) {
    const double step = step_of(band.depths_m);
    const Sigmas distant = sigmas_of(band.spread_m), adjacent = sigmas_of(band.adjacent_m);
    const double dither = distant.most < 0.05 * step ? 0 : step; // else next to nothing would become something
    const bool quantised = step >= 0.5 * distant.most, by_most = quantised || distant.few >= distant.most;
    const double count = static_cast<double>(band.spread_m.size()),
                 variance = std::max(variance_of(band.spread_m, dither), 1e-12);
    Measured measured{.z = band.z_sum / count,
                      .near_sigma = std::sqrt(variance),
                      .wide_sigma = std::sqrt(wide_variance(variance, band, dither)),
                      .adjacent = by_most ? adjacent.most : adjacent.few,
                      .distant = std::max(by_most ? distant.most : distant.few, 1e-6),
                      .weight = count};
    if (quantised && band.spread_m.size() > 20 * band.depths_m.size()) {
        const double of_step = step / std::sqrt(12.0);
        measured.hidden = measured.near_sigma < of_step;
        measured.near_sigma = std::max(measured.near_sigma, of_step);
        measured.wide_sigma = std::max(measured.wide_sigma, of_step);
    }
    measured.hidden = measured.hidden || band.depths_m.size() == 1;
    measured.sigma = measured.near_sigma;
    return measured;
}

/// Variance of a second difference over `lag` pixels, in variances of one value, where values d pixels apart correlate
/// by exp(-d^2 / 2 s^2).
double second_difference_variance(double lag, double s) {
    const auto correlation = [s](double d) { return std::exp(-d * d / (2 * s * s)); };
    return 6 - 8 * correlation(lag) + 2 * correlation(2 * lag);
}

/// The deviation s of the correlation at which second differences of adjacent pixels are `ratio` times as large as over
/// lag_px.
double correlation_of(double ratio) {
    double low = 0.3, high = 3; // of s
    for (int i = 0; i < 30; ++i) {
        const double s = (low + high) / 2;
        const bool too_smooth =
            second_difference_variance(1, s) < ratio * ratio * second_difference_variance(lag_px, s);
        (too_smooth ? high : low) = s;
    }
    return low;
}

/// The integral of that correlation.
double length_of(double s) { return std::sqrt(2 * std::numbers::pi) * s; }

/// Where most values are on one step, little is known of their noise. Other depths tell more, if there are enough.
void forget_hidden(std::vector<Measured>& points) {
    constexpr double enough_share = 0.2;
    double told = 0, all = 0;
    for (const Measured& p : points)
        told += p.hidden ? 0 : p.weight, all += p.weight;
    if (told > enough_share * all)
        std::erase_if(points, [](const Measured& p) { return p.hidden; });
}

/// floor + per_z2 z^2 through the bands by least squares of relative error, both terms at least zero. Relative to each
/// band's sigma, since clutter only adds to these: the smaller ones are to be believed.
DepthNoise law_through(const std::vector<Measured>& points) {
    double s00 = 0, s01 = 0, s11 = 0, t0 = 0, t1 = 0;
    for (const Measured& p : points) {
        const double w = p.weight / (p.sigma * p.sigma), q = p.z * p.z;
        s00 += w, s01 += w * q, s11 += w * q * q, t0 += w * p.sigma, t1 += w * q * p.sigma;
    }
    const double determinant = s00 * s11 - s01 * s01;
    DepthNoise noise;
    if (determinant > 1e-9 * s00 * s11) {
        noise.floor_m = (t0 * s11 - t1 * s01) / determinant;
        noise.per_z2 = (t1 * s00 - t0 * s01) / determinant;
    } else {
        noise.floor_m = t0 / s00; // a single distance does not determine the growth
    }
    if (noise.per_z2 < 0)
        noise = {t0 / s00, 0};
    if (noise.floor_m < 0)
        noise = {0, t1 / s11};
    return noise;
}

/// Whether a value's error is that of rounding to a step, and hardly more. Noise would show between adjacent pixels and
/// over more of them, at most depths. Noise that a sensor has smoothed would show over more pixels at all depths; a
/// scene's relief, which looks like it, leaves some even. A Kinect's disparity, whose noise shows over more pixels,
/// errs by 1.4 to 2.8 times what rounding explains. What is rounded more finely than by any sensor may err more.
bool explains(const DepthSteps& steps, const std::vector<Measured>& points) {
    const bool even = steps.step_m > 0 && !steps.halves, coarse = steps.step_per_z2 > 0.0005;
    double all = 0, rounded = 0, distant = 0;
    for (const Measured& p : points) {
        const double sigma = steps.sigma(p.z);
        const bool is_rounded = even     ? std::min(p.adjacent, p.distant) < 1.6 * sigma
                                : coarse ? p.wide_sigma < 1.15 * sigma
                                         : p.near_sigma < 2 * sigma;
        all += p.weight;
        rounded += is_rounded ? p.weight : 0;
        distant += p.sigma < 3 * sigma ? p.weight : 0;
    }
    return rounded > 0.5 * all && distant > 0.1 * all;
}

/// Whether a step between adjacent pixels tilts the surface by more than AO bears.
bool tilts(const DepthSteps& steps, double focal_px, const std::vector<Measured>& points) {
    constexpr double most = 0.7;
    double slopes = 0, weights = 0;
    for (const Measured& p : points)
        slopes += p.weight * steps.at(p.z) * focal_px / p.z, weights += p.weight;
    return slopes > most * weights;
}

/// Whether sigma is so small that nothing needs smoothing.
bool is_clean(const std::vector<Measured>& points) {
    const DepthNoise seen = law_through(points);
    return std::ranges::all_of(points, [&](const Measured& p) { return seen.at(p.z) < std::max(1e-4 * p.z, 1.2e-4); });
}

/// Whether depth is exact, for all that it seems noisy: the rows of a floor before a level camera are far apart, too,
/// and where much of an image is edges, these count. Exact slopes are straight to a fraction of that sigma, and rise by
/// as much from each pixel to the next. Noise bends them, and a sensor's steps are stairs.
bool is_straight(const std::vector<Slope>& slopes, const DepthNoise& noise, double rounding_m) {
    constexpr double enough_slopes = 100, least_share = 0.6;
    double all = 0, straight = 0;
    for (const Slope& slope : slopes)
        if (const double sigma = noise.at(slope.z_m); slope.rise_m > 2 * sigma) {
            const double most_bend_m = std::max(sigma / 3, std::min(1.5 * rounding_m, 0.8 * sigma)),
                         most_off_m = 0.1 * slope.rise_m + 0.7 * rounding_m;
            ++all;
            straight += slope.bend_m < most_bend_m && slope.off_m < most_off_m ? 1 : 0;
        }
    return all > enough_slopes && straight > least_share * all;
}

/// Whether what seems to be noise is relief: uneven ground, rows of books. It is smooth from pixel to pixel, as only a
/// sensor's depth is that was resized or smoothed. Then jumps are smeared, or, with a Kinect's drivers, the noise is
/// large.
bool is_relief(const DepthNoise& noise, const JumpsSeen& jumps) {
    constexpr double smooth_px = 5, least_sharp = 0.3, far_m = 2, most_m = 0.004;
    return noise.step_per_z2 == 0 && noise.correlation_px >= smooth_px && noise.at(far_m) < most_m &&
           jumps.sharp_share > least_sharp;
}

/// Chooses each band's sigma, and returns the deviation of the correlation.
double settle(std::vector<Measured>& points, const DepthSteps& steps) {
    double ratios = 0, weights = 0;
    for (const Measured& p : points)
        ratios += p.weight * p.adjacent / p.distant, weights += p.weight;
    const double s = correlation_of(ratios / weights);
    const double missing = std::sqrt(6 / second_difference_variance(lag_px, s)); // what correlates over the lag
    const bool disparity = steps.step_per_z2 > 0; // it comes from windows of pixels, which jumps between steps hide
    const bool wide = disparity || missing > much_missing;
    for (Measured& p : points)
        p.sigma =
            wide ? std::max(p.wide_sigma, std::min(p.near_sigma, p.wide_sigma) * missing) : p.near_sigma * missing;
    double coarse = 0; // steps that hide what adjacent pixels have in common
    for (const Measured& p : points)
        coarse += steps.sigma(p.z) > 0.25 * p.near_sigma ? p.weight : 0;
    return disparity && coarse > 0.5 * weights ? std::max(s, least_disparity_px / length_of(1)) : s;
}

/// Of errors that are uniform over a step.
DepthNoise law_of(const DepthSteps& steps, std::vector<Measured> points) {
    if (!steps.halves)
        return {.floor_m = steps.step_m / std::sqrt(12.0), .per_z2 = steps.step_per_z2 / std::sqrt(12.0)};
    for (Measured& p : points)
        p.sigma = steps.sigma(p.z);
    return law_through(points);
}

double largest_focal_px(std::span<const DepthImage> images) {
    double focal_px = 0;
    for (const DepthImage& image : images)
        focal_px = std::max(focal_px, image.camera.fx);
    return focal_px;
}

/// All bands of some images.
struct Survey {
    std::vector<Measured> points;
    std::vector<float> values_m; ///< the distinct depths, in order
    std::vector<Slope> slopes;
};

Survey survey_of(std::span<const DepthImage> images) {
    std::vector<std::array<Band, bands>> each(images.size());
    std::array<Band, bands> all;
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), images.size(), [&](std::size_t i) { collect(images[i].z_m, each[i]); });
        tbb::parallel_for(std::size_t(0), all.size(), [&](std::size_t i) {
            for (std::array<Band, bands>& of_image : each) // in order: results do not depend on timing
                all[i].take(std::move(of_image[i]));
        });
    });
    std::array<std::optional<Measured>, bands> measured;
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(std::size_t(0), all.size(), [&](std::size_t i) {
            Band& band = all[i];
            keep_distinct(band.depths_m);
            if (band.spread_m.size() >= enough)
                measured[i] = measured_in(band);
        });
    });
    Survey survey;
    for (std::size_t i = 0; i < all.size(); ++i) {
        survey.values_m.insert(survey.values_m.end(), all[i].depths_m.begin(), all[i].depths_m.end());
        survey.slopes.insert(survey.slopes.end(), all[i].slopes.begin(), all[i].slopes.end());
        if (measured[i])
            survey.points.push_back(*measured[i]);
    }
    return survey;
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
                if (const float z_m = image.recorded_m(y, x); z_m > nearest_m && z_m < farthest_m)
                    values_m.push_back(z_m);
    keep_distinct(values_m);
    return values_m;
}

/// 1/z of some thousand pixels as they were recorded.
std::vector<float> some_inverse_depths(std::span<const DepthImage> images) {
    constexpr double wanted = 4000;
    double pixels = 0;
    for (const DepthImage& image : images)
        pixels += static_cast<double>(image.z_m.total());
    const int every = std::max(1, static_cast<int>(std::sqrt(pixels / wanted)));
    std::vector<float> inverse_m;
    for (const DepthImage& image : images) {
        const cv::Mat1f& z_m = image.recorded_m.empty() ? image.z_m : image.recorded_m;
        for (int y = every / 2; y < z_m.rows; y += every)
            for (int x = every / 2; x < z_m.cols; x += every)
                if (z_m(y, x) > nearest_m && z_m(y, x) < farthest_m)
                    inverse_m.push_back(1 / z_m(y, x));
    }
    return inverse_m;
}

} // namespace

DepthNoise measure_noise(std::span<const DepthImage> images) {
    auto [points, values_m, slopes] = survey_of(images);
    const DepthSteps steps = steps_of(are_interpolated(images) ? recorded_values_of(images) : values_m);
    const JumpsSeen jumps = jumps_of(images);
    const DepthNoise exact{.step_m = steps.step_m, .step_per_z2 = steps.step_per_z2, .jumps = jumps.kind};
    forget_hidden(points);
    if (points.empty() || is_clean(points))
        return exact;
    const double s = settle(points, steps);
    const bool rounded = explains(steps, points);
    if (rounded && !tilts(steps, largest_focal_px(images), points))
        return exact;
    DepthNoise noise = rounded ? law_of(steps, points) : law_through(points);
    noise.correlation_px = std::max(1.0, length_of(s));
    noise.step_m = steps.step_m, noise.step_per_z2 = steps.step_per_z2;
    if (steps.step_per_z2 > 0)
        noise.per_z2 = std::hypot(noise.per_z2, locking_of(some_inverse_depths(images), steps.step_per_z2));
    const bool coarse = rounded && steps.step_m > 0; // steps are stairs, too
    if (!coarse && (is_straight(slopes, noise, steps.rounding_m) || is_relief(noise, jumps)))
        return exact;
    noise.jumps = rounded ? exact.jumps : Jumps::unknown;
    return noise;
}

DepthNoise noise_from_text(const std::string& text) {
    if (text == "none")
        return {};
    if (text == "kinect")
        return {0.0015, 0.0018, 3};
    if (text == "tof")
        return {0.0015, 0};
    DepthNoise noise;
    int used = 0;
    const bool law = std::sscanf(text.c_str(), "%lf,%lf%n", &noise.floor_m, &noise.per_z2, &used) == 2;
    if (law && used < static_cast<int>(text.size())) { // with a correlation length
        int more = 0;
        if (std::sscanf(text.c_str() + used, ",%lf%n", &noise.correlation_px, &more) == 1)
            used += more;
    }
    if (!law || used != static_cast<int>(text.size()) ||
        !(noise.floor_m >= 0 && noise.floor_m < 1 && noise.per_z2 >= 0 && noise.per_z2 < 1) ||
        !(noise.correlation_px >= 1 && noise.correlation_px <= 16))
        throw Misuse(
            "depth noise '" + text +
            "': auto, none, kinect, tof or FLOOR,PER_Z2[,CORRELATION] (metres, 0 .. 1; pixels, 1 .. 16) expected");
    return noise;
}

std::string describe(const DepthNoise& noise, const LengthUnit& unit) {
    const auto factor = [&](double per_z2) { return unit.arbitrary() ? per_z2 / unit.units_per_length : per_z2; };
    std::string text = "none";
    if (noise.any() && unit.arbitrary())
        text = fmt::format("sigma {:.3g} + {:.3g} z^2 units, correlation length {:.1f} px", unit.told(noise.floor_m),
                           factor(noise.per_z2), noise.correlation_px);
    else if (noise.any())
        text = fmt::format("sigma {:.5f} + {:.5f} z^2 m, correlation length {:.1f} px", noise.floor_m, noise.per_z2,
                           noise.correlation_px);
    if (noise.step_m > 0)
        text += fmt::format(", steps of {}", unit.text(noise.step_m, 2));
    if (noise.step_per_z2 > 0)
        text += fmt::format(", steps of {:.2g} z^2 {}", factor(noise.step_per_z2), unit.name());
    if (noise.jumps == Jumps::smeared)
        text += ", edges smeared over several pixels";
    return text;
}

} // namespace scanshade
