// `bench --clouds`: visibility of a scene's points, from the points alone, against rays on the scene itself: error,
// time, memory. With --clouds.sky it is the share of the sky, also by depth images from 256 directions.
//
// All rows compare the same points (about 50000). Seconds are of wall clock and processor.
#include "ao/cloud/cloud_ao.h"
#include "ao/compare.h"
#include "ao/gpu/device.h"
#include "ao/raycast/raycast.h"
#include "apps/lists.h"
#include "apps/measure/bench_part.h"
#include "apps/scenes/scene_cloud.h"
#include "projection/hash.h"
#include "projection/stopwatch.h"

#include <ctime>
#include <fmt/format.h>
#include <fstream>
#include <numbers>
#include <tbb/combinable.h>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

/// Peak memory of the process, in MiB.
double peak_memory_mib() {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;)
        if (double kib = 0; word == "VmHWM:" && status >> kib)
            return kib / 1024;
    return 0;
}

struct Judge {
    std::vector<float> truth; ///< NaN where a point is not compared

    template <class Compute>
    void row(const std::string& name, Compute&& compute) const {
        const Stopwatch stopwatch;
        const std::clock_t cpu = std::clock();
        const std::vector<float> values = compute();
        const double wall_s = stopwatch.seconds();
        const double cpu_s = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
        cv::Mat1f ours(1, static_cast<int>(values.size())), exact(ours.size());
        std::copy(values.begin(), values.end(), ours.begin());
        std::copy(truth.begin(), truth.end(), exact.begin());
        const Difference d = compare(ours, exact);
        fmt::print("{:<26} RMSE {:.4f}  bias {:+.4f}  corr. {:.4f}  95 % {:.3f}  wall {:7.2f} s  cpu {:7.2f} s  peak "
                   "{:6.0f} MiB\n",
                   name, d.rms, d.bias, d.correlation, d.percentile_95, wall_s, cpu_s, peak_memory_mib());
        std::fflush(stdout);
    }
};

/// Share of the sky by rays on the scene, cosine-weighted, of every `step`-th point.
std::vector<float> true_sky(const scene::World& world, const scene::SceneCloud& cloud, std::size_t step) {
    constexpr int rays = 512;
    constexpr double far_away = 300; // farther than all objects, nearer than the ground's border
    const CosineDirections directions(rays, 1);
    std::vector<float> truth(cloud.points.size(), std::numeric_limits<float>::quiet_NaN());
    tbb::parallel_for(std::size_t(0), (truth.size() + step - 1) / step, [&](std::size_t k) {
        const std::size_t i = k * step;
        const Vector3d n = cloud.normals[i], x = n.unitOrthogonal(), y = n.cross(x);
        const Vector3d from = cloud.points[i] + 2 * world.surface().rounding_m() * n;
        int open = 0;
        for (const auto& d : directions.set_for(hash(static_cast<std::uint32_t>(i)))) {
            const Vector3d along =
                static_cast<double>(d.x) * x + static_cast<double>(d.y) * y + static_cast<double>(d.z) * n;
            open += along.z() > 0 && !world.surface().blocked(from, from + far_away * along);
        }
        truth[i] = static_cast<float>(open) / rays;
    });
    return truth;
}

/// The sky by orthographic depth images from `views` directions of the upper half sphere, after ShadeVis and
/// CloudCompare's PCV. Weighted by the cosine to the normal, so that open ground reads 1. Splats of 1.5 spacings,
/// tolerance 0.2 % of the extent.
std::vector<float> sky_by_views(const scene::SceneCloud& cloud, double spacing, int views, int raster) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : cloud.points)
        box.extend(p);
    const double extent = box.diagonal().norm(), pixel = extent / raster, bias = std::max(0.002 * extent, 2 * pixel);
    const int reach = static_cast<int>(std::lround(0.75 * spacing / pixel));
    tbb::combinable<std::vector<float>> lit([&] { return std::vector<float>(cloud.points.size(), 0.0F); });
    tbb::combinable<std::vector<float>> depths(
        [&] { return std::vector<float>(static_cast<std::size_t>(raster * raster)); });
    tbb::parallel_for(0, views, [&](int view) {
        const double z = (view + 0.5) / views, angle = view * std::numbers::pi * (3 - std::sqrt(5.0)),
                     across = std::sqrt(1 - z * z);
        const Vector3d towards(across * std::cos(angle), across * std::sin(angle), z), x = towards.unitOrthogonal(),
                                                                                       y = towards.cross(x);
        std::vector<float>&sum = lit.local(), &depth = depths.local();
        std::fill(depth.begin(), depth.end(), -1e30F);
        const auto project = [&](const Vector3d& p, int& u, int& v) {
            const Vector3d offset = p - box.center();
            u = std::clamp(static_cast<int>(offset.dot(x) / pixel + raster / 2.0), 0, raster - 1);
            v = std::clamp(static_cast<int>(offset.dot(y) / pixel + raster / 2.0), 0, raster - 1);
            return static_cast<float>(offset.dot(towards));
        };
        for (const Vector3d& p : cloud.points) {
            int u = 0, v = 0;
            const float near = project(p, u, v);
            for (int dv = std::max(v - reach, 0); dv <= std::min(v + reach, raster - 1); ++dv)
                for (int du = std::max(u - reach, 0); du <= std::min(u + reach, raster - 1); ++du)
                    depth[static_cast<std::size_t>(dv * raster + du)] =
                        std::max(depth[static_cast<std::size_t>(dv * raster + du)], near);
        }
        for (std::size_t i = 0; i < sum.size(); ++i) {
            const double cosine = cloud.normals[i].dot(towards);
            int u = 0, v = 0;
            if (const float near = project(cloud.points[i], u, v);
                cosine > 0 && near >= depth[static_cast<std::size_t>(v * raster + u)] - static_cast<float>(bias))
                sum[i] += static_cast<float>(2 * cosine / views); // over the half sphere the mean cosine is 1/2
        }
    });
    std::vector<float> sky(cloud.points.size(), 0.0F);
    lit.combine_each([&](const std::vector<float>& part) {
        for (std::size_t i = 0; i < sky.size(); ++i)
            sky[i] += part[i];
    });
    return sky;
}

