// Furniture, built of parts.
#include "apps/scenes/places/things.h"

#include "apps/scenes/places/materials.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace scanshade::scene {

void add_table(Bodies& bodies, const LocalFrame& at, double width, double depth, double height) {
    const double x = width / 2 - 0.06, y = depth / 2 - 0.06;
    add(bodies, oak,
        {at.box(0, 0, height - 0.035, width, depth, 0.035), at.box(0, y, height - 0.12, 2 * x, 0.02, 0.085),
         at.box(0, -y, height - 0.12, 2 * x, 0.02, 0.085)});
    for (const auto& [sx, sy] : {std::pair{-1, -1}, {1, -1}, {-1, 1}, {1, 1}})
        add(bodies, oak, {at.box(sx * x, sy * y, 0, 0.05, 0.05, height - 0.035)});
}

void add_chair(Bodies& bodies, const LocalFrame& at, double spindle_radius) {
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

void add_shelf(Bodies& bodies, const LocalFrame& at, double width, double height, int levels, Random& random) {
    const double depth = 0.32, pitch = height / levels;
    add(bodies, white, {at.box(-width / 2, 0, 0, 0.025, depth, height), at.box(width / 2, 0, 0, 0.025, depth, height)});
    for (int level = 0; level <= levels; ++level)
        add(bodies, white, {at.box(0, 0, std::max(level * pitch - 0.025, 0.04), width, depth, 0.025)});
    for (int level = 0; level < levels; ++level) {
        const double z = level == 0 ? 0.065 : level * pitch;
        for (double x = -width / 2 + 0.05; x < width / 2 - 0.2;) {
            const double wide = random.between(0.08, 0.3), high = random.between(0.3, 0.8) * (pitch - 0.05);
            const double back = random.between(-0.03, 0.06);
            switch (random.below(5)) {
            case 0:
            case 1:
                add(bodies, books, {at.box(x + wide / 2, back, z, wide, 0.2, high)});
                break;
            case 2:
                add(bodies, card, {at.box(x + wide / 2, back, z, wide, 0.24, high)});
                break;
            case 3:
                add_vessel(bodies, clay, at(x + wide / 2, 0, z),
                           {{0, 0.004}, {0.3 * wide, 0.004}, {0.45 * wide, 0.5 * high}, {0.32 * wide, high}}, 16);
                break;
            default:
                break; // a gap
            }
            x += wide + random.between(0.01, 0.06);
        }
    }
}

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

void add_radiator(Bodies& bodies, const LocalFrame& at, int columns) {
    for (int i = 0; i < columns; ++i)
        add(bodies, white, {at.box(0.06 * (i - (columns - 1) / 2.0), 0, 0.12, 0.035, 0.14, 0.55)});
    for (const double z : {0.17, 0.62})
        add(bodies, white, {rod(at(-0.03 * columns, 0, z), at(0.03 * columns, 0, z), 0.02)});
}

void add_pot_plant(Bodies& bodies, const Vector3d& foot, double size, Random& random) {
    add_vessel(bodies, clay, foot,
               {{0, 0.002}, {0.11 * size, 0.002}, {0.15 * size, 0.25 * size}, {0.17 * size, 0.25 * size}});
    add(bodies, bark, {Cylinder{foot + Vector3d(0, 0, 0.15 * size), 0.13 * size, 0.02}});
    for (int i = 0; i < 14; ++i) {
        const double angle = 2.4 * i, lean = random.between(0.1, 0.45) * size;
        const Vector3d root = foot + Vector3d(0.04 * std::cos(angle), 0.04 * std::sin(angle), 0.16 * size);
        const Vector3d tip =
            root + Vector3d(lean * std::cos(angle), lean * std::sin(angle), random.between(0.4, 0.9) * size);
        const Vector3d middle = (root + tip) / 2 + Vector3d(0, 0, 0.12 * size);
        add_rod_chain(bodies, leaves, {root, middle, tip}, 0.005);
        const Vector3d across = (tip - middle).cross(Vector3d::UnitZ()).normalized() * 0.05 * size;
        const Vector3d end = tip + (tip - middle) * 0.5 - Vector3d(0, 0, 0.06 * size);
        add(bodies, leaves, {Triangle{middle, tip + across, tip - across}, Triangle{tip + across, end, tip - across}});
    }
}

void add_bicycle(Bodies& bodies, const LocalFrame& at) {
    const auto lean = [&](double x, double z) { return at(x, 0.12 * z, z); };
    const Vector3d across =
        (lean(0, 1) - lean(0, 0)).normalized().cross(rotation_about_z(at.yaw) * Vector3d::UnitX()).normalized();
    for (const double x : {-0.5, 0.52}) {
        add_ring(bodies, steel, lean(x, 0.34), across, 0.33, 0.017, 32);
        for (int i = 0; i < 18; ++i) {
            const double angle = 2 * pi * i / 18;
            add(bodies, steel,
                {rod(lean(x, 0.34), lean(x + 0.33 * std::cos(angle), 0.34 + 0.33 * std::sin(angle)), 0.0025)});
        }
        add(bodies, steel, {rod(lean(x, 0.34) - 0.05 * across, lean(x, 0.34) + 0.05 * across, 0.02)});
    }
    const Vector3d rear = lean(-0.5, 0.34), pedal = lean(-0.06, 0.29), seat = lean(-0.2, 0.86), head = lean(0.36, 0.84);
    const Vector3d fork = lean(0.52, 0.34), bars = lean(0.32, 1.02);
    add_rod_chain(bodies, red, {rear, pedal, head, seat, pedal}, 0.016);
    add_rod_chain(bodies, red, {seat, rear}, 0.009);
    add_rod_chain(bodies, red, {bars, fork}, 0.014);
    add(bodies, steel,
        {rod(bars - 0.26 * across, bars + 0.26 * across, 0.012),
         rod(pedal - 0.09 * across, pedal + 0.09 * across, 0.09)});
    add(bodies, cloth, {Box{seat + Vector3d(0, 0, 0.06), {0.13, 0.07, 0.03}, rotation_about_z(at.yaw)}});
}

} // namespace scanshade::scene
