#include "apps/scenes/sensor.h"

#include "apps/scenes/world/random_noise.h"
#include "projection/base/named.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <tbb/parallel_for.h>
#include <utility>

namespace scanshade {
namespace {

/// The purpose of each stream of noise.
enum Purpose : std::uint32_t { axial, sideways, downward, grazing, fraying, flying, mixing };

Noise noise_of(const Sight& sight, Purpose purpose) { return {sight.seed, sight.frame, purpose}; }

/// Depth of the surface at the nearest pixel inside the image.
float depth_at(const Sight& sight, int u, int v) {
    const cv::Mat1f& z_m = sight.exact.z_m;
    return z_m(std::clamp(v, 0, z_m.rows - 1), std::clamp(u, 0, z_m.cols - 1));
}

/// A step of more than 4 % between two pixels is an outline, not a slope.
bool is_edge(double z_m, double other_m) { return std::abs(z_m - other_m) > 0.04 * std::min(z_m, other_m); }

bool beside_edge(const Sight& sight, int u, int v) {
    const double z = depth_at(sight, u, v);
    return is_edge(z, depth_at(sight, u - 1, v)) || is_edge(z, depth_at(sight, u + 1, v)) ||
           is_edge(z, depth_at(sight, u, v - 1)) || is_edge(z, depth_at(sight, u, v + 1));
}

Eigen::Vector3d point_at(const Sight& sight, int u, int v, double z_m) {
    return z_m * sight.camera.direction(u, v).homogeneous();
}

/// Cosine between the surface normal and the direction to the sensor.
double facing(const Sight& sight, int u, int v) {
    const cv::Vec3f& n = sight.exact.normals(v, u);
    const Eigen::Vector3d to_sensor = -point_at(sight, u, v, 1).normalized();
    return to_sensor.dot(Eigen::Vector3d(n[0], n[1], n[2]));
}

/// Chance of no measurement on a grazing surface: none up to 77 degrees, certain at 87.
double grazing_loss(double cosine) {
    const double certain = 0.052, none = 0.225;
    return std::clamp((none - cosine) / (none - certain), 0.0, 1.0);
}

/// White noise under a 5x5 tent, sigma 1: devices measure in windows, so errors of neighbouring pixels are correlated.
cv::Mat1f window_noise(const Sight& sight, Purpose purpose) {
    constexpr std::array<double, 5> tent{1 / 9.0, 2 / 9.0, 3 / 9.0, 2 / 9.0, 1 / 9.0};
    constexpr double left_over =
        19 / 81.0; // the tent's sum of squares: sigma after one axis is its root, after both this
    const cv::Size size = sight.exact.z_m.size();
    const Noise noise = noise_of(sight, purpose);
    cv::Mat1f white(size.height + 4, size.width + 4), rows(size.height + 4, size.width), smooth(size);
    tbb::parallel_for(0, white.rows, [&](int v) {
        for (int u = 0; u < white.cols; ++u)
            white(v, u) = static_cast<float>(noise.gaussian(u, v));
        for (int u = 0; u < rows.cols; ++u) {
            double sum = 0;
            for (int i = 0; i < 5; ++i)
                sum += tent[i] * white(v, u + i);
            rows(v, u) = static_cast<float>(sum / left_over);
        }
    });
    tbb::parallel_for(0, smooth.rows, [&](int v) {
        for (int u = 0; u < smooth.cols; ++u) {
            double sum = 0;
            for (int i = 0; i < 5; ++i)
                sum += tent[i] * rows(v + i, u);
            smooth(v, u) = static_cast<float>(sum);
        }
    });
    return smooth;
}

/// Normal noise of sigma 1, mapped to uniform in (0, 1). It is correlated, so depth is lost in patches, not single
/// pixels.
double evenly(double gaussian) { return 0.5 * std::erfc(-gaussian / std::numbers::sqrt2); }

template <class Measure>
cv::Mat1f per_pixel(const Sight& sight, Measure&& measure) {
    cv::Mat1f recorded(sight.exact.z_m.size(), 0.0F);
    tbb::parallel_for(0, recorded.rows, [&](int v) {
        for (int u = 0; u < recorded.cols; ++u)
            if (sight.exact.z_m(v, u) > 0)
                recorded(v, u) = static_cast<float>(measure(u, v, static_cast<double>(sight.exact.z_m(v, u))));
    });
    return recorded;
}

// ---------------------------------------------------------------------------------------------------- structured light

/// The projector is to one side of the camera. Surfaces that it does not reach have no dots, so no depth.
bool in_shadow(const Sight& sight, int u, int v, double z_m) {
    const Eigen::Vector3d projector(0.075, 0, 0);
    const cv::Vec3f& n = sight.exact.normals(v, u);
    const Eigen::Vector3d lifted = point_at(sight, u, v, z_m) + 1e-4 * Eigen::Vector3d(n[0], n[1], n[2]);
    return sight.world.surface().blocked(sight.world_from_camera * lifted, sight.world_from_camera * projector);
}

double to_disparity_step(double z_m) {
    constexpr double steps_metres = 1 / kinect_step_per_m; // z = steps_metres / whole number
    return steps_metres / std::max(1.0, std::round(steps_metres / z_m));
}

cv::Mat1f record_kinect(const Sight& sight) {
    constexpr double near_m = 0.4, far_m = 8.0, jitter_px = 0.7;
    constexpr int blind_columns = 8; // the matching window hangs over the image's right border
    const cv::Mat1f noise = window_noise(sight, axial), patches = window_noise(sight, grazing);
    const Noise du = noise_of(sight, sideways), dv = noise_of(sight, downward), frayed = noise_of(sight, fraying);
    return per_pixel(sight, [&](int u, int v, double z) -> double {
        if (u >= sight.camera.pinhole.size.width - blind_columns)
            return 0;
        const bool edge = beside_edge(sight, u, v);
        const bool lost = evenly(patches(v, u)) < grazing_loss(facing(sight, u, v));
        if (lost || (edge && frayed.uniform(u, v) < 0.3) || in_shadow(sight, u, v, z))
            return 0;
        if (edge) // outlines waver by a pixel
            z = depth_at(sight, u + static_cast<int>(std::lround(jitter_px * du.gaussian(u, v))),
                         v + static_cast<int>(std::lround(jitter_px * dv.gaussian(u, v))));
        const double measured = to_disparity_step(z + kinect_sigma_m(z) * noise(v, u));
        return measured >= near_m && measured <= far_m ? measured : 0;
    });
}

// ---------------------------------------------------------------------------------------------------- time of flight

cv::Mat1f record_tof(const Sight& sight) {
    constexpr double near_m = 0.25, far_m = 5.5, flying_share = 0.6;
    const cv::Mat1f patches = window_noise(sight, grazing);
    const Noise noise = noise_of(sight, axial), mix = noise_of(sight, mixing), flies = noise_of(sight, flying);
    return per_pixel(sight, [&](int u, int v, double z) -> double {
        const double cosine = std::max(facing(sight, u, v), 0.05);
        if (evenly(patches(v, u)) < grazing_loss(cosine))
            return 0;
        if (beside_edge(sight, u, v) && flies.uniform(u, v) < flying_share) { // light of two surfaces in one pixel
            const auto [low, high] = std::minmax({depth_at(sight, u - 1, v), depth_at(sight, u + 1, v),
                                                  depth_at(sight, u, v - 1), depth_at(sight, u, v + 1)});
            z = std::lerp(static_cast<double>(low), static_cast<double>(high), mix.uniform(u, v));
        }
        const double measured = z + tof_sigma_m(z) / std::sqrt(cosine) * noise.gaussian(u, v);
        return measured >= near_m && measured <= far_m ? measured : 0;
    });
}

// ---------------------------------------------------------------------------------------------------- stereo

/// Two cameras side by side, matched in windows. A window at an outline follows the nearer surface, which therefore
/// grows by a part of the window (fattening). What only one camera sees has no match.
cv::Mat1f record_stereo(const Sight& sight) {
    constexpr double near_m = 0.3, far_m = 12, window_px = 4;
    const double focal_base = sight.camera.pinhole.fx * stereo_base_m;
    const cv::Mat1f noise = window_noise(sight, axial), patches = window_noise(sight, grazing),
                    outline = window_noise(sight, sideways);
    const auto seen_by_both = [&](int u, int v, double z) {
        const cv::Vec3f& n = sight.exact.normals(v, u);
        const Eigen::Vector3d lifted = point_at(sight, u, v, z) + 1e-4 * Eigen::Vector3d(n[0], n[1], n[2]);
        return !sight.world.surface().blocked(sight.world_from_camera * lifted,
                                              sight.world_from_camera * Eigen::Vector3d(stereo_base_m, 0, 0));
    };
    return per_pixel(sight, [&](int u, int v, double z) -> double {
        const double reach = window_px * evenly(outline(v, u));
        double matched = z;
        for (const auto& [du, dv] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}})
            for (int step = 1; step <= static_cast<int>(std::lround(reach)); ++step)
                matched = std::min(matched, static_cast<double>(depth_at(sight, u + step * du, v + step * dv)));
        const bool fattened = is_edge(matched, z);
        if (!fattened && (evenly(patches(v, u)) < grazing_loss(facing(sight, u, v)) || !seen_by_both(u, v, z)))
            return 0;
        const double disparity = focal_base / (fattened ? matched : z) + stereo_sigma_px * noise(v, u);
        const double measured = focal_base / std::max(1.0 / 16, std::round(16 * disparity) / 16);
        return measured >= near_m && measured <= far_m ? measured : 0;
    });
}

