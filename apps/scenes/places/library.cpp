// The scene library: relief as fine as what plane fits smooth. Books side by side, joints of masonry, slats, battens.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"
#include "apps/scenes/places/things.h"

#include <algorithm>
#include <cmath>

namespace scanshade::scene {
namespace {

/// Books side by side from `from` on, their spines towards -y; some are pushed in, some are missing.
void add_row_of_books(Bodies& bodies, const LocalFrame& at, double from, double until, double low, double high,
                      Random& random) {
    double common_high = 0, common_deep = 0, front = 0;
    int left_of_series = 0; // books of one series are alike
    for (double x = from; x < until - 0.05;) {
        if (left_of_series-- <= 0) {
            left_of_series = random.below(9);
            common_high = random.between(0.62, 0.95) * high;
            common_deep = random.between(0.12, 0.21);
            front = random.between(-0.13, -0.09);
            if (random.below(12) == 0)
                x += random.between(0.03, 0.15); // a gap
        }
        const double thick = random.between(0.014, 0.055), deep = common_deep + random.between(-0.005, 0.005),
                     push = random.below(7) == 0 ? random.between(0.01, 0.07) : random.between(0, 0.006);
        const double tall = common_high * random.between(0.96, 1);
        add(bodies, random.one_of({books, red, green, card, cloth, clay}),
            {at.box(x + thick / 2, front + push + deep / 2, low, thick - 0.0015, deep, tall)});
        if (random.below(5) == 0 && high - tall > 0.06) // one lies on top
            add(bodies, random.one_of({books, white, card}),
                {at.box(x + 0.09, front + 0.08, low + common_high, 0.17, 0.13, random.between(0.015, 0.04))});
        x += thick;
    }
}

/// A bookcase with its back towards +y.
void add_bookcase(Bodies& bodies, const LocalFrame& at, double width, double height, int levels, Random& random) {
    constexpr double depth = 0.3, board = 0.022, part = 0.9;
    const double pitch = height / levels;
    const int parts = std::max(1, static_cast<int>(std::lround(width / part)));
    add(bodies, oak, {at.box(0, depth / 2, 0, width, 0.01, height)});
    for (int level = 0; level <= levels; ++level)
        add(bodies, oak, {at.box(0, 0, 0.06 + level * pitch, width, depth, board)});
    for (int i = 0; i <= parts; ++i)
        add(bodies, oak, {at.box(-width / 2 + i * width / parts, 0, 0, board, depth, height + 0.08)});
    for (int level = 0; level < levels; ++level)
        for (int i = 0; i < parts; ++i)
            add_row_of_books(bodies, at, -width / 2 + i * width / parts + board,
                             -width / 2 + (i + random.between(0.7, 1)) * width / parts, 0.06 + level * pitch + board,
                             pitch - board, random);
}

/// Bricks with joints as deep as `joint`, facing +y from the plane y = 0.
void add_masonry(Bodies& bodies, double width, double height, double joint, Random& random) {
    constexpr double length = 0.25, course = 0.083, gap = 0.012;
    for (int row = 0; row * course < height; ++row)
        for (double x = row % 2 == 0 ? 0 : -length / 2; x < width; x += length)
            add(bodies, brick,
                {block({std::max(x, 0.0), -0.02, row * course},
                       {std::min(x + length - gap, width), joint * random.between(0.8, 1.3),
                        row * course + course - gap})});
}

} // namespace

Scene library() {
    Scene scene{.name = "library", .summary = "walls of books, masonry, slatted doors, battens, stacks of paper"};
    Bodies& bodies = scene.bodies;
    Random random(83);
    constexpr double wide = 3.8, deep = 4.8, high = 2.7;
    add_shell(bodies, {wide, deep, high}, boards, plaster, whitewash);
    add_bookcase(bodies, {{1.9, 4.6, 0}, 0}, 3.6, 2.2, 6, random);
    add_bookcase(bodies, {{0.2, 2.7, 0}, pi / 2}, 2.7, 2.05, 5, random);
    add_masonry(bodies, wide, high, 0.014, random);
    // Slatted doors and battens on the right.
    for (const double y : {3.0, 3.7})
        for (int i = 0; i < 46; ++i)
            add(bodies, white,
                {Box{{3.72, y, 0.12 + 0.042 * i},
                     {0.018, 0.3, 0.003},
                     Eigen::AngleAxisd(0.7, Vector3d::UnitY()).toRotationMatrix()}});
    for (const double y : {2.68, 3.35, 4.02})
        add(bodies, white, {block({3.69, y - 0.03, 0}, {3.75, y + 0.03, 2.1})});
    for (int i = 0; i < 20; ++i)
        add(bodies, oak, {block({3.765, 0.5 + 0.1 * i, 0.1}, {3.8, 0.545 + 0.1 * i, 1.3})});
    add(bodies, oak, {block({3.75, 0.45, 1.3}, {3.8, 2.5, 1.36})});
    // A desk with a keyboard, stacks of paper and books; more stacks on the floor; a tray of pebbles.
    const LocalFrame desk{{2.9, 1.5, 0}, pi / 2};
    add_table(bodies, desk, 1.4, 0.7, 0.74);
    for (int row = 0; row < 5; ++row)
        for (int key = 0; key < 15; ++key)
            add(bodies, white, {desk.box(-0.2 + 0.02 * key, -0.2 + 0.02 * row, 0.755, 0.016, 0.016, 0.008)});
    add(bodies, slate, {desk.box(-0.06, -0.16, 0.74, 0.33, 0.13, 0.015)});
    const auto stack = [&](double x, double y, double z, int count) {
        for (int i = 0; i < count; ++i) {
            const double thick = random.between(0.012, 0.05);
            add(bodies, random.one_of({books, card, white, red, green}),
                {box_on(z, x + random.between(-0.015, 0.015), y + random.between(-0.015, 0.015),
                        random.between(0.14, 0.24), random.between(0.2, 0.3), thick, random.between(-0.15, 0.15))});
            z += thick;
        }
    };
    stack(2.75, 2.0, 0.74, 8);
    stack(3.05, 1.05, 0.74, 12);
    for (int i = 0; i < 7; ++i)
        stack(random.between(0.8, 2.2), random.between(3.2, 4.1), 0, 4 + random.below(14));
    for (int i = 0; i < 160; ++i)
        add(bodies, random.one_of({stone, white, slate}),
            {Sphere{{random.between(1.4, 2.0), random.between(2.1, 2.6), random.between(0.012, 0.03)},
                    random.between(0.012, 0.03)}});
    add_chair(bodies, {{2.2, 1.5, 0}, -pi / 2});
    add_radiator(bodies, {{0.1, 0.7, 0}, pi / 2}, 12);
    scene.windows = {{1.9, 2.4, 2.6}, {1.9, 0.8, 2.5}};
    scene.walk = {{{{2.40, 1.40, 1.50}, {1.50, 4.40, 1.10}},
                   {{2.70, 2.30, 1.45}, {0.30, 2.90, 1.00}},
                   {{2.30, 3.00, 1.50}, {0.50, 1.60, 0.80}},
                   {{1.70, 3.00, 1.50}, {1.90, 0.20, 0.80}},
                   {{1.20, 2.40, 1.60}, {2.90, 1.40, 0.75}},
                   {{1.30, 2.00, 1.55}, {3.50, 2.90, 0.95}},
                   {{1.60, 1.30, 1.60}, {2.40, 4.40, 0.80}}},
                  22};
    return scene;
}

} // namespace scanshade::scene
