// Simulated depth sensors: exact depth in, recorded depth out.
#pragma once

#include "apps/scenes/world/scene.h"

#include <string_view>
#include <vector>

namespace scanshade {

/// A sensor's view of the scene, all on one pixel grid.
struct Sight {
    const scene::World& world;
    scene::Optics camera;
    Eigen::Isometry3d world_from_camera;
    scene::Geometry exact;
    int seed = 1, frame = 0;
};

struct Sensor {
    std::string_view name, summary;
    cv::Mat1f (*record)(const Sight& sight); ///< metres, 0 = hole
};

/// The table of sensors: ideal, kinect, tof, stereo, lidar.
[[nodiscard]] const std::vector<Sensor>& sensors();
/// Throws Misuse listing the known names.
[[nodiscard]] const Sensor& sensor_named(std::string_view name);

/// Structured light (Kinect v1): one standard deviation of depth along the axis (Nguyen, Izadi and Lovell 2012, eq. 5).
[[nodiscard]] constexpr double kinect_sigma_m(double z_m) { return 0.0012 + 0.0019 * (z_m - 0.4) * (z_m - 0.4); }
/// Its disparity has steps of an eighth of a pixel, so depths at z are kinect_step_per_m * z^2 apart (3 mm at 1 m, 11
/// mm at 2 m: f b = 43.9 px m, Khoshelham and Elberink 2012).
inline constexpr double kinect_step_per_m = 2.85e-3;

/// Time of flight: depth noise of one pixel facing the sensor; grows with the square of the distance as less light
/// returns.
[[nodiscard]] constexpr double tof_sigma_m(double z_m) { return 0.001 + 0.0006 * z_m * z_m; }

/// Stereo: the cameras' distance, and one standard deviation of disparity. Depth errs by z^2 sigma / (focal length x
/// distance): 10 mm at 2 m with 525 pixels.
inline constexpr double stereo_base_m = 0.075, stereo_sigma_px = 0.1;

/// A phone's lidar: noise of its coarse image before smoothing, as a share of depth.
inline constexpr double lidar_sigma = 0.003;

} // namespace scanshade
