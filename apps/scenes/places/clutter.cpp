// The scene clutter: heaps of several hundred objects, and hardly a plane.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/heap.h"
#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"
#include "apps/scenes/places/things.h"

namespace scanshade::scene {

Scene clutter() {
    Scene scene{.name = "clutter", .summary = "a store room full of shelves, boxes, pipes and heaped things"};
    Bodies& bodies = scene.bodies;
    Random random(37);
    add_shell(bodies, {4.6, 5.4, 2.7}, boards, plaster, whitewash);
    add_shelf(bodies, {{0.8, 5.22, 0}, 0}, 1.4, 2.2, 6, random);
    add_shelf(bodies, {{2.3, 5.22, 0}, 0}, 1.4, 2.0, 5, random);
    add_shelf(bodies, {{0.18, 3.4, 0}, pi / 2}, 1.5, 2.1, 5, random);
    add_table(bodies, {{3.95, 3.1, 0}, pi / 2}, 2.2, 0.75, 0.86);
    drop_many(bodies, {3.6, 2.1}, {4.3, 4.1}, 0.86, 34, 0.05, 0.3, random); // on the workbench
    drop_many(bodies, {3.65, 2.2}, {4.4, 4.0}, 0, 20, 0.15, 0.4, random);   // and below it
    drop_many(bodies, {0.7, 2.4}, {2.9, 4.9}, 0, 70, 0.06, 0.45, random);   // the heap in the middle
    drop_many(bodies, {3.2, 4.3}, {4.5, 5.3}, 0, 22, 0.1, 0.45, random);
    drop_many(bodies, {0.1, 1.4}, {0.6, 2.5}, 0, 10, 0.08, 0.35, random);
    for (int i = 0; i < 9; ++i) { // pipes and laths leaning in a corner
        const double x = 3.1 + 0.12 * i, length = random.between(1.4, 2.4);
        if (i % 3)
            add(bodies, steel,
                {rod({x, 4.9, 0}, {x + random.between(-0.1, 0.2), 5.38, length}, random.between(0.008, 0.03))});
        else
            add(bodies, oak, {bar({x, 4.95, 0}, {x + random.between(-0.1, 0.2), 5.37, length}, 0.035)});
    }
    // A board of tools over the workbench, a shelf over it, ducts under the ceiling, a ladder on the left wall.
    add(bodies, oak, {block({4.54, 2.1, 1.2}, {4.6, 4.1, 1.9}), block({4.3, 2.1, 2.0}, {4.6, 4.1, 2.03})});
    for (int i = 0; i < 14; ++i) {
        const double y = 2.2 + 0.135 * i, z = random.between(1.3, 1.5), top = z + random.between(0.15, 0.35);
        add(bodies, random.one_of({steel, red, yellow}),
            {rod({4.5, y, z}, {4.52, y, top}, random.between(0.006, 0.02)),
             Box{{4.5, y, top}, {0.03, random.between(0.02, 0.06), 0.02}}});
    }
    drop_many(bodies, {4.3, 2.1}, {4.6, 4.1}, 2.03, 14, 0.1, 0.26, random);
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

} // namespace scanshade::scene
