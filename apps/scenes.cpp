// The table of scenes: what stands where. Things are built from parts (a chair, a railing, a heap), rooms from things.
#include "apps/scene.h"

#include "projection/hash.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>
#include <initializer_list>
#include <numbers>
#include <utility>

namespace scanshade::scene {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;
using Bodies = std::vector<Body>;
constexpr double pi = std::numbers::pi;

// ---------------------------------------------------------------------------------------------------- materials

const Material oak{{0.36, 0.21, 0.10}, {0.22, 0.12, 0.055}, Pattern::boards, 0.12};
const Material boards{{0.42, 0.29, 0.17}, {0.27, 0.17, 0.09}, Pattern::boards, 0.16};
const Material plaster{{0.62, 0.60, 0.55}, {0.55, 0.53, 0.48}, Pattern::plaster, 0.25};
const Material whitewash{{0.72, 0.72, 0.70}, {0.68, 0.68, 0.66}, Pattern::plaster, 0.4};
const Material white{{0.66, 0.66, 0.64}, {}, Pattern::plain, 1};
const Material steel{{0.22, 0.23, 0.25}, {}, Pattern::plain, 1};
const Material cloth{{0.10, 0.16, 0.30}, {0.08, 0.12, 0.23}, Pattern::plaster, 0.02};
const Material card{{0.45, 0.31, 0.17}, {0.40, 0.27, 0.14}, Pattern::plaster, 0.06};
const Material books{{0.45, 0.08, 0.06}, {0.08, 0.22, 0.30}, Pattern::books, 0.035};
const Material woven_rug{{0.38, 0.10, 0.09}, {0.50, 0.43, 0.32}, Pattern::checks, 0.14};
const Material red{{0.55, 0.07, 0.05}, {}, Pattern::plain, 1};
const Material green{{0.10, 0.28, 0.12}, {}, Pattern::plain, 1};
const Material yellow{{0.58, 0.42, 0.06}, {}, Pattern::plain, 1};
const Material clay{{0.48, 0.21, 0.12}, {0.40, 0.17, 0.10}, Pattern::plaster, 0.05};
const Material stone{{0.50, 0.47, 0.41}, {0.40, 0.38, 0.34}, Pattern::plaster, 0.15};
const Material tiles{{0.52, 0.50, 0.46}, {0.24, 0.25, 0.26}, Pattern::checks, 0.4};
const Material leaves{{0.11, 0.24, 0.07}, {0.17, 0.30, 0.09}, Pattern::plaster, 0.12};
const Material grass{{0.16, 0.27, 0.08}, {0.22, 0.24, 0.11}, Pattern::plaster, 0.7};
const Material bark{{0.20, 0.14, 0.09}, {0.14, 0.10, 0.07}, Pattern::plaster, 0.08};
const Material brick{{0.43, 0.18, 0.12}, {0.36, 0.15, 0.10}, Pattern::plaster, 0.12};
const Material slate{{0.17, 0.17, 0.19}, {0.13, 0.13, 0.15}, Pattern::boards, 0.25};

// ---------------------------------------------------------------------------------------------------- parts

/// Throws that come out the same on every run.
class Dice {
  public:
    explicit Dice(std::uint32_t seed) : seed_(seed) {}
    double between(double low, double high) { return low + (high - low) * (hash(seed_, thrown_++) * 0x1p-32); }
    int below(int count) { return static_cast<int>(between(0, count)); }
    template <class Item>
    Item one_of(std::initializer_list<Item> items) {
        return *(items.begin() + below(static_cast<int>(items.size())));
    }

  private:
    std::uint32_t seed_, thrown_ = 0;
};

void add(Bodies& bodies, const Material& material, std::initializer_list<Solid> solids) {
    for (const Solid& solid : solids)
        bodies.push_back({solid, material});
}

void add(Bodies& bodies, const Material& material, const std::vector<Triangle>& triangles) {
    for (const Triangle& triangle : triangles)
        bodies.push_back({triangle, material});
}

Eigen::Matrix3d turned(double yaw) { return Eigen::AngleAxisd(yaw, Vector3d::UnitZ()).toRotationMatrix(); }

Box box_on(double floor_z, double x, double y, double width, double depth, double height, double yaw = 0) {
    return {{x, y, floor_z + height / 2}, {width / 2, depth / 2, height / 2}, turned(yaw)};
}

/// From one corner to the opposite one.
Box block(const Vector3d& low, const Vector3d& high) { return {(low + high) / 2, (high - low) / 2}; }

Cylinder rod(const Vector3d& from, const Vector3d& to, double radius) {
    const double length = (to - from).norm();
    return {from, radius, length, (to - from) / length};
}

/// A bar of square section.
Box bar(const Vector3d& from, const Vector3d& to, double width) {
    Eigen::Matrix3d axes;
    axes.col(2) = (to - from).normalized();
    axes.col(0) = axes.col(2).unitOrthogonal();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    return {(from + to) / 2, {width / 2, width / 2, (to - from).norm() / 2}, axes};
}

/// A chain of rods through points.
void string_up(Bodies& bodies, const Material& material, const std::vector<Vector3d>& points, double radius) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i)
        add(bodies, material, {rod(points[i], points[i + 1], radius)});
}

/// A wire between two points that hangs through by `sag`.
void hang_wire(Bodies& bodies, const Material& material, const Vector3d& from, const Vector3d& to, double sag,
               double radius, int pieces = 12) {
    std::vector<Vector3d> points;
    for (int i = 0; i <= pieces; ++i) {
        const double s = static_cast<double>(i) / pieces;
        points.push_back(from + s * (to - from) - Vector3d(0, 0, 4 * sag * s * (1 - s)));
    }
    string_up(bodies, material, points, radius);
}

/// A ring of rods.
void add_ring(Bodies& bodies, const Material& material, const Vector3d& centre, const Vector3d& axis,
              double ring_radius, double radius, int pieces = 24) {
    const Vector3d x = axis.unitOrthogonal(), y = axis.cross(x);
    std::vector<Vector3d> points;
    for (int i = 0; i <= pieces; ++i) {
        const double turn = 2 * pi * i / pieces;
        points.push_back(centre + ring_radius * (std::cos(turn) * x + std::sin(turn) * y));
    }
    string_up(bodies, material, points, radius);
}

