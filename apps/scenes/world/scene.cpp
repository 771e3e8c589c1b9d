// Rays against scenes: a tree finds the solid, and its formula gives the exact hit.
#include "apps/scenes/world/scene.h"

#include "apps/scenes/world/random_noise.h"
#include "projection/base/error.h"
#include "projection/srgb.h"
#include "projection/undistort.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <tbb/parallel_for.h>

namespace scanshade::scene {
namespace {

using Eigen::Vector3d;
constexpr double never = std::numeric_limits<double>::infinity();

// ---------------------------------------------------------------------------------------------------- rays at solids

struct Crossing {
    double t = never;
    Vector3d normal = Vector3d::Zero(); ///< unit, either side
};

Crossing cross(const Plane& plane, const Ray& ray, double near) {
    const double slope = plane.normal.dot(ray.direction);
    const double t = slope == 0 ? never : plane.normal.dot(plane.point - ray.origin) / slope;
    return t > near ? Crossing{t, plane.normal} : Crossing{};
}

/// Slabs (Kay and Kajiya 1986); from inside, the far wall counts.
Crossing cross(const Box& box, const Ray& ray, double near) {
    const Vector3d origin = box.axes.transpose() * (ray.origin - box.centre);
    const Vector3d direction = box.axes.transpose() * ray.direction;
    double enter = -never, leave = never;
    int enter_axis = 0, leave_axis = 0;
    for (int axis = 0; axis < 3; ++axis) {
        if (direction[axis] == 0) {
            if (std::abs(origin[axis]) > box.half[axis])
                return {};
            continue;
        }
        const double middle = -origin[axis] / direction[axis], reach = std::abs(box.half[axis] / direction[axis]);
        if (middle - reach > enter)
            enter = middle - reach, enter_axis = axis;
        if (middle + reach < leave)
            leave = middle + reach, leave_axis = axis;
    }
    if (enter > leave || leave <= near)
        return {};
    const bool outside = enter > near;
    return {outside ? enter : leave, box.axes.col(outside ? enter_axis : leave_axis)};
}

Crossing cross(const Sphere& sphere, const Ray& ray, double near) {
    const Vector3d to_centre = sphere.centre - ray.origin;
    const double a = ray.direction.squaredNorm(), b = to_centre.dot(ray.direction);
    const double closest2 = (to_centre - b / a * ray.direction).squaredNorm(); // not b^2 - ac: that cancels far away
    const double rest = sphere.radius * sphere.radius - closest2;
    if (rest < 0)
        return {};
    const double reach = std::sqrt(rest / a);
    const double t = b / a - reach > near ? b / a - reach : b / a + reach;
    if (t <= near)
        return {};
    return {t, (ray.origin + t * ray.direction - sphere.centre) / sphere.radius};
}

/// The side where the ray comes as close to the axis as the radius, the ends where it comes to their planes.
Crossing cross(const Cylinder& cylinder, const Ray& ray, double near) {
    const Vector3d& axis = cylinder.axis;
    const Vector3d origin = ray.origin - cylinder.base;
    const double height = origin.dot(axis), rise = ray.direction.dot(axis);
    const Vector3d across = origin - height * axis, direction = ray.direction - rise * axis;
    const double radius2 = cylinder.radius * cylinder.radius, a = direction.squaredNorm();
    Crossing nearest;
    if (a > 0) {
        const double middle = -across.dot(direction) / a;
        const double rest = radius2 - (across + middle * direction).squaredNorm();
        if (rest < 0)
            return {};
        const double reach = std::sqrt(rest / a);
        for (const double t : {middle - reach, middle + reach}) {
            const double at = height + t * rise;
            if (t > near && t < nearest.t && at >= 0 && at <= cylinder.height)
                nearest = {t, (across + t * direction) / cylinder.radius};
        }
    }
    if (rise != 0)
        for (const double end : {0.0, cylinder.height}) {
            const double t = (end - height) / rise;
            if (t > near && t < nearest.t && (across + t * direction).squaredNorm() <= radius2)
                nearest = {t, axis};
        }
    return nearest;
}

/// Moeller and Trumbore 1997.
Crossing cross(const Triangle& triangle, const Ray& ray, double near) {
    const Vector3d side = triangle.b - triangle.a, other = triangle.c - triangle.a;
    const Vector3d lever = ray.direction.cross(other);
    const double volume = side.dot(lever);
    if (volume == 0)
        return {};
    const Vector3d from_corner = ray.origin - triangle.a;
    const double u = from_corner.dot(lever) / volume;
    const Vector3d q = from_corner.cross(side);
    const double v = ray.direction.dot(q) / volume, t = other.dot(q) / volume;
    constexpr double rim = 1e-9; // neighbours overlap by rounding rather than leave a gap
    if (u < -rim || v < -rim || u + v > 1 + rim || t <= near)
        return {};
    return {t, side.cross(other).normalized()};
}

Crossing cross(const Solid& solid, const Ray& ray, double near) {
    return std::visit([&](const auto& shape) { return cross(shape, ray, near); }, solid);
}

Hit facing(const Body& body, const Crossing& crossing, const Ray& ray) {
    return {crossing.t, crossing.normal.dot(ray.direction) > 0 ? Vector3d(-crossing.normal) : crossing.normal, &body};
}

// ---------------------------------------------------------------------------------------------------- tessellation

int add_vertex(Mesh& mesh, const Vector3d& at) {
    mesh.vertices.push_back(at);
    return static_cast<int>(mesh.vertices.size()) - 1;
}

void add_quad(Mesh& mesh, int a, int b, int c, int d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
}

/// Two unit vectors that make a right-handed frame with `axis`.
std::pair<Vector3d, Vector3d> axes_across(const Vector3d& axis) {
    const Vector3d x = axis.unitOrthogonal();
    return {x, axis.cross(x)};
}

/// Sides of a polygon whose middles are within a thousandth of the radius, or a tenth of a millimetre, of the circle.
int sides_of_circle(double radius) {
    const double share = std::min(std::max(1e-3, 1e-4 / radius), 0.1);
    return static_cast<int>(std::ceil(std::numbers::pi / std::acos(1 - share)));
}

void tessellate(const Plane& plane, Mesh& mesh) {
    constexpr double half = 500;
    const auto [x, y] = axes_across(plane.normal);
    const int first = add_vertex(mesh, plane.point - half * (x + y));
    add_vertex(mesh, plane.point + half * (x - y));
    add_vertex(mesh, plane.point + half * (x + y));
    add_vertex(mesh, plane.point - half * (x - y));
    add_quad(mesh, first, first + 1, first + 2, first + 3);
}

void tessellate(const Box& box, Mesh& mesh) {
    const int first = static_cast<int>(mesh.vertices.size());
    for (int corner = 0; corner < 8; ++corner) { // bit i: low or high side of axis i
        const Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        add_vertex(mesh, box.centre + box.axes * box.half.cwiseProduct(sign));
    }
    for (const auto& [a, b, c, d] :
         {std::array{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}})
        add_quad(mesh, first + a, first + b, first + c, first + d);
}

void tessellate(const Sphere& sphere, Mesh& mesh) {
    const int sides = sides_of_circle(sphere.radius), rings = (sides + 1) / 2;
    const int first = static_cast<int>(mesh.vertices.size());
    for (int ring = 0; ring <= rings; ++ring)
        for (int side = 0; side < sides; ++side) {
            const double polar = std::numbers::pi * ring / rings, angle = 2 * std::numbers::pi * side / sides;
            const Vector3d out(std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle), std::cos(polar));
            add_vertex(mesh, sphere.centre + sphere.radius * out);
        }
    for (int ring = 0; ring < rings; ++ring)
        for (int side = 0; side < sides; ++side) {
            const int here = first + ring * sides, next = (side + 1) % sides;
            add_quad(mesh, here + side, here + next, here + next + sides, here + side + sides);
        }
}

void tessellate(const Cylinder& cylinder, Mesh& mesh) {
    const int sides = sides_of_circle(cylinder.radius);
    const auto [x, y] = axes_across(cylinder.axis);
    const Vector3d top = cylinder.base + cylinder.height * cylinder.axis;
    const int low = add_vertex(mesh, cylinder.base), high = add_vertex(mesh, top), first = high + 1;
    for (int side = 0; side < sides; ++side) {
        const double angle = 2 * std::numbers::pi * side / sides;
        const Vector3d out = cylinder.radius * (std::cos(angle) * x + std::sin(angle) * y);
        add_vertex(mesh, cylinder.base + out);
        add_vertex(mesh, top + out);
    }
    for (int side = 0; side < sides; ++side) {
        const int here = first + 2 * side, next = first + 2 * ((side + 1) % sides);
        add_quad(mesh, here, next, next + 1, here + 1);
        mesh.triangles.push_back({low, next, here});
        mesh.triangles.push_back({high, here + 1, next + 1});
    }
}

void tessellate(const Triangle& triangle, Mesh& mesh) {
    const int first = add_vertex(mesh, triangle.a);
    mesh.triangles.push_back({first, add_vertex(mesh, triangle.b), add_vertex(mesh, triangle.c)});
}

Mesh tessellated(const Scene& scene, std::vector<const Body*>& body_of_triangle) {
    Mesh mesh;
    for (const Body& body : scene.bodies) {
        std::visit([&](const auto& shape) { tessellate(shape, mesh); }, body.solid);
        body_of_triangle.resize(mesh.triangles.size(), &body);
    }
    return mesh;
}

// ---------------------------------------------------------------------------------------------------- pixels

Ray ray_through(const Optics& camera, const Eigen::Isometry3d& world_from_camera, double u, double v) {
    const Vector3d direction = camera.direction(u, v).homogeneous(); // so that t is depth
    return {world_from_camera.translation(), world_from_camera.linear() * direction};
}

/// Calls visit(u, v) for every pixel, on all cores.
template <class Visit>
void for_each_pixel(const Optics& camera, Visit&& visit) {
    const cv::Size size = camera.pinhole.size;
    tbb::parallel_for(0, size.height, [&](int v) {
        for (int u = 0; u < size.width; ++u)
            visit(u, v);
    });
}

// ---------------------------------------------------------------------------------------------------- colours

/// Smooth noise on a lattice, 0 .. 1.
double lattice_noise(double x, double y) {
    const double column = std::floor(x), row = std::floor(y);
    const auto corner = [&](int right, int down) {
        return hash(static_cast<std::uint32_t>(static_cast<int>(column) + right),
                    static_cast<std::uint32_t>(static_cast<int>(row) + down)) *
               0x1p-32;
    };
    const auto eased = [](double s) { return s * s * (3 - 2 * s); };
    const double sx = eased(x - column), sy = eased(y - row);
    return std::lerp(std::lerp(corner(0, 0), corner(1, 0), sx), std::lerp(corner(0, 1), corner(1, 1), sx), sy);
}

/// How much of the other tone shows at surface coordinates (x, y), in units of the pattern's scale.
double woven(Pattern pattern, double x, double y) {
    switch (pattern) {
    case Pattern::checks:
        return (static_cast<int>(std::floor(x)) + static_cast<int>(std::floor(y))) & 1;
    case Pattern::boards: { // one tone per board, grain along it, a dark joint
        const int board = static_cast<int>(std::floor(x));
        const double joint = std::abs(x - board - 0.5) > 0.485 ? 0.6 : 0;
        const double own = hash(static_cast<std::uint32_t>(board) * 7U) * 0x1p-32;
        return std::clamp(0.55 * own + 0.45 * lattice_noise(x * 9, y * 0.7 + 17 * own) + joint, 0.0, 1.0);
    }
    case Pattern::plaster:
        return 0.5 * lattice_noise(x, y) + 0.3 * lattice_noise(3 * x, 3 * y) + 0.2 * lattice_noise(9 * x, 9 * y);
    case Pattern::books:
        return hash(static_cast<std::uint32_t>(static_cast<int>(std::floor(x)))) * 0x1p-32;
    case Pattern::plain:
        break;
    }
    return 0;
}

/// Two coordinates along the surface: the axes the normal points along least.
Eigen::Vector2d along_surface(const Vector3d& point, const Vector3d& normal) {
    const Vector3d steep = normal.cwiseAbs();
    if (steep.z() >= steep.x() && steep.z() >= steep.y())
        return {point.x(), point.y()};
    return {steep.x() > steep.y() ? point.y() : point.x(), point.z()};
}

Vector3d albedo(const Material& material, const Vector3d& point, const Vector3d& normal) {
    if (material.pattern == Pattern::plain)
        return material.tone;
    const Eigen::Vector2d at = along_surface(point, normal) / material.scale_m;
    const double share = woven(material.pattern, at.x(), at.y());
    return material.tone + share * (material.other_tone - material.tone);
}

/// Even light from above, soft light from each window, and a lamp at the lens so that every face has some shading.
Vector3d light_at(const Scene& scene, const Vector3d& point, const Vector3d& normal, const Vector3d& eye) {
    const Vector3d sky(0.27, 0.28, 0.30), floor_glow(0.21, 0.19, 0.17), daylight(1.05, 1.0, 0.92),
        lamp(0.16, 0.155, 0.15);
    Vector3d light = std::lerp(0.0, 1.0, 0.5 + 0.5 * normal.z()) * sky + (0.5 - 0.5 * normal.z()) * floor_glow;
    for (const Vector3d& window : scene.windows) {
        const Vector3d towards = window - point;
        const double wrapped =
            std::max(0.0, 0.25 + 0.75 * normal.dot(towards.normalized())); // a wide window wraps round
        light += daylight * (wrapped * wrapped * 2.2 / (1.5 + towards.squaredNorm()));
    }
    return light + lamp * std::max(0.0, normal.dot((eye - point).normalized()));
}

Vector3d radiance(const World& world, const Ray& ray) {
    const Hit hit = world.cast(ray);
    if (!hit.body)
        return {0.6, 0.7, 0.85};
    const Vector3d point = ray.origin + hit.t * ray.direction;
    return albedo(hit.body->material, point, hit.normal)
        .cwiseProduct(light_at(world.scene(), point, hit.normal, ray.origin));
}

cv::Vec3b stored(const Vector3d& linear) {
    const auto byte = [](double value) {
        return static_cast<unsigned char>(std::lround(255 * srgb_from_linear(std::clamp(value, 0.0, 1.0))));
    };
    return {byte(linear.z()), byte(linear.y()), byte(linear.x())};
}

} // namespace