// ---------------------------------------------------------------------------------------------------- a phone's lidar

/// A sparse time of flight, completed to 256x192 and resized to the image: no holes, and every outline is smeared over
/// some pixels.
cv::Mat1f record_lidar(const Sight& sight) {
    constexpr double far_m = 5;
    const cv::Mat1f& exact = sight.exact.z_m;
    const cv::Size grid(std::min(256, exact.cols), std::min(192, exact.rows));
    const Noise noise = noise_of(sight, axial);
    cv::Mat1f coarse(grid), smooth, recorded;
    for (int v = 0; v < grid.height; ++v)
        for (int u = 0; u < grid.width; ++u) {
            const double z = exact(v * exact.rows / grid.height, u * exact.cols / grid.width);
            coarse(v, u) = static_cast<float>(z * (1 + lidar_sigma * noise.gaussian(u, v)));
        }
    cv::GaussianBlur(coarse, smooth, {}, 0.8, 0.8, cv::BORDER_REPLICATE);
    cv::resize(smooth, recorded, exact.size(), 0, 0, cv::INTER_LINEAR);
    for (float& z : recorded) // as millimetres
        z = z <= far_m ? std::round(z * 1000) / 1000 : 0.0F;
    recorded.setTo(0, exact <= 0);
    return recorded;
}

cv::Mat1f record_ideal(const Sight& sight) { return sight.exact.z_m.clone(); }

} // namespace

const std::vector<Sensor>& sensors() {
    static const std::vector<Sensor> table{
        {"ideal", "exact depth of every pixel", record_ideal},
        {"kinect", "structured light: disparity steps, noise, shadows, frayed outlines, 0.4 .. 8 m", record_kinect},
        {"tof", "time of flight: noise, flying pixels at outlines, 0.25 .. 5.5 m", record_tof},
        {"stereo", "two cameras: disparity steps, noise, fattened outlines, places that one camera sees, 0.3 .. 12 m",
         record_stereo},
        {"lidar", "a phone's lidar: 256x192 without holes, resized to the image, smeared outlines, to 5 m",
         record_lidar},
    };
    return table;
}

const Sensor& sensor_named(std::string_view name) { return one_named(sensors(), name, "sensor"); }

} // namespace scanshade