/// An upright thin-walled vessel with a polygon for a circle: (radius, height) pairs from the foot on.
void turn_on_lathe(Bodies& bodies, const Material& material, const Vector3d& foot, const std::vector<Vector2d>& profile,
                   int sides = 24) {
    const auto at = [&](const Vector2d& p, int side) {
        const double turn = 2 * pi * side / sides;
        return Vector3d(foot + Vector3d(p.x() * std::cos(turn), p.x() * std::sin(turn), p.y()));
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

/// Walls, floor and ceiling as boxes round a room that begins at the world's origin.
void add_shell(Bodies& bodies, const Vector3d& size, const Material& floor, const Material& wall,
               const Material& ceiling) {
    const double w = size.x(), d = size.y(), h = size.z();
    add(bodies, floor, {block({-1, -1, -1}, {w + 1, d + 1, 0})});
    add(bodies, ceiling, {block({-1, -1, h}, {w + 1, d + 1, h + 1})});
    add(bodies, wall,
        {block({-1, -1, 0}, {0, d + 1, h}), block({w, -1, 0}, {w + 1, d + 1, h}), block({0, -1, 0}, {w, 0, h}),
         block({0, d, 0}, {w, d + 1, h})});
}

// ---------------------------------------------------------------------------------------------------- things

/// A thing's own axes in the room: x and y turned, the origin on the floor.
struct Place {
    Vector3d foot;
    double yaw = 0;

    [[nodiscard]] Vector3d operator()(double x, double y, double z) const {
        return foot + turned(yaw) * Vector3d(x, y, z);
    }
    [[nodiscard]] Box box(double x, double y, double z, double width, double depth, double height) const {
        const Vector3d at = (*this)(x, y, z);
        return box_on(at.z(), at.x(), at.y(), width, depth, height, yaw);
    }
};

void add_table(Bodies& bodies, const Place& at, double width, double depth, double height) {
    const double x = width / 2 - 0.06, y = depth / 2 - 0.06;
    add(bodies, oak,
        {at.box(0, 0, height - 0.035, width, depth, 0.035), at.box(0, y, height - 0.12, 2 * x, 0.02, 0.085),
         at.box(0, -y, height - 0.12, 2 * x, 0.02, 0.085)});
    for (const auto& [sx, sy] : {std::pair{-1, -1}, {1, -1}, {-1, 1}, {1, 1}})
        add(bodies, oak, {at.box(sx * x, sy * y, 0, 0.05, 0.05, height - 0.035)});
}

/// A wooden chair with a back of spindles, its front towards -y.
void add_chair(Bodies& bodies, const Place& at, double spindle_radius = 0.008) {
    add(bodies, oak, {at.box(0, 0, 0.44, 0.42, 0.42, 0.03), at.box(0, 0.195, 0.86, 0.40, 0.025, 0.07)});
    for (const auto& [sx, sy] : {std::pair{-1, -1}, {1, -1}, {-1, 1}, {1, 1}})
        add(bodies, oak, {rod(at(0.19 * sx, 0.19 * sy, 0), at(0.18 * sx, 0.18 * sy, 0.44), 0.017)});
    for (const int side : {-1, 1})
        add(bodies, oak,
            {rod(at(0.185 * side, 0.19, 0.47), at(0.185 * side, 0.20, 0.90), 0.015),
             rod(at(0.188 * side, -0.188, 0.18), at(0.188 * side, 0.188, 0.18), 0.009)});
    for (int i = -2; i <= 2; ++i)
        add(bodies, oak, {rod(at(0.065 * i, 0.19, 0.47), at(0.065 * i, 0.195, 0.87), spindle_radius)});
}

/// Boards between two sides, each bearing what dice put there.
void add_shelf(Bodies& bodies, const Place& at, double width, double height, int levels, Dice& dice) {
    const double depth = 0.32, pitch = height / levels;
    add(bodies, white, {at.box(-width / 2, 0, 0, 0.025, depth, height), at.box(width / 2, 0, 0, 0.025, depth, height)});
    for (int level = 0; level <= levels; ++level)
        add(bodies, white, {at.box(0, 0, std::max(level * pitch - 0.025, 0.04), width, depth, 0.025)});
    for (int level = 0; level < levels; ++level) {
        const double z = level == 0 ? 0.065 : level * pitch;
        for (double x = -width / 2 + 0.05; x < width / 2 - 0.2;) {
            const double wide = dice.between(0.08, 0.3), high = dice.between(0.3, 0.8) * (pitch - 0.05);
            const double back = dice.between(-0.03, 0.06);
            switch (dice.below(5)) {
            case 0:
            case 1:
                add(bodies, books, {at.box(x + wide / 2, back, z, wide, 0.2, high)});
                break;
            case 2:
                add(bodies, card, {at.box(x + wide / 2, back, z, wide, 0.24, high)});
                break;
            case 3:
                turn_on_lathe(bodies, clay, at(x + wide / 2, 0, z),
                              {{0, 0.004}, {0.3 * wide, 0.004}, {0.45 * wide, 0.5 * high}, {0.32 * wide, high}}, 16);
                break;
            default:
                break; // a gap
            }
            x += wide + dice.between(0.01, 0.06);
        }
    }
}

/// Posts and rails along a line, with a handrail; `pitch` between the posts.
void add_railing(Bodies& bodies, const Vector3d& from, const Vector3d& to, double height, double pitch, double radius) {
    const Vector3d up(0, 0, height);
    const int posts = std::max(1, static_cast<int>((to - from).norm() / pitch));
    for (int i = 0; i <= posts; ++i) {
        const Vector3d foot = from + (to - from) * i / posts;
        add(bodies, steel, {rod(foot, foot + up, radius)});
    }
    add(bodies, oak, {rod(from + up, to + up, 0.025)});
    add(bodies, steel, {rod(from + 0.12 * Vector3d::UnitZ(), to + 0.12 * Vector3d::UnitZ(), radius)});
}

/// A column radiator on short feet.
void add_radiator(Bodies& bodies, const Place& at, int columns) {
    for (int i = 0; i < columns; ++i)
        add(bodies, white, {at.box(0.06 * (i - (columns - 1) / 2.0), 0, 0.12, 0.035, 0.14, 0.55)});
    for (const double z : {0.17, 0.62})
        add(bodies, white, {rod(at(-0.03 * columns, 0, z), at(0.03 * columns, 0, z), 0.02)});
}

void add_pot_plant(Bodies& bodies, const Vector3d& foot, double size, Dice& dice) {
    turn_on_lathe(bodies, clay, foot,
                  {{0, 0.002}, {0.11 * size, 0.002}, {0.15 * size, 0.25 * size}, {0.17 * size, 0.25 * size}});
    add(bodies, bark, {Cylinder{foot + Vector3d(0, 0, 0.15 * size), 0.13 * size, 0.02}});
    for (int i = 0; i < 14; ++i) {
        const double turn = 2.4 * i, lean = dice.between(0.1, 0.45) * size;
        const Vector3d root = foot + Vector3d(0.04 * std::cos(turn), 0.04 * std::sin(turn), 0.16 * size);
        const Vector3d tip =
            root + Vector3d(lean * std::cos(turn), lean * std::sin(turn), dice.between(0.4, 0.9) * size);
        const Vector3d middle = (root + tip) / 2 + Vector3d(0, 0, 0.12 * size);
        string_up(bodies, leaves, {root, middle, tip}, 0.005);
        const Vector3d across = (tip - middle).cross(Vector3d::UnitZ()).normalized() * 0.05 * size;
        const Vector3d end = tip + (tip - middle) * 0.5 - Vector3d(0, 0, 0.06 * size);
        add(bodies, leaves, {Triangle{middle, tip + across, tip - across}, Triangle{tip + across, end, tip - across}});
    }
}

/// Leaning against a wall towards +y.
void add_bicycle(Bodies& bodies, const Place& at) {
    const auto lean = [&](double x, double z) { return at(x, 0.12 * z, z); };
    const Vector3d across =
        (lean(0, 1) - lean(0, 0)).normalized().cross(turned(at.yaw) * Vector3d::UnitX()).normalized();
    for (const double x : {-0.5, 0.52}) {
        add_ring(bodies, steel, lean(x, 0.34), across, 0.33, 0.017, 32);
        for (int i = 0; i < 18; ++i) {
            const double turn = 2 * pi * i / 18;
            add(bodies, steel,
                {rod(lean(x, 0.34), lean(x + 0.33 * std::cos(turn), 0.34 + 0.33 * std::sin(turn)), 0.0025)});
        }
        add(bodies, steel, {rod(lean(x, 0.34) - 0.05 * across, lean(x, 0.34) + 0.05 * across, 0.02)});
    }
    const Vector3d rear = lean(-0.5, 0.34), pedal = lean(-0.06, 0.29), seat = lean(-0.2, 0.86), head = lean(0.36, 0.84);
    const Vector3d fork = lean(0.52, 0.34), bars = lean(0.32, 1.02);
    string_up(bodies, red, {rear, pedal, head, seat, pedal}, 0.016);
    string_up(bodies, red, {seat, rear}, 0.009);
    string_up(bodies, red, {bars, fork}, 0.014);
    add(bodies, steel,
        {rod(bars - 0.26 * across, bars + 0.26 * across, 0.012),
         rod(pedal - 0.09 * across, pedal + 0.09 * across, 0.09)});
    add(bodies, cloth, {Box{seat + Vector3d(0, 0, 0.06), {0.13, 0.07, 0.03}, turned(at.yaw)}});
}

/// Where things come to rest that are let down one by one: the height of what lies there so far, on a grid of 2 cm.
class Heap {
  public:
    Heap(const Vector2d& low, const Vector2d& high, double floor_z)
        : low_(low), columns_(cells(high.x() - low.x())), rows_(cells(high.y() - low.y())),
          top_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), floor_z) {}

    /// Lets a thing with a round footprint down; returns the height it rests at.
    double settle(const Vector2d& at, double radius, double height) {
        double rest = -1e9;
        for_cells(at, radius, [&](double& top) { rest = std::max(rest, top); });
        for_cells(at, radius, [&](double& top) { top = rest + height; });
        return rest;
    }

  private:
    static constexpr double cell = 0.02;
    static int cells(double length) { return static_cast<int>(std::ceil(length / cell)); }
    template <class Visit>
    void for_cells(const Vector2d& at, double radius, Visit&& visit) {
        const auto index = [&](double offset, int count) {
            return std::clamp(static_cast<int>(offset / cell), 0, count - 1);
        };
        for (int row = index(at.y() - radius - low_.y(), rows_); row <= index(at.y() + radius - low_.y(), rows_); ++row)
            for (int column = index(at.x() - radius - low_.x(), columns_);
                 column <= index(at.x() + radius - low_.x(), columns_); ++column)
                if ((low_ + cell * Vector2d(column + 0.5, row + 0.5) - at).norm() <= radius + cell)
                    visit(top_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                               static_cast<std::size_t>(column)]);
    }

    Vector2d low_;
    int columns_, rows_;
    std::vector<double> top_;
};

