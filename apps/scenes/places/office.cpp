// The scene office: one room, furnished along its walls, the simplest of the six.
#include "apps/scenes/places/scenes.h"

#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"

#include <utility>

namespace scanshade::scene {

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
        const Eigen::Rotation2Dd rotation(0.12);
        const Eigen::Vector2d leg = Eigen::Vector2d(2.35, 3.55) + rotation * Eigen::Vector2d(x, y);
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

} // namespace scanshade::scene
