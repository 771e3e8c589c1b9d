// Synthetic scenes made of solids: exact depth and normals, colour, and true visibility for any camera.
#pragma once

#include "ao/raycast/ray_hemisphere.h"
#include "projection/camera.h"

#include <Eigen/Geometry>
#include <limits>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace scanshade::scene {

// World axes: x right, y away from the entrance, z up; metres. All solids are two-sided.

struct Ray {
    Eigen::Vector3d origin, direction; ///< `t` counts in lengths of direction
};

/// A square of 1 km, practically endless; `normal` has unit length.
struct Plane {
    Eigen::Vector3d point, normal;
};
struct Box {
    Eigen::Vector3d centre, half;
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity(); ///< columns: the box's own axes, unit
};
struct Sphere {
    Eigen::Vector3d centre;
    double radius;
};
/// Closed at both ends.
struct Cylinder {
    Eigen::Vector3d base; ///< centre of one end
    double radius, height;
    Eigen::Vector3d axis = Eigen::Vector3d::UnitZ(); ///< unit, from the base to the other end
};
/// Hollow objects and ground are made of triangles.
struct Triangle {
    Eigen::Vector3d a, b, c;
};
using Solid = std::variant<Plane, Box, Sphere, Cylinder, Triangle>;

enum class Pattern { plain, checks, boards, plaster, books };

/// A surface's appearance: linear RGB, two tones in a pattern of size `scale_m`.
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

/// A camera's position, and the point that it looks at.
struct Viewpoint {
    Eigen::Vector3d eye, target;
};
/// A closed, smooth path through the viewpoints, evenly timed.
struct Walk {
    std::vector<Viewpoint> viewpoints;
    double period_s = 16;
};

struct Scene {
    std::string_view name, summary;
    std::vector<Body> bodies = {};
    std::vector<Eigen::Vector3d> windows = {}; ///< soft lights
    Walk walk = {};
    double ao_radius_m = 0.5; ///< the truth's radius by default
    double far_m = 10;        ///< nothing is seen beyond
};

/// Camera to world at a time on the scene's walk, with the sway of a hand-held camera.
[[nodiscard]] Eigen::Isometry3d world_from_camera(const Walk& walk, double seconds);
/// A camera at `eye` whose optical axis goes through `target`, image upright.
[[nodiscard]] Eigen::Isometry3d looking_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

/// The nearest surface beyond `near` lengths of the ray. Tries every body's formula.
[[nodiscard]] Hit cast(const std::vector<Body>& bodies, const Ray& ray, double near = 1e-9);

/// A scene made ready for many rays: tessellated, in a tree. Round bodies become polyhedra inscribed within a
/// thousandth of their radius (a tenth of a millimetre for small ones). The polyhedra find the body that is hit, and
/// block rays. The body's formula gives the point of the hit.
class World {
  public:
    /// Keeps a reference to the scene.
    explicit World(const Scene& scene);

    [[nodiscard]] const Scene& scene() const { return scene_; }
    [[nodiscard]] const RaySurface& surface() const { return surface_; }
    /// The nearest surface.
    [[nodiscard]] Hit cast(const Ray& ray) const;

  private:
    const Scene& scene_;
    std::vector<const Body*> body_of_triangle_;
    RaySurface surface_;
};

/// The tessellated scene as a mesh.
[[nodiscard]] Mesh mesh_of(const Scene& scene);

/// A pinhole camera, and optionally a distorting lens.
struct Optics {
    Pinhole pinhole;
    Distortion lens;
    Optics(const Pinhole& camera, const Distortion& distortion = {}) : pinhole(camera), lens(distortion) {}
    /// x and y at z = 1 of a pixel's ray. Throws Misuse where the lens has no ray for the pixel.
    [[nodiscard]] Eigen::Vector2d direction(double u, double v) const;
};

/// Exact per-pixel geometry: depth along the optical axis, unit normals in camera space facing the camera; 0 where no
/// surface is.
struct Geometry {
    cv::Mat1f z_m;
    cv::Mat3f normals;
};
[[nodiscard]] Geometry render_geometry(const World& world, const Optics& camera,
                                       const Eigen::Isometry3d& world_from_camera);

/// BGR as a camera would store it: albedo under window light and a lamp at the camera, four samples per pixel. It has
/// no shadows and no occlusion, which the program under test must add.
[[nodiscard]] cv::Mat3b render_colour(const World& world, const Optics& camera,
                                      const Eigen::Isometry3d& world_from_camera);

/// Linear red, green, blue of the surface that was hit, at the point of the hit.
[[nodiscard]] Eigen::Vector3d albedo_at(const Hit& hit, const Eigen::Vector3d& point);

struct TruthOptions {
    double radius_m = 0.5;
    int rays = 256; ///< per pixel
    int seed = 1;
    bool all_falloffs = false;
};

/// Visibility of each pixel's exact surface against the whole scene; NaN where no surface is.
struct Truth {
    std::array<cv::Mat1f, 3> visibility; ///< by Falloff; quad and lin empty unless all were asked for
    cv::Mat1f standard_error;            ///< of the hard visibility
};
[[nodiscard]] Truth true_visibility(const World& world, const Optics& camera,
                                    const Eigen::Isometry3d& world_from_camera, const TruthOptions& options);

} // namespace scanshade::scene