/// One thing of about `size`, let down on a heap: boxes, some tipped over, balls, cans, bowls, pipes, open cartons.
void drop(Bodies& bodies, Heap& heap, const Vector2d& at, double size, Dice& dice) {
    const Material paint = dice.one_of({card, red, green, yellow, white, cloth, books, steel, clay});
    const double yaw = dice.between(0, pi), tall = size * dice.between(0.4, 1.3);
    switch (dice.below(8)) {
    case 0:
    case 1:
    case 2: {
        const double wide = size * dice.between(0.6, 1), deep = size * dice.between(0.4, 0.9);
        const double z = heap.settle(at, 0.42 * std::min(wide, deep), tall);
        add(bodies, paint, {box_on(z, at.x(), at.y(), wide, deep, tall, yaw)});
        break;
    }
    case 3: { // tipped over, resting on an edge
        const double tilt = dice.between(0.3, 1.2), half = size * 0.35;
        const double high = 2 * half * (std::sin(tilt) + std::cos(tilt));
        const double z = heap.settle(at, half, high * 0.9);
        const Eigen::Matrix3d axes = turned(yaw) * Eigen::AngleAxisd(tilt, Vector3d::UnitX()).toRotationMatrix();
        add(bodies, paint, {Box{{at.x(), at.y(), z + high / 2}, {half * 1.3, half, half}, axes}});
        break;
    }
    case 4: {
        const double radius = size * 0.4, z = heap.settle(at, radius * 0.7, 1.8 * radius);
        add(bodies, paint, {Sphere{{at.x(), at.y(), z + radius}, radius}});
        break;
    }
    case 5: {
        const double radius = size * 0.35, z = heap.settle(at, radius, tall);
        add(bodies, paint, {Cylinder{{at.x(), at.y(), z}, radius, tall}});
        break;
    }
    case 6: { // a bowl or bucket
        const double z = heap.settle(at, size * 0.4, tall * 0.3);
        turn_on_lathe(bodies, paint, {at.x(), at.y(), z},
                      {{0, 0.004}, {0.28 * size, 0.004}, {0.42 * size, 0.35 * tall}, {0.48 * size, 0.9 * tall}}, 20);
        break;
    }
    default: { // an open carton
        const double half = size * 0.5, z = heap.settle(at, half, 0.3 * tall), wall = 0.006;
        const Place place{{at.x(), at.y(), z}, yaw};
        add(bodies, card,
            {place.box(0, 0, 0, 2 * half, 2 * half, wall), place.box(-half, 0, 0, wall, 2 * half, tall),
             place.box(half, 0, 0, wall, 2 * half, tall), place.box(0, -half, 0, 2 * half, wall, tall),
             place.box(0, half, 0, 2 * half, wall, tall)});
        const Eigen::Matrix3d flap = turned(yaw) * Eigen::AngleAxisd(0.5, Vector3d::UnitY()).toRotationMatrix();
        add(bodies, card, {Box{place(half + 0.07, 0, tall - 0.04), {0.08, half, wall / 2}, flap}});
    }
    }
}

void drop_many(Bodies& bodies, const Vector2d& low, const Vector2d& high, double floor_z, int count, double smallest,
               double largest, Dice& dice) {
    Heap heap(low, high, floor_z);
    for (int i = 0; i < count; ++i) { // large things first, as they lie in real heaps
        const double size = largest - (largest - smallest) * i / count, rim = size / 2;
        drop(bodies, heap, {dice.between(low.x() + rim, high.x() - rim), dice.between(low.y() + rim, high.y() - rim)},
             size, dice);
    }
}

// ---------------------------------------------------------------------------------------------------- scenes

