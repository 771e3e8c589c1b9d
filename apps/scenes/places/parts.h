// The parts that furniture is built of: bars, rods, wires, vessels, shells. World axes are those of
// apps/scenes/scene.h. Units are metres and radians.
#pragma once

#include "apps/scenes/world/scene.h"
#include "projection/base/hash.h"

#include <initializer_list>
#include <numbers>

namespace scanshade::scene {

using Eigen::Vector2d, Eigen::Vector3d;
using Bodies = std::vector<Body>;
inline constexpr double pi = std::numbers::pi;

/// Random numbers that are the same on every run.
class Random {
  public:
    explicit Random(std::uint32_t seed) : seed_(seed) {}
    double between(double low, double high) { return low + (high - low) * (hash(seed_, drawn_++) * 0x1p-32); }
    int below(int count) { return static_cast<int>(between(0, count)); }
    template <class Item>
    Item one_of(std::initializer_list<Item> items) {
        return *(items.begin() + below(static_cast<int>(items.size())));
    }

  private:
    std::uint32_t seed_, drawn_ = 0;
};

/// Adds solids, or triangles of a surface, of one material.
void add(Bodies& bodies, const Material& material, std::initializer_list<Solid> solids);
void add(Bodies& bodies, const Material& material, const std::vector<Triangle>& triangles);

/// Rotation about the vertical axis.
[[nodiscard]] Eigen::Matrix3d rotation_about_z(double yaw);
/// An upright box on a floor at height `floor_z`, with its middle over (x, y).
[[nodiscard]] Box box_on(double floor_z, double x, double y, double width, double depth, double height, double yaw = 0);
/// An axis-aligned box from one corner to the opposite one.
[[nodiscard]] Box block(const Vector3d& low, const Vector3d& high);
[[nodiscard]] Cylinder rod(const Vector3d& from, const Vector3d& to, double radius);
/// A bar of square section.
[[nodiscard]] Box bar(const Vector3d& from, const Vector3d& to, double width);
/// Corners in order around it.
[[nodiscard]] std::vector<Triangle> quad(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d);

/// A chain of rods through points.
void add_rod_chain(Bodies& bodies, const Material& material, const std::vector<Vector3d>& points, double radius);
/// A wire between two points that sags by `sag`.
void hang_wire(Bodies& bodies, const Material& material, const Vector3d& from, const Vector3d& to, double sag,
               double radius, int pieces = 12);
/// A ring of rods.
void add_ring(Bodies& bodies, const Material& material, const Vector3d& centre, const Vector3d& axis,
              double ring_radius, double radius, int pieces = 24);
/// An upright thin-walled vessel with a polygon for a circle. The profile is (radius, height) pairs from the foot up.
void add_vessel(Bodies& bodies, const Material& material, const Vector3d& foot, const std::vector<Vector2d>& profile,
                int sides = 24);
/// Walls, floor and ceiling as boxes around a room with one corner at the world's origin.
void add_shell(Bodies& bodies, const Vector3d& size, const Material& floor, const Material& wall,
               const Material& ceiling);

/// A piece of furniture's own axes in the room: rotated about z, the origin on the floor.
struct LocalFrame {
    Vector3d foot;
    double yaw = 0;

    [[nodiscard]] Vector3d operator()(double x, double y, double z) const {
        return foot + rotation_about_z(yaw) * Vector3d(x, y, z);
    }
    [[nodiscard]] Box box(double x, double y, double z, double width, double depth, double height) const {
        const Vector3d at = (*this)(x, y, z);
        return box_on(at.z(), at.x(), at.y(), width, depth, height, yaw);
    }
};

} // namespace scanshade::scene
