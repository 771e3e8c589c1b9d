// Objects dropped one by one, each on those below it.
#include "apps/scenes/places/heap.h"

#include "apps/scenes/places/materials.h"

#include <algorithm>
#include <cmath>

namespace scanshade::scene {
namespace {

/// The heap's height so far, on a grid of 2 cm. Dropped objects rest on it.
class Heap {
  public:
    Heap(const Vector2d& low, const Vector2d& high, double floor_z)
        : low_(low), columns_(cells(high.x() - low.x())), rows_(cells(high.y() - low.y())),
          top_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), floor_z) {}

    /// Drops an object with a round footprint; returns the height that it rests at.
    double settle(const Vector2d& at, double radius, double height) {
        double rest = -1e9;
        for_cells(at, radius, [&](double& top) { rest = std::max(rest, top); });
        for_cells(at, radius, [&](double& top) { top = rest + height; });
        return rest;
    }

  private:
    static constexpr double cell = 0.02;
    static int cells(double length) { return static_cast<int>(std::ceil(length / cell)); }
    template <class Visit>
    void for_cells(const Vector2d& at, double radius, Visit&& visit) {
        const auto index = [&](double offset, int count) {
            return std::clamp(static_cast<int>(offset / cell), 0, count - 1);
        };
        for (int row = index(at.y() - radius - low_.y(), rows_); row <= index(at.y() + radius - low_.y(), rows_); ++row)
            for (int column = index(at.x() - radius - low_.x(), columns_);
                 column <= index(at.x() + radius - low_.x(), columns_); ++column)
                if ((low_ + cell * Vector2d(column + 0.5, row + 0.5) - at).norm() <= radius + cell)
                    visit(top_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                               static_cast<std::size_t>(column)]);
    }

    Vector2d low_;
    int columns_, rows_;
    std::vector<double> top_;
};

/// Drops one object of about `size` on a heap: boxes, some tipped over, balls, cans, bowls, pipes, open cartons.
void drop(Bodies& bodies, Heap& heap, const Vector2d& at, double size, Random& random) {
    const Material paint = random.one_of({card, red, green, yellow, white, cloth, books, steel, clay});
    const double yaw = random.between(0, pi), tall = size * random.between(0.4, 1.3);
    switch (random.below(8)) {
    case 0:
    case 1:
    case 2: {
        const double wide = size * random.between(0.6, 1), deep = size * random.between(0.4, 0.9);
        const double z = heap.settle(at, 0.42 * std::min(wide, deep), tall);
        add(bodies, paint, {box_on(z, at.x(), at.y(), wide, deep, tall, yaw)});
        break;
    }
    case 3: { // tipped over, resting on an edge
        const double tilt = random.between(0.3, 1.2), half = size * 0.35;
        const double high = 2 * half * (std::sin(tilt) + std::cos(tilt));
        const double z = heap.settle(at, half, high * 0.9);
        const Eigen::Matrix3d axes =
            rotation_about_z(yaw) * Eigen::AngleAxisd(tilt, Vector3d::UnitX()).toRotationMatrix();
        add(bodies, paint, {Box{{at.x(), at.y(), z + high / 2}, {half * 1.3, half, half}, axes}});
        break;
    }
    case 4: {
        const double radius = size * 0.4, z = heap.settle(at, radius * 0.7, 1.8 * radius);
        add(bodies, paint, {Sphere{{at.x(), at.y(), z + radius}, radius}});
        break;
    }
    case 5: {
        const double radius = size * 0.35, z = heap.settle(at, radius, tall);
        add(bodies, paint, {Cylinder{{at.x(), at.y(), z}, radius, tall}});
        break;
    }
    case 6: { // a bowl or bucket
        const double z = heap.settle(at, size * 0.4, tall * 0.3);
        add_vessel(bodies, paint, {at.x(), at.y(), z},
                   {{0, 0.004}, {0.28 * size, 0.004}, {0.42 * size, 0.35 * tall}, {0.48 * size, 0.9 * tall}}, 20);
        break;
    }
    default: { // an open carton
        const double half = size * 0.5, z = heap.settle(at, half, 0.3 * tall), wall = 0.006;
        const LocalFrame local{{at.x(), at.y(), z}, yaw};
        add(bodies, card,
            {local.box(0, 0, 0, 2 * half, 2 * half, wall), local.box(-half, 0, 0, wall, 2 * half, tall),
             local.box(half, 0, 0, wall, 2 * half, tall), local.box(0, -half, 0, 2 * half, wall, tall),
             local.box(0, half, 0, 2 * half, wall, tall)});
        const Eigen::Matrix3d flap =
            rotation_about_z(yaw) * Eigen::AngleAxisd(0.5, Vector3d::UnitY()).toRotationMatrix();
        add(bodies, card, {Box{local(half + 0.07, 0, tall - 0.04), {0.08, half, wall / 2}, flap}});
    }
    }
}

} // namespace

void drop_many(Bodies& bodies, const Vector2d& low, const Vector2d& high, double floor_z, int count, double smallest,
               double largest, Random& random) {
    Heap heap(low, high, floor_z);
    for (int i = 0; i < count; ++i) { // large objects first, as in real heaps
        const double size = largest - (largest - smallest) * i / count, rim = size / 2;
        drop(bodies, heap,
             {random.between(low.x() + rim, high.x() - rim), random.between(low.y() + rim, high.y() - rim)}, size,
             random);
    }
}

} // namespace scanshade::scene