/// A room of 4.2 x 5.2 x 2.6 m with furniture against its walls and things on the floor.
Scene office() {
    const double width = 4.2, depth = 5.2, height = 2.6;

    Scene scene{.name = "office", .summary = "a furnished room of 4.2 x 5.2 x 2.6 m"};
    auto& bodies = scene.bodies;
    add(bodies, boards, {Box{{width / 2, depth / 2, -0.5}, {width / 2 + 1, depth / 2 + 1, 0.5}}});
    add(bodies, whitewash, {Box{{width / 2, depth / 2, height + 0.5}, {width / 2 + 1, depth / 2 + 1, 0.5}}});
    add(bodies, plaster,
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
    add(bodies, plaster, {Cylinder{{3.55, 2.7, 0}, 0.16, height}});
    add(bodies, woven_rug, {box_on(0, 1.25, 2.45, 1.3, 1.7, 0.012, 0.05)});
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
    scene.walk = {{{{1.30, 1.08, 1.57}, {1.84, 3.76, 0.65}},
                   {{1.95, 1.20, 1.33}, {2.60, 4.40, 0.85}},
                   {{2.80, 0.95, 1.40}, {3.40, 4.60, 0.90}},
                   {{3.30, 1.50, 1.50}, {1.00, 4.60, 0.90}},
                   {{2.70, 1.75, 1.35}, {0.60, 3.60, 0.35}},
                   {{1.80, 1.60, 1.60}, {0.30, 4.20, 0.80}},
                   {{1.00, 1.30, 1.20}, {3.30, 3.50, 0.60}},
                   {{0.75, 0.80, 1.30}, {3.60, 2.60, 0.50}}},
                  20};
    return scene;
}

/// A stairwell of 5 x 6.5 x 5.6 m: two flights with a landing between them, and what is kept below and beside them.
Scene staircase() {
    Scene scene{.name = "staircase", .summary = "a stairwell with two flights, railings, niches and things kept below"};
    Bodies& bodies = scene.bodies;
    Dice dice(11);
    add_shell(bodies, {5, 6.5, 5.6}, tiles, plaster, whitewash);
    constexpr int steps = 10;
    constexpr double rise = 0.17, run = 0.29, start = 1.6;
    // First flight: solid steps whose treads overhang. Second flight, back towards the entrance: treads on two
    // stringers.
    for (int i = 0; i < steps; ++i) {
        const double y = start + i * run, z = rise * (i + 1);
        add(bodies, stone, {block({0, y, 0}, {1.3, y + run + 0.01, z - 0.03})});
        add(bodies, oak, {block({0, y - 0.03, z - 0.03}, {1.32, y + run, z})});
        const double back = start + steps * run - i * run, up = rise * (steps + i + 1);
        add(bodies, oak, {block({1.55, back - run - 0.02, up - 0.045}, {2.75, back + 0.02, up})});
    }
    const double landing_y = start + steps * run, landing_z = rise * steps;
    add(bodies, oak, {block({0, landing_y, landing_z - 0.2}, {2.8, 6.5, landing_z})});
    add(bodies, stone, {block({2.55, 6.2, 0}, {2.8, 6.5, landing_z - 0.2})});
    for (const double x : {1.62, 2.66})
        add(bodies, oak, {bar({x, landing_y, landing_z - 0.05}, {x, start, 2 * landing_z - 0.2}, 0.07)});
    add(bodies, whitewash, {block({0, 0, 3.2}, {5, start, 3.4})}); // the gallery
    add_railing(bodies, {1.26, start + 0.1, rise}, {1.26, landing_y - 0.1, landing_z}, 0.95, 0.14, 0.009);
    add_railing(bodies, {2.7, landing_y - 0.2, landing_z + rise}, {2.7, start + 0.1, 2 * landing_z}, 0.95, 0.14, 0.009);
    add_railing(bodies, {2.75, landing_y + 0.1, landing_z}, {2.75, 6.4, landing_z}, 0.95, 0.11, 0.009);
    add_railing(bodies, {2.85, start - 0.05, 3.4}, {4.95, start - 0.05, 3.4}, 0.95, 0.11, 0.009);
    // Below the second flight and the landing: boxes, a bicycle, brooms.
    drop_many(bodies, {1.6, 4.7}, {2.5, 6.4}, 0, 14, 0.12, 0.42, dice);
    add_bicycle(bodies, {{3.9, 6.18, 0}, 0});
    for (const double x : {2.95, 3.02, 3.12}) {
        add(bodies, oak, {rod({x, 6.05, 0.05}, {x + 0.05, 6.47, 1.4}, 0.012)});
        add(bodies, card, {Box{{x, 6.04, 0.05}, {0.02, 0.12, 0.05}}});
    }
    // Along the right wall: a bench with shoes under it, coat hooks, a niche between pilasters, a radiator, pipes.
    add(bodies, oak,
        {block({4.55, 2.2, 0.40}, {5, 3.6, 0.45}), block({4.6, 2.25, 0}, {4.98, 2.30, 0.40}),
         block({4.6, 3.50, 0}, {4.98, 3.55, 0.40}), block({4.93, 2.2, 1.6}, {5, 3.6, 1.72})});
    for (int i = 0; i < 6; ++i) {
        const double y = 2.35 + 0.21 * i;
        add(bodies, books, {box_on(0, 4.74 + dice.between(-0.05, 0.05), y, 0.26, 0.09, 0.09, dice.between(-0.3, 0.3))});
        add(bodies, steel, {rod({4.93, y, 1.66}, {4.82, y, 1.70}, 0.008)});
    }
    add(bodies, cloth, {box_on(0.85, 4.86, 2.58, 0.14, 0.34, 0.84), box_on(0.95, 4.87, 3.02, 0.12, 0.38, 0.74, 0.1)});
    for (const double y : {3.85, 4.75})
        add(bodies, plaster, {block({4.8, y, 0}, {5, y + 0.18, 2.4})});
    add(bodies, plaster, {block({4.75, 3.82, 2.4}, {5, 4.96, 2.55})});
    turn_on_lathe(bodies, clay, {4.8, 4.4, 0},
                  {{0, 0.004}, {0.10, 0.004}, {0.16, 0.25}, {0.12, 0.45}, {0.07, 0.52}, {0.10, 0.58}});
    add_radiator(bodies, {{4.88, 5.5, 0}, pi / 2}, 12);
    for (const double y : {5.02, 5.08, 6.35})
        add(bodies, white, {rod({4.96, y, 0}, {4.96, y, 5.6}, 0.018)});
    add(bodies, white, {rod({4.96, 5.08, 2.7}, {4.96, 6.35, 2.7}, 0.018)});
    add_pot_plant(bodies, {3.3, 0.5, 0}, 1.1, dice);
    // On the left wall a handrail on brackets; on the far one panels, and a lamp over the well.
    add(bodies, oak, {rod({0.09, start, rise + 0.9}, {0.09, landing_y, landing_z + 0.9}, 0.022)});
    for (int i = 0; i <= 4; ++i) {
        const double s = i / 4.0, y = std::lerp(start, landing_y, s), z = std::lerp(rise, landing_z, s) + 0.88;
        add(bodies, steel, {rod({0, y, z - 0.05}, {0.09, y, z}, 0.008)});
    }
    for (int i = 0; i < 4; ++i) {
        const double x = 0.15 + 0.68 * i;
        add(bodies, oak,
            {block({x, 6.46, landing_z + 0.1}, {x + 0.06, 6.5, 3.1}),
             block({x + 0.56, 6.46, landing_z + 0.1}, {x + 0.62, 6.5, 3.1}),
             block({x, 6.46, landing_z + 0.1}, {x + 0.62, 6.5, landing_z + 0.16}),
             block({x, 6.46, 3.04}, {x + 0.62, 6.5, 3.1})});
    }
    string_up(bodies, steel, {{3.4, 3.6, 5.6}, {3.4, 3.6, 4.3}}, 0.006);
    turn_on_lathe(bodies, yellow, {3.4, 3.6, 4.0}, {{0.28, 0}, {0.22, 0.15}, {0.05, 0.3}});
    for (const double y : {start, 3.2, 4.8})
        add(bodies, oak, {block({0, y, 5.35}, {5, y + 0.14, 5.6})});
    scene.windows = {{4.6, 0.4, 2.4}, {2.5, 6.0, 5.0}};
    scene.walk = {{{{3.70, 1.20, 1.60}, {1.20, 4.20, 1.20}},
                   {{3.90, 2.20, 1.45}, {2.20, 5.20, 0.70}},
                   {{3.75, 3.60, 1.50}, {4.60, 6.40, 0.60}},
                   {{3.60, 4.70, 1.60}, {4.60, 2.60, 0.70}},
                   {{3.50, 3.20, 1.40}, {1.60, 4.40, 0.60}},
                   {{2.60, 0.90, 1.50}, {0.60, 3.40, 1.10}},
                   {{0.80, 0.75, 1.60}, {0.70, 3.80, 1.50}},
                   {{0.68, 2.50, 2.30}, {0.90, 5.80, 2.60}},
                   {{0.68, 4.00, 3.15}, {2.40, 6.10, 2.20}},
                   {{0.90, 5.20, 3.35}, {2.90, 3.00, 2.90}},
                   {{1.10, 5.40, 3.30}, {0.70, 2.20, 0.80}},
                   {{0.72, 4.30, 3.15}, {2.60, 2.20, 2.60}},
                   {{0.68, 2.60, 2.30}, {2.20, 1.00, 0.40}},
                   {{1.00, 0.75, 1.60}, {3.60, 2.60, 0.50}}},
                  52};
    return scene;
}

/// A column of a square plinth and a turned base, with fillets along its shaft and a capital.
void add_column(Bodies& bodies, const Vector3d& foot, double radius, double height) {
    add(bodies, stone, {box_on(foot.z(), foot.x(), foot.y(), 3.0 * radius, 3.0 * radius, 0.14)});
    const Vector3d base = foot + Vector3d(0, 0, 0.14);
    turn_on_lathe(bodies, stone, base,
                  {{1.4 * radius, 0},
                   {1.45 * radius, 0.05},
                   {1.3 * radius, 0.11},
                   {1.1 * radius, 0.13},
                   {1.2 * radius, 0.18},
                   {1.05 * radius, 0.22},
                   {1.0 * radius, 0.24}},
                  24);
    for (int i = 0; i < 16; ++i) { // fillets between flutes stand out of the shaft
        const double turn = 2 * pi * (i + 0.5) / 16;
        const Vector3d out(std::cos(turn), std::sin(turn), 0);
        add(bodies, stone,
            {Box{base + 0.965 * radius * out + Vector3d(0, 0, height / 2),
                 {0.035 * radius, 0.018, height / 2 - 0.25},
                 turned(turn)}});
    }
    add(bodies, stone, {Cylinder{base, 0.95 * radius, height - 0.14}});
    const Vector3d top = foot + Vector3d(0, 0, height - 0.45);
    turn_on_lathe(bodies, stone, top,
                  {{0.95 * radius, 0},
                   {1.05 * radius, 0.03},
                   {0.95 * radius, 0.06},
                   {1.0 * radius, 0.15},
                   {1.45 * radius, 0.29},
                   {1.45 * radius, 0.33}},
                  24);
    add(bodies, stone, {box_on(foot.z() + height - 0.12, foot.x(), foot.y(), 3.2 * radius, 3.2 * radius, 0.12)});
}

/// Half a ring of wedge stones between two columns along y.
void add_arch(Bodies& bodies, double x, double from_y, double to_y, double spring_z, double depth) {
    constexpr int stones = 13;
    const double radius = (to_y - from_y) / 2;
    const Vector3d centre(x, (from_y + to_y) / 2, spring_z);
    for (int i = 0; i < stones; ++i) {
        const double turn = pi * (i + 0.5) / stones, proud = i % 2 ? 0.02 : 0.0;
        const Eigen::Matrix3d axes = Eigen::AngleAxisd(turn, Vector3d::UnitX()).toRotationMatrix();
        add(bodies, stone,
            {Box{centre + (radius + 0.13) * axes.col(1),
                 {depth / 2 + proud, 0.15, radius * pi / stones / 2 + 0.015},
                 axes}});
    }
}

/// A hall of 8 x 13 x 6 m with two arcades, niches, a coffered ceiling and what has fallen off.
Scene columns() {
    Scene scene{.name = "columns",
                .summary = "a hall with two arcades of columns, niches, coffers and fallen stones",
                .far_m = 13};
    Bodies& bodies = scene.bodies;
    Dice dice(23);
    add_shell(bodies, {8, 12.6, 5.8}, tiles, stone, whitewash);
    for (const double x : {2.1, 5.9}) {
        for (const double y : {1.6, 4.0, 6.4, 8.8, 11.2})
            add_column(bodies, {x, y, 0}, 0.2, 3.2);
        for (const double y : {1.6, 4.0, 6.4, 8.8})
            add_arch(bodies, x, y + 0.2, y + 2.2, 3.2, 0.5);
        add(bodies, stone,
            {block({x - 0.25, 0, 4.5}, {x + 0.25, 12.6, 4.8}), block({x - 0.32, 0, 4.8}, {x + 0.32, 12.6, 4.92})});
    }
    for (int i = 0; i <= 8; ++i)
        add(bodies, oak, {block({0, 1.5 * i, 5.5}, {8, 1.5 * i + 0.16, 5.8})});
    for (int i = 0; i <= 5; ++i)
        add(bodies, oak, {block({1.55 * i, 0, 5.5}, {1.55 * i + 0.14, 12.6, 5.8})});
    // Walls: pilasters, a plinth, niches with vases, benches.
    for (const int side : {0, 1}) {
        const auto out = [&](double x) { return side ? 8 - x : x; };
        const auto piece = [&](double x0, double x1, double y0, double y1, double z0, double z1) {
            return block({std::min(out(x0), out(x1)), y0, z0}, {std::max(out(x0), out(x1)), y1, z1});
        };
        add(bodies, stone, {piece(0, 0.08, 0, 12.6, 0, 0.35), piece(0, 0.12, 0, 12.6, 2.9, 3.0)});
        for (int i = 0; i < 6; ++i) {
            const double y = 0.5 + 2.2 * i;
            add(bodies, stone,
                {piece(0, 0.3, y, y + 0.35, 0, 2.9), piece(0, 0.36, y - 0.04, y + 0.39, 0, 0.25),
                 piece(0, 0.36, y - 0.04, y + 0.39, 2.72, 2.9)});
            if (i == 5)
                continue;
            const double middle = y + 1.28;
            if ((i + side) % 2) {
                add(bodies, stone,
                    {piece(0, 0.45, middle - 0.6, middle + 0.6, 0.42, 0.5),
                     piece(0.1, 0.35, middle - 0.5, middle - 0.35, 0, 0.42),
                     piece(0.1, 0.35, middle + 0.35, middle + 0.5, 0, 0.42)});
            } else {
                add(bodies, stone,
                    {piece(0, 0.4, middle - 0.25, middle + 0.25, 0, 0.9),
                     piece(0, 0.44, middle - 0.29, middle + 0.29, 0.9, 0.98)});
                turn_on_lathe(
                    bodies, clay, {out(0.22), middle, 0.98},
                    {{0, 0.01}, {0.08, 0.01}, {0.06, 0.06}, {0.17, 0.3}, {0.14, 0.48}, {0.06, 0.55}, {0.11, 0.62}}, 20);
            }
        }
    }
    // Steps at the far end with a basin on them, a door recess beside.
    for (int i = 0; i < 4; ++i)
        add(bodies, stone, {block({2.6 + 0.1 * i, 10.6 + 0.3 * i, 0.16 * i}, {5.4 - 0.1 * i, 12.6, 0.16 * (i + 1)})});
    turn_on_lathe(bodies, stone, {4, 12.0, 0.64},
                  {{0.3, 0},
                   {0.12, 0.12},
                   {0.12, 0.5},
                   {0.2, 0.6},
                   {0.5, 0.75},
                   {0.55, 0.85},
                   {0.48, 0.85},
                   {0.2, 0.7},
                   {0, 0.68}},
                  28);
    // What has fallen: drums, a shaft, blocks.
    add(bodies, stone,
        {rod({3.1, 5.0, 0.19}, {4.5, 5.6, 0.19}, 0.19), rod({4.62, 5.68, 0.19}, {4.95, 5.78, 0.19}, 0.19),
         Cylinder{{4.6, 8.4, 0}, 0.22, 0.45}, Cylinder{{4.64, 8.38, 0.45}, 0.21, 0.3},
         Box{{3.2, 8.2, 0.2},
             {0.3, 0.2, 0.18},
             turned(0.4) * Eigen::AngleAxisd(0.3, Vector3d::UnitX()).toRotationMatrix()}});
    drop_many(bodies, {2.7, 6.6}, {3.9, 7.9}, 0, 12, 0.1, 0.4, dice);
    drop_many(bodies, {0.5, 3.2}, {1.7, 5.4}, 0, 11, 0.1, 0.45, dice);
    drop_many(bodies, {6.4, 8.6}, {7.5, 10.6}, 0, 10, 0.12, 0.5, dice);
    scene.windows = {{1, 1, 4.5}, {7, 6, 4.5}, {4, 12, 4.8}};
    scene.walk = {{{{4.00, 1.00, 1.60}, {3.60, 5.40, 1.10}},
                   {{4.30, 2.60, 1.50}, {6.80, 6.00, 1.00}},
                   {{4.10, 3.60, 1.40}, {3.60, 7.00, 0.40}},
                   {{5.00, 4.90, 1.60}, {7.60, 7.80, 1.00}},
                   {{5.10, 7.00, 1.50}, {6.90, 9.80, 0.60}},
                   {{4.30, 9.30, 1.60}, {4.00, 12.2, 1.00}},
                   {{3.30, 9.60, 1.50}, {0.50, 7.80, 1.00}},
                   {{2.05, 7.70, 1.50}, {0.80, 4.60, 0.90}},
                   {{1.10, 6.90, 1.45}, {1.00, 3.40, 0.70}},
                   {{2.05, 5.60, 1.50}, {3.60, 2.60, 1.40}},
                   {{3.00, 4.70, 1.60}, {6.40, 3.40, 0.90}},
                   {{3.60, 3.60, 1.70}, {5.60, 7.20, 2.60}},
                   {{3.80, 2.90, 1.70}, {2.00, 6.40, 3.20}},
                   {{3.60, 2.20, 1.60}, {0.80, 4.60, 0.60}}},
                  44};
    return scene;
}

/// A store room of 4.6 x 5.4 x 2.7 m with shelves, a workbench and heaps of several hundred things.
Scene clutter() {
    Scene scene{.name = "clutter", .summary = "a store room full of shelves, boxes, pipes and heaped things"};
    Bodies& bodies = scene.bodies;
    Dice dice(37);
    add_shell(bodies, {4.6, 5.4, 2.7}, boards, plaster, whitewash);
    add_shelf(bodies, {{0.8, 5.22, 0}, 0}, 1.4, 2.2, 6, dice);
    add_shelf(bodies, {{2.3, 5.22, 0}, 0}, 1.4, 2.0, 5, dice);
    add_shelf(bodies, {{0.18, 3.4, 0}, pi / 2}, 1.5, 2.1, 5, dice);
    add_table(bodies, {{3.95, 3.1, 0}, pi / 2}, 2.2, 0.75, 0.86);
    drop_many(bodies, {3.6, 2.1}, {4.3, 4.1}, 0.86, 34, 0.05, 0.3, dice); // on the workbench
    drop_many(bodies, {3.65, 2.2}, {4.4, 4.0}, 0, 20, 0.15, 0.4, dice);   // and below it
    drop_many(bodies, {0.7, 2.4}, {2.9, 4.9}, 0, 70, 0.06, 0.45, dice);   // the heap in the middle
    drop_many(bodies, {3.2, 4.3}, {4.5, 5.3}, 0, 22, 0.1, 0.45, dice);
    drop_many(bodies, {0.1, 1.4}, {0.6, 2.5}, 0, 10, 0.08, 0.35, dice);
    for (int i = 0; i < 9; ++i) { // pipes and laths leaning in a corner
        const double x = 3.1 + 0.12 * i, length = dice.between(1.4, 2.4);
        if (i % 3)
            add(bodies, steel,
                {rod({x, 4.9, 0}, {x + dice.between(-0.1, 0.2), 5.38, length}, dice.between(0.008, 0.03))});
        else
            add(bodies, oak, {bar({x, 4.95, 0}, {x + dice.between(-0.1, 0.2), 5.37, length}, 0.035)});
    }
    // A board of tools over the workbench, a shelf over it, ducts under the ceiling, a ladder on the left wall.
    add(bodies, oak, {block({4.54, 2.1, 1.2}, {4.6, 4.1, 1.9}), block({4.3, 2.1, 2.0}, {4.6, 4.1, 2.03})});
    for (int i = 0; i < 14; ++i) {
        const double y = 2.2 + 0.135 * i, z = dice.between(1.3, 1.5), top = z + dice.between(0.15, 0.35);
        add(bodies, dice.one_of({steel, red, yellow}),
            {rod({4.5, y, z}, {4.52, y, top}, dice.between(0.006, 0.02)),
             Box{{4.5, y, top}, {0.03, dice.between(0.02, 0.06), 0.02}}});
    }
    drop_many(bodies, {4.3, 2.1}, {4.6, 4.1}, 2.03, 14, 0.1, 0.26, dice);
    add(bodies, steel,
        {rod({0.4, 0, 2.45}, {0.4, 5.4, 2.45}, 0.14), rod({0, 4.2, 2.35}, {4.6, 4.2, 2.35}, 0.05),
         rod({0, 4.36, 2.4}, {4.6, 4.36, 2.4}, 0.05), block({1.6, 0, 2.4}, {2.1, 5.4, 2.62})});
    for (const double y : {1.6, 2.0})
        add(bodies, oak, {bar({0.45, y, 0}, {0.04, y, 2.1}, 0.04)});
    for (int i = 1; i < 8; ++i)
        add(bodies, oak, {rod({0.45 - 0.05 * i, 1.6, 0.26 * i}, {0.45 - 0.05 * i, 2.0, 0.26 * i}, 0.014)});
    add_chair(bodies, {{3.2, 2.7, 0}, 1.3});
    add_bicycle(bodies, {{1.4, 0.22, 0}, pi});
    scene.windows = {{4.2, 0.5, 2.2}, {2.0, 5.0, 2.5}};
    scene.walk = {{{{2.30, 0.90, 1.55}, {2.00, 4.20, 0.60}},
                   {{3.10, 1.10, 1.45}, {3.90, 3.60, 0.80}},
                   {{3.05, 1.60, 1.50}, {4.30, 3.20, 1.30}},
                   {{2.90, 1.75, 1.35}, {3.60, 5.00, 0.60}},
                   {{2.40, 1.60, 1.70}, {1.70, 3.80, 0.30}},
                   {{1.70, 1.55, 1.50}, {0.80, 5.20, 1.20}},
                   {{1.30, 1.60, 1.40}, {0.20, 3.60, 1.00}},
                   {{1.35, 1.20, 1.60}, {0.30, 2.00, 0.40}},
                   {{1.60, 0.90, 1.40}, {3.40, 3.20, 0.40}},
                   {{1.80, 1.10, 1.75}, {1.60, 3.60, 0.60}}},
                  26};
    return scene;
}

/// Height of the ground outdoors: a lane along y between gentle slopes.
double ground_at(double x, double y) {
    const double off_lane = std::max(0.0, std::abs(x) - 4);
    const double waves =
        0.35 * std::sin(0.21 * x + 0.6) * std::cos(0.17 * y) + 0.12 * std::sin(0.9 * x) * std::sin(0.7 * y + 0.4);
    return std::min(1.0, off_lane / 6) * (waves + 0.03 * std::max(0.0, off_lane - 8)) + 0.01 * y + 4e-4 * y * y;
}

void add_ground(Bodies& bodies, const Material& material, double low_x, double high_x, double low_y, double high_y,
                double cell) {
    const auto at = [&](double x, double y) { return Vector3d(x, y, ground_at(x, y)); };
    for (double y = low_y; y < high_y - 1e-9; y += cell)
        for (double x = low_x; x < high_x - 1e-9; x += cell)
            add(bodies, material, quad(at(x, y), at(x + cell, y), at(x + cell, y + cell), at(x, y + cell)));
}

/// Walls with recessed windows and a door, a gable roof with eaves, a chimney, steps, a lean-to and gutters.
void add_house(Bodies& bodies, const Vector2d& where, double yaw, double width, double depth, double eaves,
               const Material& wall, Dice& dice) {
    const double ground = ground_at(where.x(), where.y()) - 0.3;
    const Place at{{where.x(), where.y(), ground}, yaw};
    const double w = width / 2, d = depth / 2, ridge = eaves + 0.42 * width, over = 0.55;
    add(bodies, wall, {at.box(0, 0, 0, width, depth, eaves)});
    for (const int end : {-1, 1})
        add(bodies, wall, {Triangle{at(-w, end * d, eaves), at(w, end * d, eaves), at(0, end * d, ridge)}});
    for (const int side : {-1, 1}) {
        const double foot_x = side * (w + over), foot_z = eaves - over * (ridge - eaves) / w;
        for (const double lift : {0.02, 0.20}) // both faces of the roof
            add(bodies, slate,
                quad(at(0, -d - over, ridge + lift), at(foot_x, -d - over, foot_z + lift),
                     at(foot_x, d + over, foot_z + lift), at(0, d + over, ridge + lift)));
        add(bodies, slate,
            quad(at(foot_x, -d - over, foot_z + 0.02), at(foot_x, -d - over, foot_z + 0.20),
                 at(foot_x, d + over, foot_z + 0.20), at(foot_x, d + over, foot_z + 0.02)));
        add(bodies, steel,
            {rod(at(foot_x, -d - over, foot_z), at(foot_x, d + over, foot_z), 0.06),
             rod(at(side * (w + 0.06), d - 0.1, 0), at(side * (w + 0.06), d - 0.1, foot_z), 0.05)});
        for (int floor = 0; floor < static_cast<int>(eaves / 2.8); ++floor)
            for (double y = -d + 1.2; y < d - 0.8; y += 2.4) { // frames and sills proud of the wall
                const double z = 1.2 + 2.8 * floor;
                const auto piece = [&](double dy, double dz, double sy, double sz, double proud) {
                    return at.box(side * w, y + dy, z + dz, 2 * proud, sy, sz);
                };
                add(bodies, white,
                    {piece(-0.55, 0, 0.12, 1.4, 0.18), piece(0.55, 0, 0.12, 1.4, 0.18),
                     piece(0, 1.32, 1.22, 0.12, 0.18), piece(0, -0.08, 1.4, 0.1, 0.3), piece(0, 0, 0.06, 1.35, 0.08)});
            }
    }
    add(bodies, brick,
        {at.box(0.5 * w, 0.4 * d, eaves, 0.7, 0.7, ridge - eaves + 0.8),
         at.box(0.5 * w, 0.4 * d, ridge + 0.8, 0.85, 0.85, 0.12)});
    // The front towards -y: door under a canopy on posts, steps, a window.
    for (int i = 0; i < 3; ++i)
        add(bodies, stone, {at.box(0, -d - 0.9 + 0.3 * i, 0, 1.8, 1.8 - 0.6 * i, 0.3 + 0.17 * (i + 1))});
    add(bodies, oak,
        {at.box(0, -d - 0.8, 3.0, 2.2, 1.6, 0.14), at.box(-0.55, -d, 0.8, 0.14, 0.3, 2.1),
         at.box(0.55, -d, 0.8, 0.14, 0.3, 2.1), at.box(0, -d, 2.8, 1.24, 0.3, 0.14)});
    for (const int side : {-1, 1}) {
        add(bodies, oak, {rod(at(side * 0.95, -d - 1.45, 0.3), at(side * 0.95, -d - 1.45, 3.0), 0.07)});
        add(bodies, white,
            {at.box(side * 0.33 * width, -d, 1.2, 1.5, 0.3, 0.12), at.box(side * 0.33 * width, -d, 2.5, 1.5, 0.3, 0.12),
             at.box(side * 0.33 * width - 0.7, -d, 1.2, 0.1, 0.3, 1.4),
             at.box(side * 0.33 * width + 0.7, -d, 1.2, 0.1, 0.3, 1.4)});
    }
    // A lean-to with barrels and logs at the back of one side.
    const double x = w + 1.1;
    add(bodies, slate, quad(at(w, -1, 2.7), at(w + 2.3, -1, 2.1), at(w + 2.3, 2.5, 2.1), at(w, 2.5, 2.7)));
    for (const double y : {-0.9, 2.4})
        add(bodies, oak, {rod(at(w + 2.1, y, 0), at(w + 2.1, y, 2.15), 0.06)});
    for (int row = 0; row < 5; ++row)
        for (int i = 0; i < 7; ++i)
            add(bodies, bark,
                {rod(at(x - 0.9, 0.1 + 0.27 * i + 0.13 * (row % 2), 0.45 + 0.23 * row),
                     at(x + dice.between(0.0, 0.15), 0.1 + 0.27 * i + 0.13 * (row % 2), 0.45 + 0.23 * row), 0.13)});
}

void add_tree(Bodies& bodies, const Vector2d& where, double size, Dice& dice) {
    const Vector3d foot(where.x(), where.y(), ground_at(where.x(), where.y()) - 0.2);
    const Vector3d fork = foot + Vector3d(dice.between(-0.1, 0.1), dice.between(-0.1, 0.1), 0.4) * size;
    add(bodies, bark, {rod(foot, fork, 0.035 * size)});
    for (int i = 0; i < 9; ++i) {
        const double turn = 2.4 * i + dice.between(0, 0.5), out = dice.between(0.15, 0.34) * size;
        const Vector3d tip =
            fork + Vector3d(out * std::cos(turn), out * std::sin(turn), dice.between(0.12, 0.5) * size);
        add(bodies, bark, {rod(fork, tip, 0.012 * size)});
        for (int twig = 0; twig < 3; ++twig) {
            const Vector3d end =
                tip + size * Vector3d(dice.between(-0.16, 0.16), dice.between(-0.16, 0.16), dice.between(-0.04, 0.14));
            add(bodies, bark, {rod(tip, end, 0.005 * size)});
            add(bodies, leaves, {Sphere{end, dice.between(0.05, 0.1) * size}});
        }
    }
}

void add_bush(Bodies& bodies, const Vector2d& where, double size, Dice& dice) {
    const Vector3d foot(where.x(), where.y(), ground_at(where.x(), where.y()));
    for (int i = 0; i < 12; ++i)
        add(bodies, leaves,
            {Sphere{foot + size * Vector3d(dice.between(-0.5, 0.5), dice.between(-0.4, 0.4), dice.between(0.1, 0.55)),
                    dice.between(0.15, 0.26) * size}});
}

void add_car(Bodies& bodies, const Vector2d& where, double yaw, const Material& paint) {
    const Place at{{where.x(), where.y(), ground_at(where.x(), where.y())}, yaw};
    add(bodies, paint, {at.box(0, 0, 0.28, 1.75, 4.2, 0.55), at.box(0, -1.7, 0.45, 1.7, 0.7, 0.42)});
    const auto roof = [&](double x, double y) { return at(x, y, 1.45); };
    const auto waist = [&](double x, double y) { return at(x, y, 0.83); };
    add(bodies, steel, quad(waist(-0.82, -1.3), waist(0.82, -1.3), roof(0.66, -0.6), roof(-0.66, -0.6)));
    add(bodies, steel, quad(waist(-0.82, 1.7), waist(0.82, 1.7), roof(0.66, 1.2), roof(-0.66, 1.2)));
    for (const int side : {-1, 1})
        add(bodies, steel,
            quad(waist(0.82 * side, -1.3), waist(0.82 * side, 1.7), roof(0.66 * side, 1.2), roof(0.66 * side, -0.6)));
    add(bodies, paint, quad(roof(-0.66, -0.6), roof(0.66, -0.6), roof(0.66, 1.2), roof(-0.66, 1.2)));
    for (const auto& [x, y] : {std::pair{-0.8, -1.3}, {0.8, -1.3}, {-0.8, 1.3}, {0.8, 1.3}})
        add(bodies, slate, {rod(at(x - 0.12, y, 0.32), at(x + 0.12, y, 0.32), 0.32)});
}

void add_fence(Bodies& bodies, const Vector2d& from, const Vector2d& to) {
    const int posts = static_cast<int>((to - from).norm() / 1.8);
    const auto at = [&](double s, double z) {
        const Vector2d p = from + s * (to - from);
        return Vector3d(p.x(), p.y(), ground_at(p.x(), p.y()) + z);
    };
    for (int i = 0; i < posts; ++i) {
        const double s = static_cast<double>(i) / posts, next = static_cast<double>(i + 1) / posts;
        add(bodies, oak,
            {bar(at(s, -0.2), at(s, 1.25), 0.1), bar(at(s, 0.45), at(next, 0.45), 0.06),
             bar(at(s, 1.0), at(next, 1.0), 0.06)});
        for (int pale = 1; pale < 12; ++pale)
            add(bodies, oak,
                {bar(at(std::lerp(s, next, pale / 12.0), 0.15), at(std::lerp(s, next, pale / 12.0), 1.2), 0.05)});
    }
}

/// A lane between houses, to 150 m.
Scene outdoor() {
    Scene scene{.name = "outdoor",
                .summary = "a lane with houses, trees, fences, cars and poles, to 150 m; AO radius 2 m",
                .ao_radius_m = 2,
                .far_m = 150};
    Bodies& bodies = scene.bodies;
    Dice dice(53);
    const Material asphalt{{0.17, 0.17, 0.17}, {0.21, 0.20, 0.20}, Pattern::plaster, 0.3};
    add_ground(bodies, asphalt, -3, 3, -20, 130, 1);
    for (const int side : {-1, 1}) {
        const auto strip = [&](double near, double far, double low_y, double high_y, double cell) {
            side < 0 ? add_ground(bodies, grass, -far, -near, low_y, high_y, cell)
                     : add_ground(bodies, grass, near, far, low_y, high_y, cell);
        };
        strip(3, 21, -20, 70, 1);
        strip(21, 81, -20, 130, 5);
        strip(3, 21, 70, 130, 3);
        for (double y = -20; y < 70; y += 2) { // kerbs, a pavement, verge stones
            const double z = ground_at(0, y);
            add(bodies, stone,
                {bar({3.1 * side, y, z - 0.02}, {3.1 * side, y + 1.97, ground_at(0, y + 2) - 0.02}, 0.28)});
        }
    }
    add(bodies, grass, quad({-90, 130, 4}, {90, 130, 4}, {90, 142, 9}, {-90, 142, 9})); // the hill that ends the view
    struct House {
        double x, y, yaw, width, depth, eaves;
        const Material* wall;
    };
    for (const House& h :
         {House{-11, 10, pi / 2, 8, 9, 5.8, &plaster}, House{10.5, 17, -pi / 2, 7, 8, 3.1, &brick},
          House{-10.5, 29, pi / 2 + 0.15, 7.5, 8, 3.2, &brick}, House{11.5, 36, -pi / 2 - 0.1, 9, 10, 6.0, &plaster},
          House{-12, 50, pi / 2, 8, 9, 5.8, &whitewash}, House{12, 58, -pi / 2, 8, 8, 3.2, &plaster},
          House{-14, 78, 1.2, 9, 11, 6, &brick}, House{14, 84, -1.9, 9, 9, 5.8, &whitewash},
          House{-2, 118, 0, 12, 8, 6, &plaster}})
        add_house(bodies, {h.x, h.y}, h.yaw, h.width, h.depth, h.eaves, *h.wall, dice);
    for (const auto& [x, y, size] : {std::array{-6.0, 19.5, 6.0},
                                     {6.2, 7.0, 5.0},
                                     {6.0, 26.5, 7.0},
                                     {-7.0, 40.0, 8.0},
                                     {7.0, 48.0, 6.0},
                                     {-20.0, 20.0, 9.0},
                                     {21.0, 26.0, 9.0},
                                     {-18.0, 62.0, 9.0},
                                     {8.0, 70.0, 8.0},
                                     {-8.0, 66.0, 7.0},
                                     {24.0, 60.0, 10.0},
                                     {-25.0, 45.0, 10.0},
                                     {9.0, 98.0, 9.0},
                                     {-9.0, 100.0, 9.0}})
        add_tree(bodies, {x, y}, size, dice);
    for (int i = 0; i < 26; ++i) {
        const double side = i % 2 ? 1 : -1;
        add_bush(bodies, {side * dice.between(4.6, 6.5), 2 + 2.4 * i}, dice.between(0.8, 1.8), dice);
    }
    for (const auto& [x, y0, y1] : {std::array{-4.6, 2.0, 7.0},
                                    {-4.6, 13.5, 24.0},
                                    {4.6, 20.5, 31.0},
                                    {4.6, 9.0, 12.8},
                                    {-4.6, 33.0, 46.0},
                                    {4.6, 40.0, 54.0}})
        add_fence(bodies, {x, y0}, {x, y1});
    for (int i = 0; i < 5; ++i) { // poles with cross-arms and wires
        const double y = 4 + 22.0 * i, z = ground_at(3.9, y);
        add(bodies, bark, {rod({3.9, y, z - 0.3}, {3.9, y, z + 7.5}, 0.11)});
        for (const double h : {6.4, 7.1}) {
            add(bodies, oak, {bar({3.0, y, z + h}, {4.8, y, z + h}, 0.1)});
            for (const double x : {3.1, 3.6, 4.2, 4.7}) {
                add(bodies, white, {Cylinder{{x, y, z + h + 0.05}, 0.04, 0.14}});
                if (i < 4)
                    hang_wire(bodies, steel, {x, y, z + h + 0.19}, {x, y + 22, ground_at(3.9, y + 22) + h + 0.19}, 0.5,
                              0.012);
            }
        }
    }
    for (int i = 0; i < 4; ++i) { // lamps
        const double y = 11 + 16.0 * i, z = ground_at(-3.6, y);
        string_up(bodies, steel, {{-3.6, y, z}, {-3.6, y, z + 4.6}, {-2.9, y, z + 5.0}}, 0.05);
        turn_on_lathe(bodies, steel, {-2.7, y, z + 4.85}, {{0.28, 0}, {0.1, 0.2}, {0, 0.22}}, 12);
    }
    add_car(bodies, {-1.9, 15}, 0.02, red);
    add_car(bodies, {1.9, 23}, pi, white);
    add_car(bodies, {2.0, 33.5}, pi + 0.04, yellow);
    add_car(bodies, {-1.9, 41}, 0, cloth);
    for (const double y : {9.5, 21.0, 38.0}) { // benches, bins, heaps of sacks and crates
        const Place at{{-3.9, y, ground_at(-3.9, y)}, pi / 2};
        for (int slat = 0; slat < 4; ++slat)
            add(bodies, oak,
                {at.box(0, 0.13 * slat, 0.44, 1.6, 0.09, 0.04),
                 at.box(0, -0.1 - 0.02 * slat, 0.55 + 0.13 * slat, 1.6, 0.03, 0.09)});
        for (const double x : {-0.65, 0.65})
            add(bodies, steel, {at.box(x, 0.2, 0, 0.06, 0.5, 0.44), at.box(x, -0.15, 0, 0.06, 0.06, 1.0)});
        turn_on_lathe(bodies, green, at(1.3, 0.1, 0), {{0, 0.02}, {0.22, 0.02}, {0.27, 0.8}}, 18);
        const double z = ground_at(4.0, y + 3) - 0.02;
        drop_many(bodies, {3.5, y + 2}, {4.5, y + 5}, z, 9, 0.3, 0.9, dice);
    }
    scene.windows = {{-40, -30, 60}, {60, 40, 90}};
    scene.walk = {{{{-0.50, -6.0, 1.75}, {-2.00, 14.0, 1.80}},
                   {{0.60, -1.0, 1.70}, {5.00, 11.0, 1.20}},
                   {{0.60, 5.0, 1.80}, {-8.00, 12.0, 2.40}},
                   {{0.30, 10.5, 1.75}, {4.40, 24.0, 1.30}},
                   {{0.20, 18.0, 1.80}, {-6.00, 27.0, 1.80}},
                   {{-0.60, 26.0, 1.95}, {1.00, 60.0, 4.00}},
                   {{-0.30, 30.0, 2.00}, {9.00, 36.0, 2.40}},
                   {{-0.40, 33.0, 2.20}, {-6.00, 20.0, 1.20}},
                   {{0.00, 27.0, 2.10}, {2.40, 10.0, 1.00}},
                   {{0.30, 19.0, 2.00}, {-9.00, 9.0, 2.20}},
                   {{0.40, 9.0, 1.90}, {6.00, 22.0, 1.40}},
                   {{0.30, 0.0, 1.80}, {-4.00, 12.0, 0.80}}},
                  80};
    return scene;
}

/// A conservatory of 4.4 x 5 x 2.7 m whose things are 5 to 20 mm thick.
Scene thin() {
    Scene scene{.name = "thin", .summary = "wires, grates, railings, wheels, cages and stems of 5 to 20 mm"};
    Bodies& bodies = scene.bodies;
    Dice dice(71);
    add_shell(bodies, {4.4, 5, 2.7}, tiles, plaster, whitewash);
    // A grate before the far wall, a mesh on a frame in the middle, a trellis on the left wall.
    for (int i = 0; i <= 24; ++i) {
        const double x = 0.3 + 0.075 * i;
        add(bodies, steel, {rod({x, 4.72, 0.25}, {x, 4.72, 1.65}, 0.006)});
    }
    for (const double z : {0.25, 0.72, 1.18, 1.65})
        add(bodies, steel, {bar({0.3, 4.72, z}, {2.1, 4.72, z}, 0.018)});
    for (int i = 0; i <= 18; ++i) {
        add(bodies, steel,
            {rod({2.6 + 0.06 * i, 3.6 + 0.03 * i, 0.1}, {2.6 + 0.06 * i, 3.6 + 0.03 * i, 1.18}, 0.0035),
             rod({2.6, 3.6, 0.1 + 0.06 * i}, {3.68, 4.14, 0.1 + 0.06 * i}, 0.0035)});
    }
    for (const double s : {0.0, 1.0})
        add(bodies, steel, {bar({2.6 + 1.08 * s, 3.6 + 0.54 * s, 0}, {2.6 + 1.08 * s, 3.6 + 0.54 * s, 1.2}, 0.02)});
    for (int i = 0; i < 12; ++i)
        add(bodies, oak,
            {bar({0.05, 1.5 + 0.25 * i, 0.2}, {0.05, 2.4 + 0.25 * i, 2.0}, 0.012),
             bar({0.035, 2.4 + 0.25 * i, 0.2}, {0.035, 1.5 + 0.25 * i, 2.0}, 0.012)});
    // Shelves of wire with jars, on the right wall.
    for (const double z : {0.45, 0.85, 1.25, 1.65}) {
        for (int i = 0; i <= 9; ++i)
            add(bodies, steel, {rod({4.0 + 0.04 * i, 1.9, z}, {4.0 + 0.04 * i, 3.4, z}, 0.003)});
        for (const double y : {1.9, 2.4, 2.9, 3.4})
            add(bodies, steel, {rod({4.0, y, z - 0.005}, {4.38, y, z - 0.005}, 0.005)});
        for (int i = 0; i < 4; ++i)
            if (dice.below(4))
                turn_on_lathe(bodies, dice.one_of({clay, white, green}),
                              {dice.between(4.1, 4.28), 2.05 + 0.34 * i, z + 0.004},
                              {{0, 0.003}, {0.05, 0.003}, {0.07, 0.1}, {0.045, dice.between(0.14, 0.24)}}, 18);
    }
    for (const auto& [x, y] : {std::pair{4.0, 1.9}, {4.0, 3.4}, {4.37, 1.9}, {4.37, 3.4}})
        add(bodies, steel, {rod({x, y, 0}, {x, y, 1.9}, 0.01)});
    // A table of slats with a birdcage and a coil of cable, chairs with spindles, a bicycle, plants.
    for (int i = 0; i < 9; ++i)
        add(bodies, oak, {block({1.35, 2.5 + 0.08 * i, 0.70}, {2.35, 2.55 + 0.08 * i, 0.715})});
    for (const auto& [x, y] : {std::pair{1.4, 2.54}, {2.3, 2.54}, {1.4, 3.14}, {2.3, 3.14}})
        add(bodies, steel, {rod({x, y, 0}, {x, y, 0.70}, 0.01), rod({x, y, 0.2}, {1.85, 2.84, 0.68}, 0.006)});
    for (int i = 0; i < 28; ++i) {
        const double turn = 2 * pi * i / 28;
        const Vector3d out(std::cos(turn), std::sin(turn), 0), foot(1.65, 2.85, 0.72);
        string_up(bodies, yellow,
                  {foot + 0.16 * out, foot + 0.16 * out + Vector3d(0, 0, 0.3), foot + 0.1 * out + Vector3d(0, 0, 0.4),
                   foot + Vector3d(0, 0, 0.44)},
                  0.0025);
    }
    for (const double z : {0.722, 0.87, 1.02})
        add_ring(bodies, yellow, {1.65, 2.85, z}, Vector3d::UnitZ(), 0.16, 0.004);
    for (int i = 0; i < 5; ++i)
        add_ring(bodies, cloth, {2.12 + dice.between(-0.01, 0.01), 2.9 + dice.between(-0.01, 0.01), 0.724 + 0.014 * i},
                 Vector3d::UnitZ(), 0.1 + dice.between(-0.01, 0.01), 0.007);
    add_chair(bodies, {{1.2, 2.0, 0}, 2.6}, 0.007);
    add_chair(bodies, {{2.8, 2.6, 0}, -1.2}, 0.007);
    add_bicycle(bodies, {{3.1, 4.72, 0}, 0});
    add_pot_plant(bodies, {0.5, 3.9, 0}, 1.2, dice);
    add_pot_plant(bodies, {3.9, 4.3, 0}, 1.0, dice);
    add_pot_plant(bodies, {0.75, 2.9, 0}, 0.8, dice);
    // Wires under the ceiling and along the wall, lamps on cords, a washing line, a drain grating, a rack of rods.
    for (int i = 0; i < 6; ++i)
        hang_wire(bodies, cloth, {0.6 + 0.55 * i, 0, 2.45}, {0.4 + 0.6 * i, 5, 2.4}, dice.between(0.05, 0.2), 0.005);
    for (const auto& [x, y] : {std::pair{1.2, 3.6}, {2.0, 3.9}, {3.0, 3.2}}) {
        add(bodies, steel, {rod({x, y, 1.75}, {x, y, 2.7}, 0.004)});
        turn_on_lathe(bodies, steel, {x, y, 1.6}, {{0.15, 0}, {0.1, 0.08}, {0.02, 0.16}}, 20);
    }
    hang_wire(bodies, white, {0, 4.3, 1.9}, {4.4, 4.0, 1.9}, 0.12, 0.0025);
    for (int i = 0; i < 30; ++i)
        add(bodies, steel, {block({2.9 + 0.03 * i, 1.5, 0.0}, {2.908 + 0.03 * i, 2.0, 0.025})});
    for (int i = 0; i < 14; ++i)
        add(bodies, oak,
            {rod({0.25 + 0.06 * i, 4.55 - 0.02 * (i % 3), 0}, {0.15 + 0.07 * i, 4.98, dice.between(1.2, 2.0)},
                 dice.between(0.004, 0.01))});
    for (int i = 0; i < 5; ++i)
        hang_wire(bodies, cloth, {4.39, 3.6 + 0.02 * i, 0.3 + 0.1 * i}, {4.39, 4.9, 0.5 + 0.25 * i}, 0.1, 0.005);
    add(bodies, white, {block({4.37, 3.55, 0.25}, {4.4, 3.75, 0.85})});
    scene.windows = {{0.5, 0.5, 2.3}, {3.8, 4.5, 2.4}};
    scene.walk = {{{{2.20, 0.80, 1.50}, {1.80, 3.60, 0.80}},
                   {{2.90, 0.90, 1.40}, {3.30, 4.20, 0.60}},
                   {{3.30, 1.00, 1.50}, {1.60, 3.20, 0.70}},
                   {{3.20, 1.05, 1.35}, {4.30, 3.00, 0.90}},
                   {{2.60, 1.20, 1.60}, {3.20, 2.60, 0.20}},
                   {{1.90, 0.90, 1.30}, {2.20, 4.60, 0.80}},
                   {{1.20, 0.80, 1.45}, {0.60, 4.20, 0.70}},
                   {{0.90, 0.90, 1.55}, {2.40, 3.20, 0.60}},
                   {{1.50, 1.00, 1.25}, {3.40, 4.60, 0.90}}},
                  20};
    return scene;
}

} // namespace

const std::vector<Scene>& scenes() {
    static const std::vector<Scene> table{office(), staircase(), columns(), clutter(), outdoor(), thin()};
    return table;
}

} // namespace scanshade::scene
