// The parts that furniture is built of, as solids that rays can hit.
#include "apps/scenes/places/parts.h"

#include <cmath>

namespace scanshade::scene {

void add(Bodies& bodies, const Material& material, std::initializer_list<Solid> solids) {
    for (const Solid& solid : solids)
        bodies.push_back({solid, material});
}

void add(Bodies& bodies, const Material& material, const std::vector<Triangle>& triangles) {
    for (const Triangle& triangle : triangles)
        bodies.push_back({triangle, material});
}

Eigen::Matrix3d rotation_about_z(double yaw) { return Eigen::AngleAxisd(yaw, Vector3d::UnitZ()).toRotationMatrix(); }

Box box_on(double floor_z, double x, double y, double width, double depth, double height, double yaw) {
    return {{x, y, floor_z + height / 2}, {width / 2, depth / 2, height / 2}, rotation_about_z(yaw)};
}

Box block(const Vector3d& low, const Vector3d& high) { return {(low + high) / 2, (high - low) / 2}; }

Cylinder rod(const Vector3d& from, const Vector3d& to, double radius) {
    const double length = (to - from).norm();
    return {from, radius, length, (to - from) / length};
}

Box bar(const Vector3d& from, const Vector3d& to, double width) {
    Eigen::Matrix3d axes;
    axes.col(2) = (to - from).normalized();
    axes.col(0) = axes.col(2).unitOrthogonal();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    return {(from + to) / 2, {width / 2, width / 2, (to - from).norm() / 2}, axes};
}

void add_rod_chain(Bodies& bodies, const Material& material, const std::vector<Vector3d>& points, double radius) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i)
        add(bodies, material, {rod(points[i], points[i + 1], radius)});
}

void hang_wire(Bodies& bodies, const Material& material, const Vector3d& from, const Vector3d& to, double sag,
               double radius, int pieces) {
    std::vector<Vector3d> points;
    for (int i = 0; i <= pieces; ++i) {
        const double s = static_cast<double>(i) / pieces;
        points.push_back(from + s * (to - from) - Vector3d(0, 0, 4 * sag * s * (1 - s)));
    }
    add_rod_chain(bodies, material, points, radius);
}

void add_ring(Bodies& bodies, const Material& material, const Vector3d& centre, const Vector3d& axis,
              double ring_radius, double radius, int pieces) {
    const Vector3d x = axis.unitOrthogonal(), y = axis.cross(x);
    std::vector<Vector3d> points;
    for (int i = 0; i <= pieces; ++i) {
        const double angle = 2 * pi * i / pieces;
        points.push_back(centre + ring_radius * (std::cos(angle) * x + std::sin(angle) * y));
    }
    add_rod_chain(bodies, material, points, radius);
}

void add_vessel(Bodies& bodies, const Material& material, const Vector3d& foot, const std::vector<Vector2d>& profile,
                int sides) {
    const auto at = [&](const Vector2d& p, int side) {
        const double angle = 2 * pi * side / sides;
        return Vector3d(foot + Vector3d(p.x() * std::cos(angle), p.x() * std::sin(angle), p.y()));
    };
    for (std::size_t i = 0; i + 1 < profile.size(); ++i)
        for (int side = 0; side < sides; ++side) {
            const Vector3d a = at(profile[i], side), b = at(profile[i], side + 1);
            const Vector3d c = at(profile[i + 1], side + 1), d = at(profile[i + 1], side);
            if (profile[i].x() > 0)
                add(bodies, material, {Triangle{a, b, c}});
            if (profile[i + 1].x() > 0)
                add(bodies, material, {Triangle{a, c, d}});
        }
}

std::vector<Triangle> quad(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
    return {{a, b, c}, {a, c, d}};
}

void add_shell(Bodies& bodies, const Vector3d& size, const Material& floor, const Material& wall,
               const Material& ceiling) {
    const double w = size.x(), d = size.y(), h = size.z();
    add(bodies, floor, {block({-1, -1, -1}, {w + 1, d + 1, 0})});
    add(bodies, ceiling, {block({-1, -1, h}, {w + 1, d + 1, h + 1})});
    add(bodies, wall,
        {block({-1, -1, 0}, {0, d + 1, h}), block({w, -1, 0}, {w + 1, d + 1, h}), block({0, -1, 0}, {w, 0, h}),
         block({0, d, 0}, {w, d + 1, h})});
}

} // namespace scanshade::scene