Eigen::Isometry3d looking_at(const Vector3d& eye, const Vector3d& target) {
    const Vector3d forward = (target - eye).normalized();
    Vector3d right = forward.cross(Vector3d::UnitZ());
    right = right.norm() > 1e-9 ? right.normalized() : Vector3d::UnitX(); // straight up or down: any upright will do
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() << right, forward.cross(right), forward;
    pose.translation() = eye;
    return pose;
}

namespace {

/// Between b and c, through them, as smooth as a and d allow (Catmull and Rom 1974).
Vector3d spline(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d, double s) {
    return b + s / 2 * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)));
}

} // namespace

Eigen::Isometry3d world_from_camera(const Walk& walk, double seconds) {
    const int count = static_cast<int>(walk.viewpoints.size());
    const double along = seconds / walk.period_s * count, before = std::floor(along);
    const auto viewpoint = [&](int step) -> const Viewpoint& {
        const int i = (static_cast<int>(before) + step) % count;
        return walk.viewpoints[static_cast<std::size_t>(i < 0 ? i + count : i)];
    };
    const auto through = [&](Vector3d Viewpoint::*point) {
        return spline(viewpoint(-1).*point, viewpoint(0).*point, viewpoint(1).*point, viewpoint(2).*point,
                      along - before);
    };
    // Three sines without a common period, a few millimetres and tenths of a degree: a steady hand.
    const auto sway = [&](double hertz, double offset) {
        return std::sin(2 * std::numbers::pi * hertz * seconds + offset);
    };
    const Vector3d tremble(sway(1.3, 0.4), sway(0.9, 2.0), sway(1.7, 4.1));
    Eigen::Isometry3d pose =
        looking_at(through(&Viewpoint::eye) + 0.004 * tremble, through(&Viewpoint::target) + 0.02 * tremble);
    pose.rotate(Eigen::AngleAxisd(0.01 * sway(0.7, 1.0), Vector3d::UnitZ()));
    return pose;
}

