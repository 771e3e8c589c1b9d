#include "apps/scenes/shapes.h"

#include "apps/scenes/world/random_noise.h"
#include "apps/scenes/world/scene.h"

#include <cmath>
#include <numbers>

namespace scanshade::shapes {
namespace {

constexpr float farthest_m = 100;

/// Bodies given in camera space.
DepthImage seen(const Pinhole& camera, std::vector<scene::Body> bodies) {
    const scene::Scene scene{"shape", "", std::move(bodies), {}, {}};
    cv::Mat1f z_m = render_geometry(scene::World(scene), camera, Eigen::Isometry3d::Identity()).z_m;
    z_m.setTo(0, z_m > farthest_m);
    return {camera, z_m, {}};
}

} // namespace

Pinhole off_centre_camera(cv::Size size) {
    const double f = size.width / (2 * std::tan(32.5 * std::numbers::pi / 180));
    return {f, 1.02 * f, 0.47 * size.width, 0.54 * size.height, size};
}

DepthImage tilted_plane(const Pinhole& camera, double tilt_degrees, double z_m) {
    const double tilt = tilt_degrees * std::numbers::pi / 180;
    return seen(camera, {{scene::Plane{{0, 0, z_m}, {std::sin(tilt), 0, -std::cos(tilt)}}, {}}});
}

DepthImage wall_corner(const Pinhole& camera, double z_m) {
    const double s = std::numbers::sqrt2 / 2;
    return seen(camera, {{scene::Plane{{0, 0, z_m}, {s, 0, -s}}, {}}, {scene::Plane{{0, 0, z_m}, {-s, 0, -s}}, {}}});
}

DepthImage ball_on_floor(const Pinhole& camera) {
    return seen(camera, {{scene::Plane{{0, 1, 0}, {0, -1, 0}}, {}},
                         {scene::Plane{{0, 0, 4}, {0, 0, -1}}, {}},
                         {scene::Sphere{{0.1, 0.7, 2.2}, 0.3}, {}}});
}

DepthImage with_holes(const DepthImage& depth, double share, int seed) {
    DepthImage holed{depth.camera, depth.z_m.clone(), depth.source.clone()};
    const Noise where(seed, 0, 0), how_large(seed, 0, 1);
    constexpr double mean_area = 7.5; // of squares with sides 1 to 4
    for (int v = 0; v < holed.z_m.rows; ++v)
        for (int u = 0; u < holed.z_m.cols; ++u)
            if (where.uniform(u, v) < share / mean_area) {
                const int side = 1 + static_cast<int>(4 * how_large.uniform(u, v));
                const cv::Rect block = cv::Rect(u, v, side, side) & cv::Rect({0, 0}, holed.z_m.size());
                holed.z_m(block) = 0;
                if (!holed.source.empty())
                    holed.source(block) = -1;
            }
    return holed;
}

} // namespace scanshade::shapes
