// Depth frames of a simulated sensor as one cloud.
#include "apps/scenes/merged_frames.h"

#include "apps/scenes/generate.h"
#include "apps/scenes/sensor.h"
#include "apps/scenes/world/random_noise.h"
#include "projection/base/hash.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace scanshade::scene {
namespace {

using Eigen::Vector3d;

constexpr double frames_per_s = 10;

template <class Value>
void reorder(std::vector<Value>& values, const std::vector<std::size_t>& order) {
    std::vector<Value> sorted;
    sorted.reserve(values.size());
    for (const std::size_t i : order)
        sorted.push_back(values[i]);
    values = std::move(sorted);
}

void shuffle(SceneCloud& cloud, int seed) {
    std::vector<std::size_t> order(cloud.points.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::sort(order, {}, [&](std::size_t i) {
        return std::pair(hash(static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(i)), i);
    });
    for (auto* values : {&cloud.points, &cloud.normals, &cloud.surface})
        reorder(*values, order);
}

Vector3d shift_of(int frame, double sigma, int seed) {
    const Noise noise(seed, frame, 107);
    return sigma * Vector3d(noise.gaussian(0, 0), noise.gaussian(1, 0), noise.gaussian(2, 0));
}

} // namespace

SceneCloud merged_frames(const World& world, std::size_t count, const MergedFrames& options, int seed) {
    const Pinhole camera = camera_of_size({640, 480});
    const double pixels = static_cast<double>(options.frames) * camera.size.area();
    const int stride = std::max(1, static_cast<int>(std::sqrt(pixels / static_cast<double>(count)) + 0.5));
    SceneCloud cloud;
    for (int i = 0; i < options.frames; ++i) {
        const int frame = options.first + i * options.step;
        const Eigen::Isometry3d pose = world_from_camera(world.scene().walk, frame / frames_per_s);
        const Sight sight{world, camera, pose, render_geometry(world, camera, pose), seed, frame};
        const cv::Mat1f z = sensor_named(options.sensor).record(sight);
        const Vector3d shift = shift_of(frame, options.misaligned_m, seed);
        cloud.stations.emplace_back(pose.translation());
        for (int v = 0; v < z.rows; v += stride)
            for (int u = 0; u < z.cols; u += stride) {
                const auto recorded = static_cast<double>(z(v, u)), exact = static_cast<double>(sight.exact.z_m(v, u));
                if (!(recorded > 0) || !(exact > 0))
                    continue;
                const cv::Vec3f normal = sight.exact.normals(v, u);
                cloud.points.emplace_back(pose * camera.point(u, v, recorded) + shift);
                cloud.surface.emplace_back(pose * camera.point(u, v, exact));
                cloud.normals.emplace_back(pose.linear() * Vector3d(normal[0], normal[1], normal[2]));
            }
    }
    if (options.shuffled)
        shuffle(cloud, seed);
    return cloud;
}

} // namespace scanshade::scene