Hit cast(const std::vector<Body>& bodies, const Ray& ray, double near) {
    Hit hit;
    for (const Body& body : bodies)
        if (const Crossing crossing = cross(body.solid, ray, near); crossing.t < hit.t)
            hit = facing(body, crossing, ray);
    return hit;
}

Mesh mesh_of(const Scene& scene) {
    std::vector<const Body*> unused;
    return tessellated(scene, unused);
}

World::World(const Scene& scene) : scene_(scene), surface_(tessellated(scene, body_of_triangle_)) {}

Hit World::cast(const Ray& ray) const {
    for (double near = 0;;) {
        const auto met = surface_.nearest(ray.origin, ray.direction, near);
        if (!met)
            return {};
        const Body& body = *body_of_triangle_[static_cast<std::size_t>(met->primitive)];
        if (const Crossing exact = cross(body.solid, ray, 1e-9); exact.t < never)
            return facing(body, exact, ray);
        near = met->distance * (1 + 1e-6); // in double precision the ray misses the rim that it grazed
    }
}

Eigen::Vector2d Optics::direction(double u, double v) const {
    const Eigen::Vector2d bent = pinhole.ray(u, v).head<2>();
    const auto straight = lens.any() ? undistorted(lens, bent) : std::optional(bent);
    if (!straight)
        throw Misuse(fmt::format("pixel {:.0f}, {:.0f} sees nothing through a lens with k1 {}", u, v, lens.k1));
    return *straight;
}

