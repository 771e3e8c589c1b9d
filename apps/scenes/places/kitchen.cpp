// The scene kitchen: cupboards with open doors and deep niches, things that stand close to each other on worktops.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"
#include "apps/scenes/places/things.h"

#include <cmath>

namespace scanshade::scene {
namespace {

/// A cupboard with its back towards +y: open boxes side by side, some with doors that stand ajar.
void add_cupboard(Bodies& bodies, const LocalFrame& at, double low, double depth, double height, int doors,
                  Random& random) {
    constexpr double width = 0.5, board = 0.018;
    const double whole = width * doors;
    add(bodies, white,
        {at.box(0, 0, low, whole, depth, board), at.box(0, 0, low + height, whole, depth, board),
         at.box(0, depth / 2, low, whole, board, height), at.box(0, 0, low + height / 2, whole, depth - 0.05, board)});
    for (int i = 0; i <= doors; ++i)
        add(bodies, white, {at.box(-whole / 2 + i * width, 0, low, board, depth, height)});
    for (int i = 0; i < doors; ++i) {
        const double open = random.below(3) == 0 ? random.between(0.3, 1.7) : random.below(4) == 0 ? 9 : 0;
        if (open > 5) // no door: what stands inside shows
            continue;
        const Vector3d hinge = at(-whole / 2 + i * width, -depth / 2, 0);
        const LocalFrame door{hinge, at.yaw - open};
        add(bodies, i % 2 == 0 ? oak : white,
            {door.box(width / 2, -0.01, low + 0.01, width - 0.012, board, height - 0.02)});
    }
    for (int i = 0; i < doors; ++i)
        for (int k = 0; k < 3; ++k)
            add_vessel(bodies, random.one_of({clay, white, green, red}),
                       at(-whole / 2 + (i + 0.25 + 0.25 * k) * width, random.between(-0.05, 0.1),
                          low + board + random.below(2) * height / 2),
                       {{0, 0.003}, {random.between(0.03, 0.06), 0.003}, {0.05, random.between(0.06, 0.2)}}, 16);
}

} // namespace

Scene kitchen() {
    Scene scene{.name = "kitchen", .summary = "cupboards with open doors, niches, crowded worktops, a laid table"};
    Bodies& bodies = scene.bodies;
    Random random(29);
    add_shell(bodies, {3.6, 4.4, 2.5}, tiles, plaster, whitewash);
    const LocalFrame far{{1.8, 4.1, 0}, 0}, left{{0.3, 2.2, 0}, pi / 2};
    add_cupboard(bodies, far, 0.1, 0.56, 0.76, 6, random);
    add_cupboard(bodies, {{1.8, 4.22, 0}, 0}, 1.45, 0.34, 0.7, 6, random);
    add_cupboard(bodies, left, 0.1, 0.56, 0.76, 4, random);
    add(bodies, slate, {far.box(0, 0, 0.88, 3.1, 0.62, 0.04), left.box(0, 0, 0.88, 2.1, 0.62, 0.04)});
    // A sink as a hole between boards, a stove with pots, crowded worktops.
    add(bodies, steel,
        {block({0.05, 1.3, 0.92}, {0.55, 1.32, 1.02}), block({0.05, 1.68, 0.92}, {0.55, 1.7, 1.02}),
         block({0.53, 1.3, 0.92}, {0.55, 1.7, 1.02})});
    for (int i = 0; i < 4; ++i)
        add_vessel(bodies, steel, {1.2 + 0.26 * (i % 2), 3.98 + 0.22 * (i / 2), 0.92},
                   {{0, 0.004}, {0.09, 0.004}, {0.1, 0.05 + 0.04 * i}}, 24);
    for (int i = 0; i < 26; ++i) {
        const double x = random.between(1.9, 3.2), y = random.between(3.9, 4.35), high = random.between(0.05, 0.3);
        if (random.below(2) == 0)
            add(bodies, random.one_of({card, red, yellow}),
                {box_on(0.92, x, y, random.between(0.05, 0.12), random.between(0.04, 0.1), high,
                        random.between(0, pi))});
        else
            add_vessel(bodies, random.one_of({white, green, clay}), {x, y, 0.92},
                       {{0, 0.003}, {0.04, 0.003}, {0.045, high / 2}, {0.02, high}}, 16);
    }
    // A table with chairs pushed under it, bowls and a basket; a bin, a step stool, lamps.
    const LocalFrame table{{2.2, 2.1, 0}, 0.2};
    add_table(bodies, table, 1.2, 0.8, 0.74);
    for (const auto& [x, y, turn] : {std::tuple{-0.3, -0.45, 0.0}, {0.35, -0.5, 0.3}, {0.0, 0.5, 3.2}})
        add_chair(bodies, {table(x, y, 0), 0.2 + turn});
    for (int i = 0; i < 6; ++i)
        add_vessel(bodies, random.one_of({white, clay}),
                   table(random.between(-0.5, 0.5), random.between(-0.3, 0.3), 0.74),
                   {{0.02, 0}, {0.06, 0.015}, {0.09, random.between(0.03, 0.08)}}, 20);
    for (int i = 0; i < 9; ++i)
        add(bodies, random.one_of({red, green, yellow}),
            {Sphere{table(0.3 + random.between(-0.1, 0.1), random.between(-0.1, 0.1), 0.78 + 0.02 * (i / 3)), 0.04}});
    add_vessel(bodies, steel, {3.3, 3.3, 0}, {{0, 0.01}, {0.13, 0.01}, {0.16, 0.55}}, 28);
    add(bodies, oak,
        {box_on(0, 0.75, 3.3, 0.4, 0.3, 0.02), box_on(0.2, 0.75, 3.35, 0.4, 0.2, 0.02),
         box_on(0, 0.55, 3.35, 0.02, 0.3, 0.42), box_on(0, 0.95, 3.35, 0.02, 0.3, 0.42)});
    add_radiator(bodies, {{3.5, 1.2, 0}, -pi / 2}, 9);
    add(bodies, steel, {rod({2.2, 2.1, 1.7}, {2.2, 2.1, 2.5}, 0.006)});
    add_vessel(bodies, red, {2.2, 2.1, 1.55}, {{0.2, 0}, {0.12, 0.1}, {0.02, 0.16}}, 24);
    scene.windows = {{3.3, 0.6, 2.1}, {0.6, 0.6, 2.1}};
    scene.walk = {{{{1.80, 0.50, 1.55}, {1.90, 3.80, 0.90}},
                   {{2.90, 0.60, 1.45}, {1.20, 3.90, 1.00}},
                   {{3.20, 1.60, 1.60}, {0.40, 2.60, 0.80}},
                   {{2.90, 3.20, 1.50}, {0.80, 3.90, 1.10}},
                   {{1.30, 3.20, 1.45}, {3.00, 4.20, 1.10}},
                   {{1.00, 1.90, 1.60}, {2.30, 2.10, 0.60}},
                   {{1.10, 0.70, 1.35}, {0.20, 2.60, 0.60}}},
                  18};
    return scene;
}

} // namespace scanshade::scene