/// Share of the normals that face the wrong side; missing normals do not count.
double share_reversed(const std::vector<Vector3f>& found, const std::vector<Vector3d>& exact) {
    double away = 0, all = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
        away += found[i].cast<double>().dot(exact[i]) < 0;
        all += !found[i].isZero();
    }
    return away / std::max(all, 1.0);
}

class CloudErrors final : public BenchPart {
  public:
    Stage stage() override {
        return {"clouds against rays on their scene",
                {{"clouds", "measures errors, seconds and memory of a scene's points", &asked_},
                 {"clouds.scene", "which scene; empty = office, or outdoor for the sky", &scene_},
                 {"clouds.points", "how many points", &points_, "", 1, 1e9},
                 {"clouds.rays", "rays per point, with commas", &rays_},
                 {"clouds.smooth", "how often values become means of neighbours; -1 = by the spacing", &smooth_, "", -1,
                  16},
                 {"clouds.normals", "whether the points come with their normals", &normals_},
                 {"clouds.gpu", "computes on the Vulkan device instead of the processor", &gpu_},
                 {"clouds.raycast", "measures the method raycast with 64 rays, too", &raycast_},
                 {"clouds.sky", "measures the share of the sky instead, also by depth images", &sky_},
                 {"clouds.raster", "sizes of these images, pixels a side, with commas", &rasters_}}};
    }
    [[nodiscard]] bool asked() const override { return asked_; }

    int run(const std::string& choice) override {
        const std::vector<int> rays = whole_numbers("clouds.rays", rays_, 1),
                               rasters = whole_numbers("clouds.raster", rasters_, 1);
        const scene::World world(scene::scene_named(!scene_.empty() ? scene_ : sky_ ? "outdoor" : "office"));
        const auto points = static_cast<std::size_t>(points_);
        const auto cloud = scene::scene_cloud(world, points);
        const std::size_t step = std::max<std::size_t>(1, points / 50000);
        const double radius = world.scene().ao_radius_m;
        const Judge judge{sky_ ? true_sky(world, cloud, step)
                               : scene::true_visibility(world, cloud, {radius, 1024, 1, false}, step)};
        const PointSet set{cloud.points, normals_ ? cloud.normals : std::span<const Vector3d>()};
        fmt::print("{}: {} points, radius {} m; every {}. point is compared\n", world.scene().name, points,
                   sky_ ? 0 : radius, step);
        double spacing = 0, reversed = 0;
        std::unique_ptr<gpu::Device> device;
        if (gpu_)
            device = std::make_unique<gpu::Device>(choice);
        for (const int count : rays)
            judge.row(fmt::format("{} rays a point", count), [&] {
                const auto found =
                    CloudAo({.radius = radius, .rays = count, .smooth = smooth_, .sky = sky_}, device.get())
                        .compute(set);
                for (const auto& [stage, ms] : found.timings)
                    fmt::print("{} {:.0f} ms; ", stage, ms);
                fmt::print("\n");
                spacing = found.spacing;
                reversed = share_reversed(found.normals, cloud.normals);
                return found.visibility;
            });
        if (!normals_)
            fmt::print("{:.2f} % of the normals face the wrong side\n", 100 * reversed);
        if (sky_)
            for (const int raster : rasters)
                judge.row(fmt::format("256 views of {0}x{0}", raster),
                          [&] { return sky_by_views(cloud, spacing, 256, raster); });
        if (raycast_)
            judge.row("raycast, 64 rays",
                      [&] { return Raycast({.radius_m = radius, .rays = 64}).compute(set).visibility; });
        return all_well;
    }

  private:
    std::string scene_, rays_ = "8,16,32", rasters_ = "512,1024,2048";
    int points_ = 1000000, smooth_ = -1;
    bool asked_ = false, normals_ = true, gpu_ = false, raycast_ = false, sky_ = false;
};

} // namespace

std::unique_ptr<BenchPart> cloud_errors() { return std::make_unique<CloudErrors>(); }

} // namespace scanshade