Vector3d albedo_at(const Hit& hit, const Vector3d& point) { return albedo(hit.body->material, point, hit.normal); }

Geometry render_geometry(const World& world, const Optics& camera, const Eigen::Isometry3d& world_from_camera) {
    Geometry geometry{cv::Mat1f(camera.pinhole.size, 0.0F), cv::Mat3f(camera.pinhole.size, cv::Vec3f(0, 0, 0))};
    for_each_pixel(camera, [&](int u, int v) {
        const Hit hit = world.cast(ray_through(camera, world_from_camera, u, v));
        if (!hit.body)
            return;
        const Eigen::Vector3f normal = (world_from_camera.linear().transpose() * hit.normal).cast<float>();
        geometry.z_m(v, u) = static_cast<float>(hit.t);
        geometry.normals(v, u) = {normal.x(), normal.y(), normal.z()};
    });
    return geometry;
}

cv::Mat3b render_colour(const World& world, const Optics& camera, const Eigen::Isometry3d& world_from_camera) {
    cv::Mat3b colour(camera.pinhole.size);
    for_each_pixel(camera, [&](int u, int v) {
        Vector3d sum = Vector3d::Zero();
        for (const double dv : {-0.25, 0.25})
            for (const double du : {-0.25, 0.25})
                sum += radiance(world, ray_through(camera, world_from_camera, u + du, v + dv));
        colour(v, u) = stored(sum / 4);
    });
    return colour;
}

