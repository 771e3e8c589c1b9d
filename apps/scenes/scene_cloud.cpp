// A scene as a cloud.
#include "apps/scenes/scene_cloud.h"

#include "projection/base/error.h"
#include "projection/base/hash.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <optional>
#include <tbb/parallel_for.h>

namespace scanshade::scene {
namespace {

using Eigen::Vector3d;

/// Random numbers that depend on seed and index only, so threads cannot change them.
class IndexedRandom {
  public:
    IndexedRandom(std::uint32_t seed, std::uint64_t number)
        : key_(hash(hash(seed, static_cast<std::uint32_t>(number)), static_cast<std::uint32_t>(number >> 32))) {}
    double next() { return (key_ = hash(key_, ++drawn_)) * 0x1p-32; }

  private:
    std::uint32_t key_, drawn_ = 0;
};

Vector3d on_sphere(IndexedRandom& random) {
    const double z = 2 * random.next() - 1, angle = 2 * std::numbers::pi * random.next(), across = std::sqrt(1 - z * z);
    return {across * std::cos(angle), across * std::sin(angle), z};
}

std::vector<Vector3d> stations(const Walk& walk) {
    constexpr int count = 24;
    std::vector<Vector3d> eyes;
    for (int i = 0; i < count; ++i)
        eyes.push_back(world_from_camera(walk, walk.period_s * i / count).translation());
    return eyes;
}

/// The box around the surfaces seen from the stations.
Eigen::AlignedBox3d seen_box(const World& world, const std::vector<Vector3d>& eyes) {
    Eigen::AlignedBox3d box;
    for (std::uint64_t i = 0; i < 20000; ++i) {
        IndexedRandom random(7, i);
        const Ray ray{eyes[i % eyes.size()], on_sphere(random)};
        if (const Hit hit = world.cast(ray); hit.body && hit.t <= world.scene().far_m)
            box.extend(Vector3d(ray.origin + hit.t * ray.direction));
    }
    if (box.isEmpty())
        throw Error(fmt::format("scene {}: nothing is seen from its walk", world.scene().name));
    const Vector3d margin = Vector3d::Constant(1e-3); // surfaces on the box's faces belong to it
    return {box.min() - margin, box.max() + margin};
}

/// Free positions that one of the stations sees. Some of them see under tables and behind cupboards.
void add_free_positions(const World& world, const Eigen::AlignedBox3d& box, std::vector<Vector3d>& eyes) {
    constexpr std::size_t wanted = 400;
    const std::vector<Vector3d> stations = eyes;
    for (std::uint64_t i = 0; eyes.size() < wanted && i < 100 * wanted; ++i) {
        IndexedRandom random(11, i);
        const Vector3d position =
            box.min() + Vector3d(random.next(), random.next(), random.next()).cwiseProduct(Vector3d(box.sizes()));
        if (!world.surface().blocked(stations[i % stations.size()], position))
            eyes.push_back(position);
    }
}

/// A polygon's part within a box (Sutherland and Hodgman 1974).
std::vector<Vector3d> clipped(std::vector<Vector3d> polygon, const Eigen::AlignedBox3d& box) {
    for (int side = 0; side < 6 && !polygon.empty(); ++side) {
        const int axis = side / 2;
        const double sign = side % 2 ? -1 : 1, bound = sign * (side % 2 ? box.max() : box.min())[axis];
        const auto depth = [&](const Vector3d& p) { return sign * p[axis] - bound; };
        std::vector<Vector3d> rest;
        for (std::size_t i = 0; i < polygon.size(); ++i) {
            const Vector3d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
            const double da = depth(a), db = depth(b);
            if (da >= 0)
                rest.push_back(a);
            if ((da >= 0) != (db >= 0))
                rest.push_back(a + da / (da - db) * (b - a));
        }
        polygon = std::move(rest);
    }
    return polygon;
}

/// Triangles to sample points from, by area.
struct Drawable {
    std::vector<std::array<Vector3d, 3>> triangles;
    std::vector<double> area_up_to;

