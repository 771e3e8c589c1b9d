#include "apps/scene.h"

#include "apps/noise.h"
#include "projection/error.h"
#include "projection/srgb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <span>
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

Vector3d box_from_world(const Box& box, const Vector3d& vector) {
    const double cosine = box.heading.x(), sine = box.heading.y();
    return {cosine * vector.x() + sine * vector.y(), cosine * vector.y() - sine * vector.x(), vector.z()};
}
Vector3d world_from_box(const Box& box, const Vector3d& vector) {
    const double cosine = box.heading.x(), sine = box.heading.y();
    return {cosine * vector.x() - sine * vector.y(), cosine * vector.y() + sine * vector.x(), vector.z()};
}

Crossing cross(const Plane& plane, const Ray& ray, double near) {
    const double slope = plane.normal.dot(ray.direction);
    const double t = slope == 0 ? never : plane.normal.dot(plane.point - ray.origin) / slope;
    return t > near ? Crossing{t, plane.normal} : Crossing{};
}

/// Slabs (Kay and Kajiya 1986); from inside, the far wall counts.
Crossing cross(const Box& box, const Ray& ray, double near) {
    const Vector3d origin = box_from_world(box, ray.origin - box.centre);
    const Vector3d direction = box_from_world(box, ray.direction);
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
    const Vector3d normal = Vector3d::Unit(outside ? enter_axis : leave_axis);
    return {outside ? enter : leave, world_from_box(box, normal)};
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

Crossing cross(const Cylinder& cylinder, const Ray& ray, double near) {
    const Vector3d origin = ray.origin - cylinder.base;
    Crossing nearest;
    const double a = ray.direction.head<2>().squaredNorm();
    if (a > 0) {
        const double middle = -origin.head<2>().dot(ray.direction.head<2>()) / a;
        const double closest2 = (origin + middle * ray.direction).head<2>().squaredNorm();
        const double rest = cylinder.radius * cylinder.radius - closest2;
        if (rest < 0)
            return {};
        const double reach = std::sqrt(rest / a);
        for (const double t : {middle - reach, middle + reach}) {
            const Vector3d at = origin + t * ray.direction;
            if (t > near && t < nearest.t && at.z() >= 0 && at.z() <= cylinder.height)
                nearest = {t, Vector3d(at.x(), at.y(), 0) / cylinder.radius};
        }
    }
    if (ray.direction.z() != 0)
        for (const double height : {0.0, cylinder.height}) {
            const double t = (height - origin.z()) / ray.direction.z();
            const Vector3d at = origin + t * ray.direction;
            if (t > near && t < nearest.t && at.head<2>().squaredNorm() <= cylinder.radius * cylinder.radius)
                nearest = {t, Vector3d::UnitZ()};
        }
    return nearest;
}

Crossing cross(const Solid& solid, const Ray& ray, double near) {
    return std::visit([&](const auto& shape) { return cross(shape, ray, near); }, solid);
}

// ---------------------------------------------------------------------------------------------------- what is near

double distance_to_surface(const Plane& plane, const Vector3d& point) {
    return std::abs(plane.normal.dot(point - plane.point));
}

double distance_to_surface(const Box& box, const Vector3d& point) {
    const Vector3d local = box_from_world(box, point - box.centre);
    const Vector3d beyond = local.cwiseAbs() - box.half;
    return (beyond.array() <= 0).all() ? -beyond.maxCoeff() : beyond.cwiseMax(0).norm();
}

double distance_to_surface(const Sphere& sphere, const Vector3d& point) {
    return std::abs((point - sphere.centre).norm() - sphere.radius);
}

double distance_to_surface(const Cylinder& cylinder, const Vector3d& point) {
    const Vector3d local = point - cylinder.base;
    const double side = local.head<2>().norm() - cylinder.radius;
    const double end = std::abs(local.z() - cylinder.height / 2) - cylinder.height / 2;
    return side <= 0 && end <= 0 ? -std::max(side, end) : std::hypot(std::max(side, 0.0), std::max(end, 0.0));
}

/// How far a solid rises above the plane through `point` across `normal`; not above 0 = out of every ray's way from
/// there.
double rise_above(const Plane& plane, const Vector3d& point, const Vector3d& normal) {
    const bool parallel = std::abs(plane.normal.dot(normal)) > 1 - 1e-12;
    return parallel ? normal.dot(plane.point - point) : never;
}

double rise_above(const Box& box, const Vector3d& point, const Vector3d& normal) {
    return normal.dot(box.centre - point) + box_from_world(box, normal).cwiseAbs().dot(box.half);
}

double rise_above(const Sphere& sphere, const Vector3d& point, const Vector3d& normal) {
    return normal.dot(sphere.centre - point) + sphere.radius;
}

double rise_above(const Cylinder& cylinder, const Vector3d& point, const Vector3d& normal) {
    return normal.dot(cylinder.base - point) + std::max(0.0, normal.z() * cylinder.height) +
           normal.head<2>().norm() * cylinder.radius;
}

constexpr double flush = 1e-8; ///< metres: rounding of a point on a surface stays below, anything visible above

/// The solids that rays of that length about `normal` can meet: mostly none or one, which is what makes the truth
/// affordable.
void gather_near(const std::vector<Body>& bodies, const Vector3d& point, const Vector3d& normal, double radius_m,
                 std::vector<const Solid*>& near) {
    near.clear();
    for (const Body& body : bodies)
        if (std::visit(
                [&](const auto& shape) {
                    return distance_to_surface(shape, point) <= radius_m && rise_above(shape, point, normal) > flush;
                },
                body.solid))
            near.push_back(&body.solid);
}

// ---------------------------------------------------------------------------------------------------- pixels

Ray ray_through(const Pinhole& camera, const Eigen::Isometry3d& world_from_camera, double u, double v) {
    const Vector3d direction((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1); // so that t is depth
    return {world_from_camera.translation(), world_from_camera.linear() * direction};
}

/// A ball round a solid; endless for planes.
Sphere ball_round(const Solid& solid) {
    struct {
        Sphere operator()(const Plane& plane) const { return {plane.point, never}; }
        Sphere operator()(const Box& box) const { return {box.centre, box.half.norm()}; }
        Sphere operator()(const Sphere& sphere) const { return sphere; }
        Sphere operator()(const Cylinder& c) const {
            return {c.base + Vector3d(0, 0, c.height / 2), std::hypot(c.radius, c.height / 2)};
        }
    } round;
    return std::visit(round, solid);
}

using Visible = std::vector<const Body*>;

Hit cast_at(const Visible& bodies, const Ray& ray, double near) {
    Hit hit;
    for (const Body* body : bodies)
        if (const Crossing crossing = cross(body->solid, ray, near); crossing.t < hit.t)
            hit = {crossing.t, crossing.normal, body};
    if (hit.normal.dot(ray.direction) > 0)
        hit.normal = -hit.normal;
    return hit;
}

/// What a tile of pixels can see: the solids whose ball reaches into the cone round the tile.
Visible visible_in(const std::vector<Body>& bodies, const Pinhole& camera, const Eigen::Isometry3d& world_from_camera,
                   const cv::Rect& tile) {
    const auto direction = [&](double u, double v) {
        return Vector3d(ray_through(camera, world_from_camera, u, v).direction.normalized());
    };
    const double left = tile.x - 0.5, top = tile.y - 0.5, right = left + tile.width, bottom = top + tile.height;
    const Vector3d axis = direction((left + right) / 2, (top + bottom) / 2), eye = world_from_camera.translation();
    double half_angle = 0;
    for (const Vector3d& corner :
         {direction(left, top), direction(right, top), direction(left, bottom), direction(right, bottom)})
        half_angle = std::max(half_angle, std::acos(std::min(1.0, axis.dot(corner))));
    Visible seen;
    for (const Body& body : bodies) {
        const Sphere ball = ball_round(body.solid);
        const Vector3d to_ball = ball.centre - eye;
        const double distance = to_ball.norm();
        if (distance <= ball.radius || std::acos(std::clamp(axis.dot(to_ball) / distance, -1.0, 1.0)) <=
                                           half_angle + std::asin(ball.radius / distance) + 1e-6)
            seen.push_back(&body);
    }
    return seen;
}

/// Calls visit(bodies that pixel can see, u, v) for every pixel, tile by tile, on all cores.
template <class Visit>
void for_each_pixel(const Scene& scene, const Pinhole& camera, const Eigen::Isometry3d& world_from_camera,
                    Visit&& visit) {
    constexpr int side = 16;
    const int columns = (camera.size.width + side - 1) / side, rows = (camera.size.height + side - 1) / side;
    tbb::parallel_for(0, columns * rows, [&](int i) {
        const cv::Rect whole({0, 0}, camera.size);
        const cv::Rect tile = cv::Rect(i % columns * side, i / columns * side, side, side) & whole;
        const Visible bodies = visible_in(scene.bodies, camera, world_from_camera, tile);
        for (int v = tile.y; v < tile.br().y; ++v)
            for (int u = tile.x; u < tile.br().x; ++u)
                visit(bodies, u, v);
    });
}

// ---------------------------------------------------------------------------------------------------- visibility

/// Directions over a hemisphere about z, spread as their cosine: Roberts' R2 sequence in sets that differ by a random
/// shift (Cranley and Patterson 1976). Made once; each pixel picks a set and turns it about its normal.
class CosineRays {
  public:
    CosineRays(int rays, int seed) : rays_(rays), sets_(std::clamp(65536 / rays, 1, 256)) {
        directions_.reserve(static_cast<std::size_t>(rays_) * sets_);
        for (int set = 0; set < sets_; ++set) {
            const std::uint32_t key = hash(static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(set));
            for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(rays_); ++i) {
                const double a = (hash(key) + i * 3242174889U) * 0x1p-32; // uint32 wraps: that is the fraction
                const double b = 2 * std::numbers::pi * ((hash(key ^ 0x5bd1e995U) + i * 2447445414U) * 0x1p-32);
                directions_.emplace_back(std::sqrt(a) * std::cos(b), std::sqrt(a) * std::sin(b), std::sqrt(1 - a));
            }
        }
    }
    [[nodiscard]] std::span<const Vector3d> set_for(std::uint32_t pixel_key) const {
        return {directions_.data() + static_cast<std::size_t>(pixel_key % sets_) * rays_,
                static_cast<std::size_t>(rays_)};
    }

  private:
    int rays_, sets_;
    std::vector<Vector3d> directions_;
};

/// Axes with z along `normal`, turned about it by `angle`.
Eigen::Matrix3d axes_about(const Vector3d& normal, double angle) {
    // Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    const double sign = std::copysign(1.0, normal.z()), a = -1 / (sign + normal.z()), b = normal.x() * normal.y() * a;
    const Vector3d x(1 + sign * normal.x() * normal.x() * a, sign * b, -sign * normal.x());
    const Vector3d y(b, sign + normal.y() * normal.y() * a, -normal.y());
    const double cosine = std::cos(angle), sine = std::sin(angle);
    Eigen::Matrix3d axes;
    axes << cosine * x + sine * y, cosine * y - sine * x, normal;
    return axes;
}

double free_share(const std::vector<const Solid*>& near, const Vector3d& point, const Eigen::Matrix3d& axes,
                  std::span<const Vector3d> directions, double radius_m) {
    if (near.empty())
        return 1;
    const auto free = std::count_if(directions.begin(), directions.end(), [&](const Vector3d& direction) {
        const Ray ray{point, axes * direction};
        return std::none_of(near.begin(), near.end(),
                            [&](const Solid* solid) { return cross(*solid, ray, flush).t <= radius_m; });
    });
    return static_cast<double>(free) / static_cast<double>(directions.size());
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

/// Even light from above, soft light from each window, and a lamp beside the lens so that no face stays flat.
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

Vector3d radiance(const Scene& scene, const Visible& bodies, const Ray& ray) {
    const Hit hit = cast_at(bodies, ray, flush);
    if (!hit.body)
        return {0.6, 0.7, 0.85};
    const Vector3d point = ray.origin + hit.t * ray.direction;
    return albedo(hit.body->material, point, hit.normal).cwiseProduct(light_at(scene, point, hit.normal, ray.origin));
}

cv::Vec3b stored(const Vector3d& linear) {
    const auto byte = [](double value) {
        return static_cast<unsigned char>(std::lround(255 * srgb_from_linear(std::clamp(value, 0.0, 1.0))));
    };
    return {byte(linear.z()), byte(linear.y()), byte(linear.x())};
}

// ---------------------------------------------------------------------------------------------------- scenes

Box box_on(double floor_z, double x, double y, double width, double depth, double height, double yaw = 0) {
    return {{x, y, floor_z + height / 2}, {width / 2, depth / 2, height / 2}, {std::cos(yaw), std::sin(yaw)}};
}

void add(std::vector<Body>& bodies, const Material& material, std::initializer_list<Solid> solids) {
    for (const Solid& solid : solids)
        bodies.push_back({solid, material});
}

/// A room of 4.2 x 5.2 x 2.6 m with furniture against its walls and things on the floor.
Scene office() {
    const Material oak{{0.36, 0.21, 0.10}, {0.22, 0.12, 0.055}, Pattern::boards, 0.12};
    const Material floor{{0.42, 0.29, 0.17}, {0.27, 0.17, 0.09}, Pattern::boards, 0.16};
    const Material wall{{0.62, 0.60, 0.55}, {0.55, 0.53, 0.48}, Pattern::plaster, 0.25};
    const Material ceiling{{0.72, 0.72, 0.70}, {0.68, 0.68, 0.66}, Pattern::plaster, 0.4};
    const Material white{{0.66, 0.66, 0.64}, {}, Pattern::plain, 1};
    const Material steel{{0.22, 0.23, 0.25}, {}, Pattern::plain, 1};
    const Material cloth{{0.10, 0.16, 0.30}, {0.08, 0.12, 0.23}, Pattern::plaster, 0.02};
    const Material card{{0.45, 0.31, 0.17}, {0.40, 0.27, 0.14}, Pattern::plaster, 0.06};
    const Material books{{0.45, 0.08, 0.06}, {0.08, 0.22, 0.30}, Pattern::books, 0.035};
    const Material rug{{0.38, 0.10, 0.09}, {0.50, 0.43, 0.32}, Pattern::checks, 0.14};
    const Material red{{0.55, 0.07, 0.05}, {}, Pattern::plain, 1};
    const Material green{{0.10, 0.28, 0.12}, {}, Pattern::plain, 1};
    const double width = 4.2, depth = 5.2, height = 2.6;

    Scene scene{"office", "a furnished room of 4.2 x 5.2 x 2.6 m", {}, {}, {}};
    auto& bodies = scene.bodies;
    add(bodies, floor, {Box{{width / 2, depth / 2, -0.5}, {width / 2 + 1, depth / 2 + 1, 0.5}}});
    add(bodies, ceiling, {Box{{width / 2, depth / 2, height + 0.5}, {width / 2 + 1, depth / 2 + 1, 0.5}}});
    add(bodies, wall,
        {Box{{-0.5, depth / 2, height / 2}, {0.5, depth / 2 + 1, height / 2}},
         Box{{width + 0.5, depth / 2, height / 2}, {0.5, depth / 2 + 1, height / 2}},
         Box{{width / 2, -0.5, height / 2}, {width / 2, 0.5, height / 2}},
         Box{{width / 2, depth + 0.5, height / 2}, {width / 2, 0.5, height / 2}}});
    // Table with a lamp, books and a mug.
    add(bodies, oak, {box_on(0.72, 2.35, 3.55, 1.5, 0.8, 0.035, 0.12)});
    for (const auto& [x, y] : {std::pair{-0.68, -0.33}, {0.68, -0.33}, {-0.68, 0.33}, {0.68, 0.33}}) {
        const Eigen::Rotation2Dd turn(0.12);
        const Eigen::Vector2d leg = Eigen::Vector2d(2.35, 3.55) + turn * Eigen::Vector2d(x, y);
        add(bodies, steel, {Cylinder{{leg.x(), leg.y(), 0}, 0.025, 0.72}});
    }
    add(bodies, books, {box_on(0.755, 1.98, 3.66, 0.24, 0.17, 0.09, 0.5)});
    add(bodies, red, {Cylinder{{2.42, 3.40, 0.755}, 0.042, 0.1}});
    add(bodies, steel, {Cylinder{{2.85, 3.72, 0.755}, 0.09, 0.02}, Cylinder{{2.85, 3.72, 0.775}, 0.012, 0.32}});
    add(bodies, white, {Cylinder{{2.85, 3.72, 1.06}, 0.12, 0.16}});
    // Chair pushed half under the table.
    add(bodies, cloth, {box_on(0.44, 2.02, 2.88, 0.44, 0.44, 0.06, -0.35)});
    for (const auto& [x, y] : {std::pair{-0.19, -0.19}, {0.19, -0.19}, {-0.19, 0.19}, {0.19, 0.19}}) {
        const Eigen::Vector2d leg = Eigen::Vector2d(2.02, 2.88) + Eigen::Rotation2Dd(-0.35) * Eigen::Vector2d(x, y);
        add(bodies, oak, {Cylinder{{leg.x(), leg.y(), 0}, 0.018, 0.44}});
    }
    const Eigen::Vector2d back = Eigen::Vector2d(2.02, 2.88) + Eigen::Rotation2Dd(-0.35) * Eigen::Vector2d(0, -0.20);
    add(bodies, cloth, {box_on(0.56, back.x(), back.y(), 0.42, 0.04, 0.38, -0.35)});
    // Cupboard in the far left corner, with a box on top.
    add(bodies, oak, {box_on(0, 0.52, 4.88, 0.9, 0.55, 1.75)});
    add(bodies, steel, {box_on(0.9, 0.50, 4.595, 0.012, 0.02, 0.22), box_on(0.9, 0.56, 4.595, 0.012, 0.02, 0.22)});
    add(bodies, card, {box_on(1.75, 0.45, 4.88, 0.5, 0.38, 0.26, 0.2)});
    // Shelf on the far wall: boards between sides, filled with books and boxes.
    add(bodies, white, {box_on(0, 2.98, 5.04, 0.03, 0.30, 1.5), box_on(0, 4.08, 5.04, 0.03, 0.30, 1.5)});
    for (const double z : {0.08, 0.52, 0.98, 1.47})
        add(bodies, white, {box_on(z, 3.53, 5.04, 1.07, 0.30, 0.03)});
    add(bodies, books, {box_on(0.55, 3.28, 5.06, 0.48, 0.2, 0.26), box_on(1.01, 3.72, 5.06, 0.6, 0.2, 0.24)});
    add(bodies, card, {box_on(0.11, 3.4, 5.03, 0.4, 0.26, 0.28, 0.05), box_on(0.55, 3.83, 5.02, 0.3, 0.24, 0.2, -0.1)});
    add(bodies, green, {Sphere{{3.25, 5.03, 1.11}, 0.1}});
    // A column, a rug, a ball, boxes stacked askew, a waste bin.
    add(bodies, wall, {Cylinder{{3.55, 2.7, 0}, 0.16, height}});
    add(bodies, rug, {box_on(0, 1.25, 2.45, 1.3, 1.7, 0.012, 0.05)});
    add(bodies, red, {Sphere{{1.05, 2.62, 0.162}, 0.15}});
    add(bodies, card,
        {box_on(0, 0.62, 3.55, 0.55, 0.45, 0.38, 0.35), box_on(0.38, 0.60, 3.58, 0.38, 0.32, 0.26, 0.05),
         box_on(0, 1.18, 3.82, 0.32, 0.30, 0.24, -0.4)});
    add(bodies, steel, {Cylinder{{3.05, 2.45, 0}, 0.13, 0.32}});
    // Skirting along the walls.
    add(bodies, white,
        {box_on(0, 0.0075, depth / 2, 0.015, depth, 0.08), box_on(0, width - 0.0075, depth / 2, 0.015, depth, 0.08),
         box_on(0, width / 2, depth - 0.0075, width, 0.015, 0.08)});
    scene.windows = {{0.3, 1.4, 1.9}, {2.2, 0.3, 2.3}};
    scene.walk = {{1.95, 0.85, 1.45}, {0.85, 0.35, 0.12}, {2.0, 3.7, 0.62}, 16};
    return scene;
}

} // namespace

const std::vector<Scene>& scenes() {
    static const std::vector<Scene> table{office()};
    return table;
}

const Scene& scene_named(std::string_view name) {
    std::string names;
    for (const Scene& scene : scenes()) {
        if (scene.name == name)
            return scene;
        names += fmt::format("{}{}", names.empty() ? "" : ", ", scene.name);
    }
    throw Misuse(fmt::format("no scene '{}', there are: {}", name, names));
}

Eigen::Isometry3d looking_at(const Vector3d& eye, const Vector3d& target) {
    const Vector3d forward = (target - eye).normalized();
    Vector3d right = forward.cross(Vector3d::UnitZ());
    right = right.norm() > 1e-9 ? right.normalized() : Vector3d::UnitX(); // straight up or down: any upright will do
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() << right, forward.cross(right), forward;
    pose.translation() = eye;
    return pose;
}

Eigen::Isometry3d world_from_camera(const Walk& walk, double seconds) {
    const double phase =
        0.7 + 2 * std::numbers::pi * seconds / walk.period_s; // begins on the move, not at a turning point
    const Vector3d swing(-std::cos(phase), std::sin(phase), std::sin(2 * phase));
    // Three sines without a common period, a few millimetres and tenths of a degree: a steady hand.
    const auto sway = [&](double hertz, double offset) {
        return std::sin(2 * std::numbers::pi * hertz * seconds + offset);
    };
    const Vector3d tremble(sway(1.3, 0.4), sway(0.9, 2.0), sway(1.7, 4.1));
    const Vector3d eye = walk.centre + walk.reach.cwiseProduct(swing) + 0.004 * tremble;
    const Vector3d gaze = walk.gaze + 0.25 * walk.reach.cwiseProduct(swing) + 0.02 * tremble;
    Eigen::Isometry3d pose = looking_at(eye, gaze);
    pose.rotate(Eigen::AngleAxisd(0.01 * sway(0.7, 1.0), Vector3d::UnitZ()));
    return pose;
}

Hit cast(const std::vector<Body>& bodies, const Ray& ray, double near) {
    Visible all;
    for (const Body& body : bodies)
        all.push_back(&body);
    return cast_at(all, ray, near);
}

Geometry render_geometry(const Scene& scene, const Pinhole& camera, const Eigen::Isometry3d& world_from_camera) {
    Geometry geometry{cv::Mat1f(camera.size, 0.0F), cv::Mat3f(camera.size, cv::Vec3f(0, 0, 0))};
    for_each_pixel(scene, camera, world_from_camera, [&](const Visible& bodies, int u, int v) {
        const Hit hit = cast_at(bodies, ray_through(camera, world_from_camera, u, v), flush);
        if (!hit.body)
            return;
        const Eigen::Vector3f normal = (world_from_camera.linear().transpose() * hit.normal).cast<float>();
        geometry.z_m(v, u) = static_cast<float>(hit.t);
        geometry.normals(v, u) = {normal.x(), normal.y(), normal.z()};
    });
    return geometry;
}

cv::Mat3b render_colour(const Scene& scene, const Pinhole& camera, const Eigen::Isometry3d& world_from_camera) {
    cv::Mat3b colour(camera.size);
    for_each_pixel(scene, camera, world_from_camera, [&](const Visible& bodies, int u, int v) {
        Vector3d sum = Vector3d::Zero();
        for (const double dv : {-0.25, 0.25})
            for (const double du : {-0.25, 0.25})
                sum += radiance(scene, bodies, ray_through(camera, world_from_camera, u + du, v + dv));
        colour(v, u) = stored(sum / 4);
    });
    return colour;
}

cv::Mat1f true_visibility(const Scene& scene, const Pinhole& camera, const Eigen::Isometry3d& world_from_camera,
                          double radius_m, int rays, int seed) {
    cv::Mat1f visibility(camera.size, std::numeric_limits<float>::quiet_NaN());
    const CosineRays directions(rays, seed);
    for_each_pixel(scene, camera, world_from_camera, [&](const Visible& bodies, int u, int v) {
        const Ray sight = ray_through(camera, world_from_camera, u, v);
        const Hit hit = cast_at(bodies, sight, flush);
        if (!hit.body)
            return;
        thread_local std::vector<const Solid*> near;
        const Vector3d point = sight.origin + hit.t * sight.direction;
        gather_near(scene.bodies, point, hit.normal, radius_m, near);
        const std::uint32_t key = hash(static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(v));
        const Eigen::Matrix3d axes = axes_about(hit.normal, 2 * std::numbers::pi * hash(key) * 0x1p-32);
        visibility(v, u) = static_cast<float>(free_share(near, point, axes, directions.set_for(key), radius_m));
    });
    return visibility;
}

bool blocked(const std::vector<Body>& bodies, const Vector3d& from, const Vector3d& to) {
    constexpr double clear_of_ends = 1e-6;
    const Ray ray{from, to - from};
    return std::any_of(bodies.begin(), bodies.end(),
                       [&](const Body& body) { return cross(body.solid, ray, clear_of_ends).t < 1 - clear_of_ends; });
}

} // namespace scanshade::scene
