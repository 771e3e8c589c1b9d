// The scene attic: rafters and sloping planes, a gap behind every beam, stored things under cloths and in crates.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"
#include "apps/scenes/places/things.h"

#include <cmath>

namespace scanshade::scene {

Scene attic() {
    Scene scene{.name = "attic", .summary = "rafters, sloping planes, crates, rolled rugs, a chimney, a ladder"};
    Bodies& bodies = scene.bodies;
    Random random(53);
    constexpr double wide = 5, deep = 6, ridge = 3, eaves = 0.6;
    add(bodies, boards, {block({-0.1, -0.1, -0.1}, {wide + 0.1, deep + 0.1, 0})});
    for (const double y : {-0.1, deep})
        add(bodies, brick, {block({-0.1, y, 0}, {wide + 0.1, y + 0.1, ridge + 0.1})});
    const double slope = std::atan2(ridge - eaves, wide / 2), length = std::hypot(ridge - eaves, wide / 2) / 2;
    const auto leaning = [&](double x, double y, double z, const Vector3d& half, double turn) {
        return Box{{x, y, z}, half, Eigen::AngleAxisd(turn, Vector3d::UnitY()).toRotationMatrix()};
    };
    for (const double side : {-1.0, 1.0}) {
        const double x = wide / 2 + side * wide / 4, z = (ridge + eaves) / 2, turn = side * slope;
        add(bodies, card, {leaning(x, deep / 2, z + 0.13, {length + 0.1, deep / 2, 0.02}, turn)});
        for (int i = 0; i <= 8; ++i) // rafters below the boards
            add(bodies, oak, {leaning(x, 0.1 + 0.72 * i, z, {length, 0.04, 0.07}, turn)});
        add(bodies, brick, {block({side < 0 ? -0.1 : wide, 0, 0}, {side < 0 ? 0 : wide + 0.1, deep, eaves + 0.2})});
    }
    for (const double y : {1.5, 3.7}) // ties with posts
        add(bodies, oak, {bar({0.9, y, 1.95}, {wide - 0.9, y, 1.95}, 0.12), bar({1.2, y, 0}, {1.2, y, 1.9}, 0.1)});
    add(bodies, brick, {block({3.2, 4.2, 0}, {3.9, 4.9, 3})});
    // Crates, half open, in front of the eaves; rolled rugs; a trunk; picture frames that lean; a ladder.
    for (int i = 0; i < 11; ++i) {
        const bool left = i % 2 == 0;
        const double x = left ? random.between(0.4, 1.0) : random.between(3.9, 4.6), y = 0.8 + 0.45 * i;
        const double w = random.between(0.3, 0.5), d = random.between(0.28, 0.4), h = random.between(0.2, 0.42);
        const LocalFrame at{{x, y, 0}, random.between(-0.4, 0.4)};
        add(bodies, card,
            {at.box(0, 0, 0, w, d, 0.015), at.box(-w / 2, 0, 0, 0.015, d, h), at.box(w / 2, 0, 0, 0.015, d, h),
             at.box(0, -d / 2, 0, w, 0.015, h), at.box(0, d / 2, 0, w, 0.015, h)});
        for (int k = 0; k < 4; ++k)
            add(bodies, random.one_of({red, green, books, white}),
                {at.box(random.between(-w / 4, w / 4), random.between(-d / 4, d / 4), 0.02, 0.1, 0.12,
                        random.between(0.1, h + 0.1))});
    }
    for (int i = 0; i < 5; ++i)
        add(bodies, woven_rug,
            {rod({1.7 + 0.19 * i, 5.2, 0.1 + 0.02 * (i % 2)}, {1.6 + 0.2 * i, 5.9, 0.1 + 1.5 * (i % 2)}, 0.09)});
    add(bodies, oak, {box_on(0, 2.6, 3.3, 0.9, 0.5, 0.45, 0.5), box_on(0.45, 2.6, 3.3, 0.94, 0.54, 0.04, 0.5)});
    for (int i = 0; i < 5; ++i)
        add(bodies, oak,
            {Box{{3.15 - 0.05 * i, 4.4, 0.4},
                 {0.012, 0.3 + 0.02 * i, 0.4},
                 Eigen::AngleAxisd(0.2 + 0.06 * i, Vector3d::UnitY()).toRotationMatrix()}});
    for (const double x : {1.9, 2.3})
        add(bodies, oak, {bar({x, 2.1, 0}, {x, 3.6, 1.9}, 0.05)});
    for (int i = 1; i < 8; ++i)
        add(bodies, oak, {rod({1.9, 2.1 + 0.19 * i, 0.24 * i}, {2.3, 2.1 + 0.19 * i, 0.24 * i}, 0.014)});
    add_chair(bodies, {{3.3, 2.4, 0}, 1.0});
    add_bicycle(bodies, {{2.2, 5.85, 0}, 0});
    for (int i = 0; i < 30; ++i)
        add(bodies, random.one_of({clay, yellow, white}),
            {Sphere{{random.between(2.9, 4.4), random.between(1.0, 2.0), 0.05}, random.between(0.03, 0.09)}});
    hang_wire(bodies, cloth, {1.2, 1.5, 1.8}, {1.2, 3.7, 1.8}, 0.2, 0.006);
    scene.windows = {{2.5, 0.3, 1.8}, {2.5, 5.7, 2.0}};
    scene.walk = {{{{2.50, 0.50, 1.55}, {2.60, 4.20, 0.70}},
                   {{3.10, 0.80, 1.50}, {1.00, 3.60, 0.50}},
                   {{3.40, 1.60, 1.45}, {4.60, 3.60, 0.40}},
                   {{3.00, 2.60, 1.55}, {2.20, 5.60, 0.70}},
                   {{2.00, 3.90, 1.55}, {3.40, 4.60, 0.90}},
                   {{1.70, 2.40, 1.50}, {0.60, 4.60, 0.50}},
                   {{1.90, 1.00, 1.40}, {3.30, 2.60, 0.30}}},
                  18};
    return scene;
}

} // namespace scanshade::scene