Truth true_visibility(const World& world, const Optics& camera, const Eigen::Isometry3d& world_from_camera,
                      const TruthOptions& options) {
    const CosineDirections directions(options.rays, options.seed);
    const RayHemisphere hemisphere(world.surface(), directions, options.radius_m, options.all_falloffs);
    const std::size_t kinds = options.all_falloffs ? falloff_words.size() : 1;
    Truth truth;
    for (std::size_t kind = 0; kind < kinds; ++kind)
        truth.visibility[kind] = cv::Mat1f(camera.pinhole.size, std::numeric_limits<float>::quiet_NaN());
    truth.standard_error = truth.visibility[0].clone();
    for_each_pixel(camera, [&](int u, int v) {
        const Ray sight = ray_through(camera, world_from_camera, u, v);
        const Hit hit = world.cast(sight);
        if (!hit.body)
            return;
        const std::uint32_t key = hash(static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(v));
        const RayEstimate estimate = hemisphere.at({sight.origin + hit.t * sight.direction, hit.normal, key});
        for (std::size_t kind = 0; kind < kinds; ++kind)
            truth.visibility[kind](v, u) = estimate.visibility[kind];
        truth.standard_error(v, u) = estimate.standard_error[0];
    });
    return truth;
}

} // namespace scanshade::scene
