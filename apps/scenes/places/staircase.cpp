// The scene staircase: two flights above each other, with railings and narrow gaps.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/heap.h"
#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"
#include "apps/scenes/places/things.h"

namespace scanshade::scene {

Scene staircase() { // NOLINT(readability-function-size): a table
    Scene scene{.name = "staircase", .summary = "a stairwell with two flights, railings, niches and things kept below"};
    Bodies& bodies = scene.bodies;
    Random random(11);
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
    drop_many(bodies, {1.6, 4.7}, {2.5, 6.4}, 0, 14, 0.12, 0.42, random);
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
        add(bodies, books,
            {box_on(0, 4.74 + random.between(-0.05, 0.05), y, 0.26, 0.09, 0.09, random.between(-0.3, 0.3))});
        add(bodies, steel, {rod({4.93, y, 1.66}, {4.82, y, 1.70}, 0.008)});
    }
    add(bodies, cloth, {box_on(0.85, 4.86, 2.58, 0.14, 0.34, 0.84), box_on(0.95, 4.87, 3.02, 0.12, 0.38, 0.74, 0.1)});
    for (const double y : {3.85, 4.75})
        add(bodies, plaster, {block({4.8, y, 0}, {5, y + 0.18, 2.4})});
    add(bodies, plaster, {block({4.75, 3.82, 2.4}, {5, 4.96, 2.55})});
    add_vessel(bodies, clay, {4.8, 4.4, 0},
               {{0, 0.004}, {0.10, 0.004}, {0.16, 0.25}, {0.12, 0.45}, {0.07, 0.52}, {0.10, 0.58}});
    add_radiator(bodies, {{4.88, 5.5, 0}, pi / 2}, 12);
    for (const double y : {5.02, 5.08, 6.35})
        add(bodies, white, {rod({4.96, y, 0}, {4.96, y, 5.6}, 0.018)});
    add(bodies, white, {rod({4.96, 5.08, 2.7}, {4.96, 6.35, 2.7}, 0.018)});
    add_pot_plant(bodies, {3.3, 0.5, 0}, 1.1, random);
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
    add_rod_chain(bodies, steel, {{3.4, 3.6, 5.6}, {3.4, 3.6, 4.3}}, 0.006);
    add_vessel(bodies, yellow, {3.4, 3.6, 4.0}, {{0.28, 0}, {0.22, 0.15}, {0.05, 0.3}});
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

} // namespace scanshade::scene
