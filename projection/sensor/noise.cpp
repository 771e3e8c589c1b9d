#include "projection/sensor/noise.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/sensor/depth_jumps.h"
#include "projection/sensor/depth_steps.h"
#include "projection/sensor/noise_survey.h"
#include "projection/sensor/pixel_locking.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <numbers>
#include <vector>

namespace scanshade {
namespace {

constexpr double least_disparity_px = 2.8; // correlation length
constexpr double much_missing = 1.15;      // of sigma by differences over noise_lag_px, whose pixels correlate

/// Variance of a second difference over `lag` pixels, in variances of one value, where values d pixels apart correlate
/// by exp(-d^2 / 2 s^2).
double second_difference_variance(double lag, double s) {
    const auto correlation = [s](double d) { return std::exp(-d * d / (2 * s * s)); };
    return 6 - 8 * correlation(lag) + 2 * correlation(2 * lag);
}

/// The deviation s of the correlation at which second differences of adjacent pixels are `ratio` times as large as over
/// `lag` pixels.
double correlation_of(double ratio, int lag) {
    double low = 0.3, high = 3; // of s
    for (int i = 0; i < 30; ++i) {
        const double s = (low + high) / 2;
        const bool too_smooth = second_difference_variance(1, s) < ratio * ratio * second_difference_variance(lag, s);
        (too_smooth ? high : low) = s;
    }
    return low;
}

/// The integral of that correlation.
double length_of(double s) { return std::sqrt(2 * std::numbers::pi) * s; }

/// Where most values are on one step, little is known of their noise. Other depths tell more, if there are enough.
void forget_hidden(std::vector<NoiseBand>& points) {
    constexpr double enough_share = 0.2;
    double told = 0, all = 0;
    for (const NoiseBand& p : points)
        told += p.hidden ? 0 : p.weight, all += p.weight;
    if (told > enough_share * all)
        std::erase_if(points, [](const NoiseBand& p) { return p.hidden; });
}

/// floor + per_z2 z^2 through the bands by least squares of relative error, both terms at least zero. Relative to each
/// band's sigma, since clutter only adds to these: the smaller ones are to be believed.
DepthNoise law_through(const std::vector<NoiseBand>& points) {
    double s00 = 0, s01 = 0, s11 = 0, t0 = 0, t1 = 0;
    for (const NoiseBand& p : points) {
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
bool explains(const DepthSteps& steps, const std::vector<NoiseBand>& points) {
    const bool even = steps.step_m > 0 && !steps.halves, coarse = steps.step_per_z2 > 0.0005;
    double all = 0, rounded = 0, distant = 0;
    for (const NoiseBand& p : points) {
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
bool tilts(const DepthSteps& steps, double focal_px, const std::vector<NoiseBand>& points) {
    constexpr double most = 0.7;
    double slopes = 0, weights = 0;
    for (const NoiseBand& p : points)
        slopes += p.weight * steps.at(p.z) * focal_px / p.z, weights += p.weight;
    return slopes > most * weights;
}

/// Whether sigma is so small that nothing needs smoothing.
bool is_clean(const std::vector<NoiseBand>& points) {
    const DepthNoise seen = law_through(points);
    return std::ranges::all_of(points, [&](const NoiseBand& p) { return seen.at(p.z) < std::max(1e-4 * p.z, 1.2e-4); });
}

/// Whether depth is exact, for all that it seems noisy: the rows of a floor before a level camera are far apart, too,
/// and where much of an image is edges, these count. Exact slopes are straight to a fraction of that sigma, and rise by
/// as much from each pixel to the next. Noise bends them, and a sensor's steps are stairs.
bool is_straight(const std::vector<DepthSlope>& slopes, const DepthNoise& noise, double rounding_m) {
    constexpr double enough_slopes = 100, least_share = 0.6;
    double all = 0, straight = 0;
    for (const DepthSlope& slope : slopes)
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
///
/// Relief shows over noise_lag_px as noise does whose pixels correlate. Over two pixels there is hardly any: where
/// their differences are no larger than those of adjacent pixels, each pixel errs by itself, and these tell by how
/// much.
double settle(std::vector<NoiseBand>& points, const DepthSteps& steps) {
    double ratios = 0, near_ratios = 0, weights = 0;
    for (const NoiseBand& p : points)
        ratios += p.weight * p.adjacent / p.distant, near_ratios += p.weight * p.adjacent / p.over_two,
            weights += p.weight;
    const double s = correlation_of(ratios / weights, noise_lag_px), near_s = correlation_of(near_ratios / weights, 2);
    const auto missing_over = [](int lag, double deviation) {
        return std::sqrt(6 / second_difference_variance(lag, deviation));
    };
    const bool disparity = steps.step_per_z2 > 0; // it comes from windows of pixels, which jumps between steps hide
    if (!disparity && length_of(near_s) < independent_px) {
        for (NoiseBand& p : points)
            p.sigma = p.pixel_sigma * missing_over(1, near_s);
        return near_s;
    }
    const double missing = missing_over(noise_lag_px, s); // what correlates over the lag
    const bool wide = disparity || missing > much_missing;
    for (NoiseBand& p : points)
        p.sigma =
            wide ? std::max(p.wide_sigma, std::min(p.near_sigma, p.wide_sigma) * missing) : p.near_sigma * missing;
    double coarse = 0; // steps that hide what adjacent pixels have in common
    for (const NoiseBand& p : points)
        coarse += steps.sigma(p.z) > 0.25 * p.near_sigma ? p.weight : 0;
    return disparity && coarse > 0.5 * weights ? std::max(s, least_disparity_px / length_of(1)) : s;
}

/// Of errors that are uniform over a step.
DepthNoise law_of(const DepthSteps& steps, std::vector<NoiseBand> points) {
    if (!steps.halves)
        return {.floor_m = steps.step_m / std::sqrt(12.0), .per_z2 = steps.step_per_z2 / std::sqrt(12.0)};
    for (NoiseBand& p : points)
        p.sigma = steps.sigma(p.z);
    return law_through(points);
}

double largest_focal_px(std::span<const DepthImage> images) {
    double focal_px = 0;
    for (const DepthImage& image : images)
        focal_px = std::max(focal_px, image.camera.fx);
    return focal_px;
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
                if (z_m(y, x) > noise_nearest_m && z_m(y, x) < noise_farthest_m)
                    inverse_m.push_back(1 / z_m(y, x));
    }
    return inverse_m;
}

} // namespace

DepthNoise measure_noise(std::span<const DepthImage> images) {
    auto [points, values_m, slopes] = noise_survey_of(images);
    const DepthSteps steps = steps_of(values_m);
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
