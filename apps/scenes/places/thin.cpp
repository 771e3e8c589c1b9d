// The scene thin: indoor objects that are a pixel or two wide in a picture.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"
#include "apps/scenes/places/things.h"

#include <cmath>
#include <utility>

namespace scanshade::scene {

Scene thin() { // NOLINT(readability-function-size): a table
    Scene scene{.name = "thin", .summary = "wires, grates, railings, wheels, cages and stems of 5 to 20 mm"};
    Bodies& bodies = scene.bodies;
    Random random(71);
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
            if (random.below(4))
                add_vessel(bodies, random.one_of({clay, white, green}),
                           {random.between(4.1, 4.28), 2.05 + 0.34 * i, z + 0.004},
                           {{0, 0.003}, {0.05, 0.003}, {0.07, 0.1}, {0.045, random.between(0.14, 0.24)}}, 18);
    }
    for (const auto& [x, y] : {std::pair{4.0, 1.9}, {4.0, 3.4}, {4.37, 1.9}, {4.37, 3.4}})
        add(bodies, steel, {rod({x, y, 0}, {x, y, 1.9}, 0.01)});
    // A table of slats with a birdcage and a coil of cable, chairs with spindles, a bicycle, plants.
    for (int i = 0; i < 9; ++i)
        add(bodies, oak, {block({1.35, 2.5 + 0.08 * i, 0.70}, {2.35, 2.55 + 0.08 * i, 0.715})});
    for (const auto& [x, y] : {std::pair{1.4, 2.54}, {2.3, 2.54}, {1.4, 3.14}, {2.3, 3.14}})
        add(bodies, steel, {rod({x, y, 0}, {x, y, 0.70}, 0.01), rod({x, y, 0.2}, {1.85, 2.84, 0.68}, 0.006)});
    for (int i = 0; i < 28; ++i) {
        const double angle = 2 * pi * i / 28;
        const Vector3d out(std::cos(angle), std::sin(angle), 0), foot(1.65, 2.85, 0.72);
        add_rod_chain(bodies, yellow,
                      {foot + 0.16 * out, foot + 0.16 * out + Vector3d(0, 0, 0.3),
                       foot + 0.1 * out + Vector3d(0, 0, 0.4), foot + Vector3d(0, 0, 0.44)},
                      0.0025);
    }
    for (const double z : {0.722, 0.87, 1.02})
        add_ring(bodies, yellow, {1.65, 2.85, z}, Vector3d::UnitZ(), 0.16, 0.004);
    for (int i = 0; i < 5; ++i)
        add_ring(bodies, cloth,
                 {2.12 + random.between(-0.01, 0.01), 2.9 + random.between(-0.01, 0.01), 0.724 + 0.014 * i},
                 Vector3d::UnitZ(), 0.1 + random.between(-0.01, 0.01), 0.007);
    add_chair(bodies, {{1.2, 2.0, 0}, 2.6}, 0.007);
    add_chair(bodies, {{2.8, 2.6, 0}, -1.2}, 0.007);
    add_bicycle(bodies, {{3.1, 4.72, 0}, 0});
    add_pot_plant(bodies, {0.5, 3.9, 0}, 1.2, random);
    add_pot_plant(bodies, {3.9, 4.3, 0}, 1.0, random);
    add_pot_plant(bodies, {0.75, 2.9, 0}, 0.8, random);
    // Wires under the ceiling and along the wall, lamps on cords, a washing line, a drain grating, a rack of rods.
    for (int i = 0; i < 6; ++i)
        hang_wire(bodies, cloth, {0.6 + 0.55 * i, 0, 2.45}, {0.4 + 0.6 * i, 5, 2.4}, random.between(0.05, 0.2), 0.005);
    for (const auto& [x, y] : {std::pair{1.2, 3.6}, {2.0, 3.9}, {3.0, 3.2}}) {
        add(bodies, steel, {rod({x, y, 1.75}, {x, y, 2.7}, 0.004)});
        add_vessel(bodies, steel, {x, y, 1.6}, {{0.15, 0}, {0.1, 0.08}, {0.02, 0.16}}, 20);
    }
    hang_wire(bodies, white, {0, 4.3, 1.9}, {4.4, 4.0, 1.9}, 0.12, 0.0025);
    for (int i = 0; i < 30; ++i)
        add(bodies, steel, {block({2.9 + 0.03 * i, 1.5, 0.0}, {2.908 + 0.03 * i, 2.0, 0.025})});
    for (int i = 0; i < 14; ++i)
        add(bodies, oak,
            {rod({0.25 + 0.06 * i, 4.55 - 0.02 * (i % 3), 0}, {0.15 + 0.07 * i, 4.98, random.between(1.2, 2.0)},
                 random.between(0.004, 0.01))});
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

} // namespace scanshade::scene
