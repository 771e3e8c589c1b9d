// The scene columns: round and carved stone in a hall of 13 m.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/heap.h"
#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"

#include <algorithm>
#include <cmath>

namespace scanshade::scene {
namespace {

/// A column with a square plinth, a round base, fillets along its shaft and a capital.
void add_column(Bodies& bodies, const Vector3d& foot, double radius, double height) {
    add(bodies, stone, {box_on(foot.z(), foot.x(), foot.y(), 3.0 * radius, 3.0 * radius, 0.14)});
    const Vector3d base = foot + Vector3d(0, 0, 0.14);
    add_vessel(bodies, stone, base,
               {{1.4 * radius, 0},
                {1.45 * radius, 0.05},
                {1.3 * radius, 0.11},
                {1.1 * radius, 0.13},
                {1.2 * radius, 0.18},
                {1.05 * radius, 0.22},
                {1.0 * radius, 0.24}},
               24);
    for (int i = 0; i < 16; ++i) { // the fillets between flutes
        const double angle = 2 * pi * (i + 0.5) / 16;
        const Vector3d out(std::cos(angle), std::sin(angle), 0);
        add(bodies, stone,
            {Box{base + 0.965 * radius * out + Vector3d(0, 0, height / 2),
                 {0.035 * radius, 0.018, height / 2 - 0.25},
                 rotation_about_z(angle)}});
    }
    add(bodies, stone, {Cylinder{base, 0.95 * radius, height - 0.14}});
    const Vector3d top = foot + Vector3d(0, 0, height - 0.45);
    add_vessel(bodies, stone, top,
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
        const double angle = pi * (i + 0.5) / stones, proud = i % 2 ? 0.02 : 0.0;
        const Eigen::Matrix3d axes = Eigen::AngleAxisd(angle, Vector3d::UnitX()).toRotationMatrix();
        add(bodies, stone,
            {Box{centre + (radius + 0.13) * axes.col(1),
                 {depth / 2 + proud, 0.15, radius * pi / stones / 2 + 0.015},
                 axes}});
    }
}

} // namespace

Scene columns() { // NOLINT(readability-function-size): a table
    Scene scene{.name = "columns",
                .summary = "a hall with two arcades of columns, niches, coffers and fallen stones",
                .far_m = 13};
    Bodies& bodies = scene.bodies;
    Random random(23);
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
                add_vessel(
                    bodies, clay, {out(0.22), middle, 0.98},
                    {{0, 0.01}, {0.08, 0.01}, {0.06, 0.06}, {0.17, 0.3}, {0.14, 0.48}, {0.06, 0.55}, {0.11, 0.62}}, 20);
            }
        }
    }
    // Steps at the far end with a basin on them, a door recess to one side.
    for (int i = 0; i < 4; ++i)
        add(bodies, stone, {block({2.6 + 0.1 * i, 10.6 + 0.3 * i, 0.16 * i}, {5.4 - 0.1 * i, 12.6, 0.16 * (i + 1)})});
    add_vessel(bodies, stone, {4, 12.0, 0.64},
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
    // Fallen stones: drums, a shaft, blocks.
    add(bodies, stone,
        {rod({3.1, 5.0, 0.19}, {4.5, 5.6, 0.19}, 0.19), rod({4.62, 5.68, 0.19}, {4.95, 5.78, 0.19}, 0.19),
         Cylinder{{4.6, 8.4, 0}, 0.22, 0.45}, Cylinder{{4.64, 8.38, 0.45}, 0.21, 0.3},
         Box{{3.2, 8.2, 0.2},
             {0.3, 0.2, 0.18},
             rotation_about_z(0.4) * Eigen::AngleAxisd(0.3, Vector3d::UnitX()).toRotationMatrix()}});
    drop_many(bodies, {2.7, 6.6}, {3.9, 7.9}, 0, 12, 0.1, 0.4, random);
    drop_many(bodies, {0.5, 3.2}, {1.7, 5.4}, 0, 11, 0.1, 0.45, random);
    drop_many(bodies, {6.4, 8.6}, {7.5, 10.6}, 0, 10, 0.12, 0.5, random);
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

} // namespace scanshade::scene
