// Synthetic scenes made of a few solids: exact depth, colour and visibility for any camera, by casting rays at
// formulas.
#pragma once

#include "projection/camera.h"

#include <Eigen/Geometry>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace scanshade::scene {

// World axes: x right, y away from the entrance, z up; metres. All solids are two-sided: a room is a box seen from
// inside.

struct Ray {
    Eigen::Vector3d origin, direction; ///< `t` counts in lengths of direction; visibility rays have length 1
};

/// Endless; `normal` has unit length.
struct Plane {
    Eigen::Vector3d point, normal;
};
/// Upright, turned about the vertical through its centre.
struct Box {
    Eigen::Vector3d centre, half;
    Eigen::Vector2d heading{1, 0}; ///< unit: where its own x axis points
};
struct Sphere {
    Eigen::Vector3d centre;
    double radius;
};
/// Upright, closed at both ends.
struct Cylinder {
    Eigen::Vector3d base; ///< centre of the lower end
    double radius, height;
};
using Solid = std::variant<Plane, Box, Sphere, Cylinder>;

enum class Pattern { plain, checks, boards, plaster, books };

/// What a surface looks like: linear RGB, two tones woven by a pattern of size `scale_m`.
struct Material {
    Eigen::Vector3d tone{0.5, 0.5, 0.5}, other_tone{0.5, 0.5, 0.5};
    Pattern pattern = Pattern::plain;
    double scale_m = 0.1;
};

struct Body {
    Solid solid;
    Material material;
};

struct Hit {
    double t = std::numeric_limits<double>::infinity();
    Eigen::Vector3d normal = Eigen::Vector3d::Zero(); ///< unit, facing the ray's origin
    const Body* body = nullptr;                       ///< null: nothing was hit
};

/// Where a recording walks: position and gaze over time, both closed curves.
struct Walk {
    Eigen::Vector3d centre, reach; ///< of the ellipse (in x, y, z) that the camera swings along
    Eigen::Vector3d gaze;          ///< the point looked at, on average
    double period_s = 16;
};

struct Scene {
    std::string_view name, summary;
    std::vector<Body> bodies;
    std::vector<Eigen::Vector3d> windows; ///< soft lights
    Walk walk;
};

/// The table of scenes.
[[nodiscard]] const std::vector<Scene>& scenes();
/// Throws Misuse listing the names there are.
[[nodiscard]] const Scene& scene_named(std::string_view name);

/// Camera to world at a time on the scene's walk, with the sway of a hand.
[[nodiscard]] Eigen::Isometry3d world_from_camera(const Walk& walk, double seconds);
/// A camera at `eye` whose optical axis meets `target`, image upright.
[[nodiscard]] Eigen::Isometry3d looking_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

/// The nearest surface beyond `near` lengths of the ray.
[[nodiscard]] Hit cast(const std::vector<Body>& bodies, const Ray& ray, double near = 1e-9);

/// Exact per-pixel geometry: depth along the optical axis, unit normals in camera space facing the camera; 0 where no
/// surface is.
struct Geometry {
    cv::Mat1f z_m;
    cv::Mat3f normals;
};
[[nodiscard]] Geometry render_geometry(const Scene& scene, const Pinhole& camera,
                                       const Eigen::Isometry3d& world_from_camera);

/// BGR as a camera would store it: albedo under window light and a lamp at the camera, four samples per pixel. There
/// are no shadows and no occlusion in it: those are for the program under test to add.
[[nodiscard]] cv::Mat3b render_colour(const Scene& scene, const Pinhole& camera,
                                      const Eigen::Isometry3d& world_from_camera);

/// Share of the cosine-weighted hemisphere about each pixel's surface that is free within radius_m ("hard" visibility),
/// by `rays` low-discrepancy rays per pixel; NaN where no surface is. Noise falls as rays^-3/4 (0.02 at 64 beside an
/// edge).
[[nodiscard]] cv::Mat1f true_visibility(const Scene& scene, const Pinhole& camera,
                                        const Eigen::Isometry3d& world_from_camera, double radius_m, int rays,
                                        int seed);

/// Whether a solid stands between two points.
[[nodiscard]] bool blocked(const std::vector<Body>& bodies, const Eigen::Vector3d& from, const Eigen::Vector3d& to);

} // namespace scanshade::scene
