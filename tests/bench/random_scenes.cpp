#include "tests/bench/random_scenes.h"

#include "apps/scenes/places/heap.h"
#include "apps/scenes/places/materials.h"
#include "apps/scenes/places/parts.h"
#include "apps/scenes/places/things.h"
#include "projection/base/named.h"

#include <cmath>

namespace scanshade::bench {
namespace {

using namespace scene; // parts and materials

Eigen::Matrix3d any_rotation(Random& random) {
    const Vector3d axis(random.between(-1, 1), random.between(-1, 1), random.between(-1, 1));
    return Eigen::AngleAxisd(random.between(0, 2 * pi), (axis + Vector3d(1e-3, 0, 0)).normalized()).toRotationMatrix();
}

/// A ring of viewpoints round a place, `rise` of its radius up and down.
Walk round(const Vector3d& middle, double radius, double lowest, double highest) {
    Walk walk;
    constexpr int views = 12;
    for (int i = 0; i < views; ++i) {
        const double angle = 2 * pi * i / views, up = i % 2 ? highest : lowest;
        const double across = std::sqrt(std::max(radius * radius - up * up, 0.01 * radius * radius));
        walk.viewpoints.push_back({middle + Vector3d(across * std::cos(angle), across * std::sin(angle), up), middle});
    }
    return walk;
}

/// Solids grown together round a place.
void add_body(Bodies& bodies, const Vector3d& middle, double size, Random& random) {
    const int parts = 1 + random.below(random.one_of({1, 3, 10})); // a third are plain
    std::vector<Vector3d> places{middle};
    for (int part = 0; part < parts; ++part) {
        const double thick = size * random.between(0.12, part == 0 ? 0.5 : 0.3);
        const Vector3d from = places[static_cast<std::size_t>(random.below(static_cast<int>(places.size())))];
        const Eigen::Matrix3d axes = any_rotation(random);
        const Vector3d at = part == 0 ? from : Vector3d(from + size * random.between(0.1, 0.3) * axes.col(2));
        const Material& material = random.one_of({white, steel, stone, card});
        switch (random.below(4)) {
        case 0:
            add(bodies, material, {Sphere{at, thick}});
            break;
        case 1:
            add(bodies, material, {Box{at, thick * Vector3d(random.between(0.3, 1), random.between(0.3, 1), 1), axes}});
            break;
        case 2:
            add(bodies, material, {rod(from, at + 0.5 * thick * axes.col(0), 0.5 * thick)});
            break;
        default:
            add_ring(bodies, material, at, axes.col(0), thick, 0.25 * thick, 16);
        }
        places.push_back(at);
    }
}

Scene room(Random& random) {
    Scene scene{.name = "room", .summary = "a random room"};
    const double scale = random.one_of({1.0, 1.0, 1.0, 1.0, 0.6, 3.0}); // cabins and halls, too
    const Vector3d size = scale * Vector3d(random.between(2.2, 9), random.between(2.2, 9), random.between(2.1, 4));
    add_shell(scene.bodies, size, boards, plaster, whitewash);
    const Vector3d middle(size.x() / 2, size.y() / 2, 0.5 * size.z());
    const double free = 0.22 * std::min(size.x(), size.y());
    for (int i = 0; i < 8; ++i) {
        const double angle = pi * i / 4;
        const Vector3d towards(std::cos(angle), std::sin(angle), 0);
        scene.walk.viewpoints.push_back(
            {middle + free * towards + Vector3d(0, 0, (i % 2 ? 0.06 : -0.06) * size.z()), middle + 3 * free * towards});
    }
    for (int i = random.below(random.one_of({1, 4, 16, 40})); i > 0; --i) { // a quarter are empty
        const double width = scale * random.between(0.1, 1.4), depth = scale * random.between(0.1, 0.8),
                     height = random.between(0.05, 0.7) * size.z();
        const double x = random.between(0.03, 0.97) * size.x(), y = random.between(0.03, 0.97) * size.y();
        if (std::hypot(x - middle.x(), y - middle.y()) < free + std::hypot(width, depth) / 2 + 0.05 * scale)
            continue; // whoever walks there
        if (random.below(4) == 0)
            add_table(scene.bodies, {{x, y, 0}, random.between(0, pi)}, width, depth, scale * random.between(0.4, 1));
        else if (random.below(4) == 0)
            add(scene.bodies, red, {Cylinder{{x, y, 0}, depth / 2, height}});
        else
            add(scene.bodies, card,
                {box_on(random.below(3) ? 0 : scale * random.between(0, 1), x, y, width, depth, height,
                        random.between(0, pi))});
    }
    scene.far_m = 60;
    return scene;
}

Scene body(Random& random) {
    Scene scene{.name = "body", .summary = "a random body"};
    const double size = std::pow(10, random.between(-1.3, 1.2));
    add_body(scene.bodies, Vector3d::Zero(), size, random);
    scene.walk = round(Vector3d::Zero(), random.between(2, 5) * size, -1.5 * size, 1.8 * size);
    scene.far_m = 20 * size;
    scene.ao_radius_m = 0.2 * size;
    return scene;
}

Scene things(Random& random) {
    Scene scene{.name = "things", .summary = "random things on a ground that ends"};
    const double size = std::pow(10, random.between(-0.7, 1));
    add(scene.bodies, random.one_of({oak, stone}), {block({-size, -size, -0.1 * size}, {size, size, 0})});
    for (int i = 1 + random.below(7); i > 0; --i)
        add_body(scene.bodies, {random.between(-0.7, 0.7) * size, random.between(-0.7, 0.7) * size, 0.1 * size},
                 random.between(0.1, 0.5) * size, random);
    if (random.below(2))
        drop_many(scene.bodies, {-0.8 * size, -0.8 * size}, {0.8 * size, 0.8 * size}, 0, 12, 0.05 * size, 0.4 * size,
                  random);
    scene.walk = round(Vector3d::Zero(), random.between(2, 4) * size, 0.6 * size, 1.9 * size);
    scene.far_m = 20 * size;
    scene.ao_radius_m = 0.2 * size;
    return scene;
}

Scene hills(Random& random) {
    Scene scene{.name = "hills", .summary = "random hills"};
    const double size = std::pow(10, random.between(1, 2.5)), rise = size * random.between(0.01, 0.25);
    struct Wave {
        double x, y, phase, height;
    };
    std::vector<Wave> waves;
    for (int i = 0; i < 6; ++i) {
        const double length = size / random.between(1, 8), angle = random.between(0, 2 * pi);
        waves.push_back({2 * pi * std::cos(angle) / length, 2 * pi * std::sin(angle) / length,
                         random.between(0, 2 * pi), rise * length / size});
    }
    const auto at = [&](int i, int j) {
        const double x = size * (i / 40.0 - 0.5), y = size * (j / 40.0 - 0.5);
        double z = 0;
        for (const Wave& wave : waves)
            z += wave.height * std::sin(wave.x * x + wave.y * y + wave.phase);
        return Vector3d(x, y, z);
    };
    std::vector<Triangle> ground;
    for (int i = 0; i < 40; ++i)
        for (int j = 0; j < 40; ++j)
            for (const Triangle& half : quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)))
                ground.push_back(half);
    add(scene.bodies, grass, ground);
    for (int i = random.below(random.one_of({2, 60})); i > 0; --i) {
        const Vector3d foot = at(2 + random.below(37), 2 + random.below(37));
        const double large = size * random.between(0.01, 0.06);
        if (random.below(2))
            add(scene.bodies, leaves, {Sphere{foot + Vector3d(0, 0, 0.7 * large), large}});
        else
            add(scene.bodies, brick,
                {box_on(foot.z() - large, foot.x(), foot.y(), large, 1.5 * large, 2 * large, random.between(0, pi))});
    }
    scene.walk = round({0, 0, 0}, size * random.between(0.6, 1.5), size * 0.3, size * 0.5);
    scene.far_m = 5 * size;
    scene.ao_radius_m = 0.05 * size;
    return scene;
}

struct Kind {
    std::string_view name;
    Scene (*make)(Random&);
};
const std::vector<Kind>& kinds() {
    static const std::vector<Kind> table{{"room", room}, {"body", body}, {"things", things}, {"hills", hills}};
    return table;
}

} // namespace

std::vector<std::string_view> random_kinds() {
    std::vector<std::string_view> names;
    for (const Kind& kind : kinds())
        names.push_back(kind.name);
    return names;
}

Scene random_scene(std::string_view kind, int seed) {
    Random random(static_cast<std::uint32_t>(seed) * 2654435761U + 97);
    return one_named(kinds(), kind, "kind").make(random);
}

} // namespace scanshade::bench
