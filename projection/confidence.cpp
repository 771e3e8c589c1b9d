#include "projection/confidence.h"

#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>

namespace scanshade {
const std::array<cv::Point2f, 16>& confidence_seeds() {
    static const std::array<cv::Point2f, 16> seeds = [] {
        std::array<cv::Point2f, 16> all;
        for (std::size_t i = 0; i < all.size(); ++i) {
            const double place = static_cast<double>(i), r = std::sqrt((place + 0.5) / static_cast<double>(all.size())),
                         turn = place * std::numbers::pi * (3 - std::sqrt(5.0));
            all[i] = {static_cast<float>(r * std::cos(turn)), static_cast<float>(r * std::sin(turn))};
        }
        return all;
    }();
    return seeds;
}

cv::Mat1f confidence_of(const DepthImage& depth, const cv::Mat1f& visibility, double radius_m,
                        const DepthNoise& noise) {
    const cv::Mat1f& z_m = depth.z_m;
    if (visibility.size() != z_m.size())
        throw Error(fmt::format("visibility is {}x{}, its depth image {}x{}", visibility.cols, visibility.rows,
                                z_m.cols, z_m.rows));
    const std::array<cv::Point2f, 16>& disc = confidence_seeds();
    const auto radius = static_cast<float>(radius_m), fx = static_cast<float>(depth.camera.fx),
               fy = static_cast<float>(depth.camera.fy);
    const float f = std::sqrt(fx * fy);
    cv::Mat1f seen_z(z_m.size()); // in front of no ball where nothing was seen
    std::transform(z_m.begin(), z_m.end(), visibility.begin(), seen_z.begin(), [](float z, float value) {
        return std::isnan(value) ? -std::numeric_limits<float>::infinity() : z;
    });
    cv::Mat1f confidence(z_m.size(), std::numeric_limits<float>::quiet_NaN());
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 0; u < z_m.cols; ++u) {
            if (std::isnan(visibility(v, u)))
                continue;
            const float z = z_m(v, u), across = std::min(radius * fx / z, 1e6F), down = std::min(radius * fy / z, 1e6F);
            int seen = 0;
            for (const cv::Point2f& seed : disc) {
                const int x = u + cvRound(seed.x * across), y = v + cvRound(seed.y * down);
                seen += static_cast<unsigned>(x) < static_cast<unsigned>(z_m.cols) &&
                        static_cast<unsigned>(y) < static_cast<unsigned>(z_m.rows) && seen_z(y, x) > z - radius;
            }
            const float resolved = std::clamp(0.5F * (radius * f / z) - 0.5F, 0.0F, 1.0F);
            const auto told = static_cast<float>(std::max(0.0, 1 - 3 * noise.at(z) / radius_m));
            confidence(v, u) = static_cast<float>(seen) / static_cast<float>(disc.size()) * resolved * told;
        }
    return confidence;
}

} // namespace scanshade