    Drawable(const Mesh& mesh, const Eigen::AlignedBox3d& box) {
        double area = 0;
        for (const auto& [a, b, c] : mesh.triangles) {
            const auto at = [&](int i) { return mesh.vertices[static_cast<std::size_t>(i)]; };
            const auto polygon = clipped({at(a), at(b), at(c)}, box);
            for (std::size_t i = 2; i < polygon.size(); ++i) {
                triangles.push_back({polygon[0], polygon[i - 1], polygon[i]});
                area += (polygon[i - 1] - polygon[0]).cross(polygon[i] - polygon[0]).norm() / 2;
                area_up_to.push_back(area);
            }
        }
    }

    [[nodiscard]] std::pair<Vector3d, Vector3d> draw(IndexedRandom& random) const {
        const auto chosen =
            std::upper_bound(area_up_to.begin(), area_up_to.end() - 1, random.next() * area_up_to.back());
        const auto& [a, b, c] = triangles[static_cast<std::size_t>(chosen - area_up_to.begin())];
        const double root = std::sqrt(random.next()), along = random.next();
        return {(1 - root) * a + root * (1 - along) * b + root * along * c, (b - a).cross(c - a).normalized()};
    }
};

/// The normal of the side that one of the stations sees; none where the point is hidden from all.
std::optional<Vector3d> seen_side(const World& world, const std::vector<Vector3d>& eyes, const Vector3d& point,
                                  const Vector3d& normal, std::size_t first) {
    const double clear = 2 * world.surface().rounding_m();
    constexpr std::size_t tried = 64; // a limit, since hidden surfaces would try all stations
    for (std::size_t i = 0; i < tried; ++i) {
        const Vector3d& eye = eyes[(first + i) % eyes.size()];
        const Vector3d facing = normal.dot(eye - point) < 0 ? Vector3d(-normal) : normal;
        if (!world.surface().blocked(eye, point + clear * facing))
            return facing;
    }
    return std::nullopt;
}

} // namespace

SceneCloud scene_cloud(const World& world, std::size_t count, int seed) {
    std::vector<Vector3d> eyes = stations(world.scene().walk);
    const Eigen::AlignedBox3d box = seen_box(world, eyes);
    add_free_positions(world, box, eyes);
    const Drawable drawable(mesh_of(world.scene()), box);
    SceneCloud cloud;
    constexpr std::size_t batch = 1 << 16;
    std::vector<std::pair<Vector3d, std::optional<Vector3d>>> drawn(batch);
    for (std::uint64_t begun = 0; cloud.points.size() < count; begun += batch) {
        tbb::parallel_for(std::size_t(0), batch, [&](std::size_t i) {
            IndexedRandom random(static_cast<std::uint32_t>(seed), begun + i);
            const auto [point, normal] = drawable.draw(random);
            drawn[i] = {point, seen_side(world, eyes, point, normal, i)};
        });
        for (std::size_t i = 0; i < batch && cloud.points.size() < count; ++i)
            if (drawn[i].second) {
                cloud.points.push_back(drawn[i].first);
                cloud.normals.push_back(*drawn[i].second);
            }
    }
    return cloud;
}

std::vector<float> true_visibility(const World& world, const SceneCloud& cloud, const TruthOptions& options,
                                   std::size_t step) {
    const CosineDirections directions(options.rays, options.seed);
    const RayHemisphere hemisphere(world.surface(), directions, options.radius_m, false);
    const std::vector<Vector3d>& points = cloud.surface.empty() ? cloud.points : cloud.surface;
    std::vector<float> truth(points.size(), std::numeric_limits<float>::quiet_NaN());
    tbb::parallel_for(std::size_t(0), (truth.size() + step - 1) / step, [&](std::size_t k) {
        const std::size_t i = k * step;
        if (!cloud.normals[i].isZero())
            truth[i] = hemisphere.at({points[i], cloud.normals[i], hash(static_cast<std::uint32_t>(i))}).visibility[0];
    });
    return truth;
}

} // namespace scanshade::scene
