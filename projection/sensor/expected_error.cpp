#include "projection/sensor/expected_error.h"

#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <tbb/parallel_for.h>
#include <utility>

namespace scanshade {
namespace {

constexpr float most_noise = 1e6F; // sigma / radius where there is no radius: nothing is told apart from noise
constexpr float never_seen = -std::numeric_limits<float>::infinity(); // in front of no ball

/// The image in which signs are looked for.
struct SeenDepth {
    SeenDepth(const DepthImage& depth, const cv::Mat1f& values, double radius_m, const DepthNoise& sigma)
        : z_m(depth.z_m), visibility(values), radius(static_cast<float>(radius_m)),
          fx(static_cast<float>(depth.camera.fx)), fy(static_cast<float>(depth.camera.fy)), noise(sigma) {
        if (visibility.size() != z_m.size())
            throw Error(fmt::format("visibility is {}x{}, its depth image {}x{}", visibility.cols, visibility.rows,
                                    z_m.cols, z_m.rows));
    }

    const cv::Mat1f &z_m, &visibility;
    float radius, fx, fy;
    DepthNoise noise;

    /// Pixels without visibility count as holes.
    [[nodiscard]] float at(int v, int u) const {
        const float z = z_m(v, u);
        return std::isnan(visibility(v, u)) || !(z > 0) ? never_seen : z;
    }

    [[nodiscard]] bool inside(int v, int u) const {
        return static_cast<unsigned>(u) < static_cast<unsigned>(z_m.cols) &&
               static_cast<unsigned>(v) < static_cast<unsigned>(z_m.rows);
    }

    [[nodiscard]] float share_of_ball(int v, int u) const {
        const float z = at(v, u), across = std::min(radius * fx / z, 1e6F), down = std::min(radius * fy / z, 1e6F);
        int seen = 0;
        for (const cv::Point2f& seed : seeds_of_ball()) {
            const int x = u + cvRound(seed.x * across), y = v + cvRound(seed.y * down);
            seen += inside(y, x) && at(y, x) > z - radius;
        }
        return static_cast<float>(seen) / static_cast<float>(shared::ball_seeds);
    }

    /// A pair of opposite pixels: planes are straight lines in 1/z, so |1/a + 1/b - 2/z| z^2 is by how far, in metres,
    /// the three are not on one.
    void look_at_pair(int v, int u, int dv, int du, float jump, bool& jumps, bool& holes) const {
        const float z = at(v, u);
        const bool has_a = inside(v + dv, u + du), has_b = inside(v - dv, u - du);
        const float a = has_a ? at(v + dv, u + du) : z, b = has_b ? at(v - dv, u - du) : z;
        holes = holes || a == never_seen || b == never_seen;
        jumps = jumps || (has_a && has_b && a != never_seen && b != never_seen &&
                          std::abs(z * (a + b) - 2 * a * b) * z > jump * a * b);
    }

