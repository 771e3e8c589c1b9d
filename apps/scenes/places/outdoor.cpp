// The scene outdoor: uneven ground, houses, trees and fences from 5 to 150 m.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/heap.h"
#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace scanshade::scene {
namespace {

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
               const Material& wall, Random& random) {
    const double ground = ground_at(where.x(), where.y()) - 0.3;
    const LocalFrame at{{where.x(), where.y(), ground}, yaw};
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
                     at(x + random.between(0.0, 0.15), 0.1 + 0.27 * i + 0.13 * (row % 2), 0.45 + 0.23 * row), 0.13)});
}

void add_tree(Bodies& bodies, const Vector2d& where, double size, Random& random) {
    const Vector3d foot(where.x(), where.y(), ground_at(where.x(), where.y()) - 0.2);
    const Vector3d fork = foot + Vector3d(random.between(-0.1, 0.1), random.between(-0.1, 0.1), 0.4) * size;
    add(bodies, bark, {rod(foot, fork, 0.035 * size)});
    for (int i = 0; i < 9; ++i) {
        const double angle = 2.4 * i + random.between(0, 0.5), out = random.between(0.15, 0.34) * size;
        const Vector3d tip =
            fork + Vector3d(out * std::cos(angle), out * std::sin(angle), random.between(0.12, 0.5) * size);
        add(bodies, bark, {rod(fork, tip, 0.012 * size)});
        for (int twig = 0; twig < 3; ++twig) {
            const Vector3d end = tip + size * Vector3d(random.between(-0.16, 0.16), random.between(-0.16, 0.16),
                                                       random.between(-0.04, 0.14));
            add(bodies, bark, {rod(tip, end, 0.005 * size)});
            add(bodies, leaves, {Sphere{end, random.between(0.05, 0.1) * size}});
        }
    }
}

void add_bush(Bodies& bodies, const Vector2d& where, double size, Random& random) {
    const Vector3d foot(where.x(), where.y(), ground_at(where.x(), where.y()));
    for (int i = 0; i < 12; ++i)
        add(bodies, leaves,
            {Sphere{
                foot + size * Vector3d(random.between(-0.5, 0.5), random.between(-0.4, 0.4), random.between(0.1, 0.55)),
                random.between(0.15, 0.26) * size}});
}

void add_car(Bodies& bodies, const Vector2d& where, double yaw, const Material& paint) {
    const LocalFrame at{{where.x(), where.y(), ground_at(where.x(), where.y())}, yaw};
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

} // namespace

Scene outdoor() { // NOLINT(readability-function-size): a table
    Scene scene{.name = "outdoor",
                .summary = "a lane with houses, trees, fences, cars and poles, to 150 m; AO radius 2 m",
                .ao_radius_m = 2,
                .far_m = 150};
    Bodies& bodies = scene.bodies;
    Random random(53);
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
        add_house(bodies, {h.x, h.y}, h.yaw, h.width, h.depth, h.eaves, *h.wall, random);
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
        add_tree(bodies, {x, y}, size, random);
    for (int i = 0; i < 26; ++i) {
        const double side = i % 2 ? 1 : -1;
        add_bush(bodies, {side * random.between(4.6, 6.5), 2 + 2.4 * i}, random.between(0.8, 1.8), random);
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
        add_rod_chain(bodies, steel, {{-3.6, y, z}, {-3.6, y, z + 4.6}, {-2.9, y, z + 5.0}}, 0.05);
        add_vessel(bodies, steel, {-2.7, y, z + 4.85}, {{0.28, 0}, {0.1, 0.2}, {0, 0.22}}, 12);
    }
    add_car(bodies, {-1.9, 15}, 0.02, red);
    add_car(bodies, {1.9, 23}, pi, white);
    add_car(bodies, {2.0, 33.5}, pi + 0.04, yellow);
    add_car(bodies, {-1.9, 41}, 0, cloth);
    for (const double y : {9.5, 21.0, 38.0}) { // benches, bins, heaps of sacks and crates
        const LocalFrame at{{-3.9, y, ground_at(-3.9, y)}, pi / 2};
        for (int slat = 0; slat < 4; ++slat)
            add(bodies, oak,
                {at.box(0, 0.13 * slat, 0.44, 1.6, 0.09, 0.04),
                 at.box(0, -0.1 - 0.02 * slat, 0.55 + 0.13 * slat, 1.6, 0.03, 0.09)});
        for (const double x : {-0.65, 0.65})
            add(bodies, steel, {at.box(x, 0.2, 0, 0.06, 0.5, 0.44), at.box(x, -0.15, 0, 0.06, 0.06, 1.0)});
        add_vessel(bodies, green, at(1.3, 0.1, 0), {{0, 0.02}, {0.22, 0.02}, {0.27, 0.8}}, 18);
        const double z = ground_at(4.0, y + 3) - 0.02;
        drop_many(bodies, {3.5, y + 2}, {4.5, y + 5}, z, 9, 0.3, 0.9, random);
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

} // namespace scanshade::scene