    [[nodiscard]] ErrorSigns signs(int v, int u) const {
        const float z = at(v, u), sigma = static_cast<float>(noise.at(z));
        const float jump = shared::jump_radii * radius + shared::jump_sigmas * sigma;
        ErrorSigns signs{share_of_ball(v, u), shared::error_rings, shared::error_rings, radius * std::sqrt(fx * fy) / z,
                         radius > 0 ? sigma / radius : most_noise};
        for (int ring = shared::error_rings - 1; ring >= 0; --ring) {
            const int across = shared::ring_across(ring), slope = shared::ring_is_diagonal(ring) ? across : 0;
            bool jumps = false, holes = false;
            look_at_pair(v, u, slope, across, jump, jumps, holes);
            look_at_pair(v, u, across, -slope, jump, jumps, holes);
            signs.edge = jumps ? ring : signs.edge;
            signs.hole = holes ? ring : signs.hole;
        }
        return signs;
    }
};

/// The knot below a position, and how far it is to the next.
std::pair<int, float> knot_below(float position, int knots) {
    const float within = std::clamp(position, 0.0F, static_cast<float>(knots - 1));
    const int below = std::min(static_cast<int>(within), knots - 2);
    return {below, within - static_cast<float>(below)};
}

} // namespace

const std::array<cv::Point2f, shared::ball_seeds>& seeds_of_ball() {
    static const std::array<cv::Point2f, shared::ball_seeds> seeds = [] {
        std::array<cv::Point2f, shared::ball_seeds> all;
        for (std::size_t i = 0; i < all.size(); ++i) {
            const double place = static_cast<double>(i), r = std::sqrt((place + 0.5) / static_cast<double>(all.size())),
                         turn = place * std::numbers::pi * (3 - std::sqrt(5.0));
            all[i] = {static_cast<float>(r * std::cos(turn)), static_cast<float>(r * std::sin(turn))};
        }
        return all;
    }();
    return seeds;
}

void for_each_sign(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m, const DepthNoise& noise,
                   const std::function<void(int, int, const ErrorSigns&)>& found) {
    const SeenDepth seen(depth, visibility, radius_m, noise);
    tbb::parallel_for(0, depth.z_m.rows, [&](int v) {
        for (int u = 0; u < depth.z_m.cols; ++u)
            if (seen.at(v, u) != never_seen)
                found(v, u, seen.signs(v, u));
    });
}

ErrorWeights weights_of(const ErrorSigns& signs, float visibility) {
    const float open = 1 - std::sqrt(1 - std::clamp(visibility, 0.0F, 1.0F));
    const auto [value, past_value] = knot_below(open * (shared::error_values - 1), shared::error_values);
    const auto [share, past_share] = knot_below(signs.seen * (shared::error_shares - 1), shared::error_shares);
    const auto [reach, past_reach] = knot_below(0.5F * std::log2(std::max(signs.reach, 1.0F)), shared::error_reaches);
    const auto [noise, past_noise] = knot_below(std::log2(1 + 64 * signs.noise), shared::error_noises);
    const int first = share * shared::error_values + value;
    return {{first, first + 1, first + shared::error_values, first + shared::error_values + 1,
             shared::error_edges_at + signs.edge, shared::error_holes_at + signs.hole, shared::error_reaches_at + reach,
             shared::error_reaches_at + reach + 1, shared::error_noises_at + noise,
             shared::error_noises_at + noise + 1},
            {(1 - past_share) * (1 - past_value), (1 - past_share) * past_value, past_share * (1 - past_value),
             past_share * past_value, 1, 1, 1 - past_reach, past_reach, 1 - past_noise, past_noise}};
}

float expected_error(const ErrorWeights& weights, const shared::ErrorTable& table) {
    float sum = 0;
    for (std::size_t i = 0; i < ErrorWeights::count; ++i)
        sum += weights.weight[i] * table.factors[weights.factor[i]];
    return std::min(std::exp2(0.5F * sum), 1.0F);
}

cv::Mat1f expected_error_of(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m,
                            const DepthNoise& noise, const shared::ErrorTable& table) {
    cv::Mat1f errors(visibility.size(), std::numeric_limits<float>::quiet_NaN());
    for_each_sign(depth, visibility, radius_m, noise, [&](int v, int u, const ErrorSigns& signs) {
        errors(v, u) = expected_error(weights_of(signs, visibility(v, u)), table);
    });
    return errors;
}

double expected_rms_of(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m, const DepthNoise& noise,
                       const shared::ErrorTable& table) {
    constexpr double enough = 2500; // pixels: the RMS is then within about 1 % of that of all
    const SeenDepth seen(depth, visibility, radius_m, noise);
    const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(visibility.total()) / enough)));
    double squares = 0;
    std::size_t known = 0;
    for (int v = step / 2; v < visibility.rows; v += step)
        for (int u = step / 2; u < visibility.cols; u += step)
            if (seen.at(v, u) != never_seen) {
                const float error = expected_error(weights_of(seen.signs(v, u), visibility(v, u)), table),
                            counted = std::min(error, shared::hopeless_error);
                squares += static_cast<double>(counted * counted);
                ++known;
            }
    return known > 0 ? std::sqrt(squares / static_cast<double>(known)) : std::numeric_limits<double>::quiet_NaN();
}

float confidence_from(float expected_error) {
    const float confidence = 1 - expected_error / shared::hopeless_error;
    return confidence < 0 ? 0 : confidence;
}

cv::Mat1f confidence_from(const cv::Mat1f& expected_error) {
    cv::Mat1f confidence(expected_error.size());
    for (int v = 0; v < confidence.rows; ++v)
        std::transform(expected_error[v], expected_error[v] + expected_error.cols, confidence[v],
                       [](float error) { return confidence_from(error); });
    return confidence;
}

std::vector<float> confidence_of_points(std::span<const float> expected_error) {
    std::vector<float> confidence(expected_error.size());
    tbb::parallel_for(std::size_t(0), confidence.size(), [&](std::size_t i) {
        confidence[i] = std::isnan(expected_error[i]) ? 0.0F : confidence_from(expected_error[i]);
    });
    return confidence;
}

} // namespace scanshade
