// `developers_bench clouds`: visibility of a scene's points, from the points alone, against rays on the scene itself:
// error, time, memory. With --sky it is the share of the sky, also by depth images from 256 directions.
//
// All rows compare the same points (about 50000). Seconds are of wall clock and processor.
#include "ao/cloud/cloud_ao.h"
#include "ao/compare.h"
#include "ao/gpu/device.h"
#include "ao/raycast/raycast.h"
#include "apps/lists.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scanner.h"
#include "apps/scenes/world/random_noise.h"
#include "projection/base/hash.h"
#include "projection/base/memory.h"
#include "projection/base/statistics.h"
#include "projection/base/stopwatch.h"
#include "projection/sensor/expected_error.h"
#include "tests/bench/part.h"

#include <ctime>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <numbers>
#include <numeric>
#include <optional>
#include <tbb/combinable.h>
#include <tbb/parallel_for.h>

namespace scanshade::bench {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

struct MeasuredCloud {
    Difference difference;
    double wall_s = 0, cpu_s = 0;

    /// The first cells of a row.
    [[nodiscard]] std::vector<std::string> cells(const std::string& name) const {
        const Difference& d = difference;
        return {name,
                fmt::format("{:.4f}", d.rms),
                fmt::format("{:+.4f}", d.bias),
                fmt::format("{:.4f}", d.correlation),
                fmt::format("{:.3f}", d.percentile_95),
                fmt::format("{:.2f}", wall_s),
                fmt::format("{:.2f}", cpu_s),
                fmt::format("{:.0f}", peak_memory_mib())};
    }
};

struct Judge {
    std::vector<float> truth; ///< NaN where a point is not compared

    template <class Compute>
    MeasuredCloud measured(Compute&& compute) const {
        const Stopwatch stopwatch;
        const std::clock_t cpu = std::clock();
        const std::vector<float> values = compute();
        const double wall_s = stopwatch.seconds();
        const double cpu_s = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
        cv::Mat1f ours(1, static_cast<int>(values.size())), exact(ours.size());
        std::copy(values.begin(), values.end(), ours.begin());
        std::copy(truth.begin(), truth.end(), exact.begin());
        const Difference d = compare(ours, exact);
        return {d, wall_s, cpu_s};
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

/// How many normals face the wrong side: of all, and of those with a confidence above 0.8. Points without a normal, or
/// with one more than 60 degrees from the true plane, do not count.
struct Sides {
    double wrong = 0, wrong_where_sure = 0, sure = 0; ///< shares
    double median_deg = 0, most_deg = 0;              ///< angles to the true plane; 95 % are smaller
};
Sides sides_of(const PointVisibility& found, const std::vector<Vector3d>& exact) {
    const std::vector<float> confidence = confidence_of_points(found.error);
    double all = 0, away = 0, sure = 0, sure_away = 0;
    std::vector<double> angles;
    for (std::size_t i = 0; i < exact.size(); ++i) {
        const double cosine = found.normals[i].cast<double>().dot(exact[i]);
        if (found.normals[i].isZero() || exact[i].isZero())
            continue;
        angles.push_back(std::acos(std::min(std::abs(cosine), 1.0)) * 180 / std::numbers::pi);
        if (std::abs(cosine) < 0.5)
            continue;
        const bool is_sure = confidence[i] > 0.8F;
        all += 1;
        away += cosine < 0;
        sure += is_sure;
        sure_away += is_sure && cosine < 0;
    }
    return {away / std::max(all, 1.0), sure_away / std::max(sure, 1.0), sure / std::max(all, 1.0),
            quantile(angles, 0.5), quantile(angles, 0.95)};
}

/// The normals that a cloud comes with: "recorded" ones are true, "noisy" ones tilted by 15 degrees (median), "random"
/// ones turned over by chance.
std::vector<Vector3d> given_normals(const std::string& kind, const std::vector<Vector3d>& exact) {
    if (kind == "none")
        return {};
    if (kind != "recorded" && kind != "random" && kind != "noisy")
        throw Misuse(fmt::format("--normals: '{}' given, expected recorded, noisy, none or random", kind));
    std::vector<Vector3d> given = exact;
    const Noise noise(1, 0, 77);
    for (std::size_t i = 0; i < given.size(); ++i) {
        const int k = static_cast<int>(i);
        if (kind == "random" && noise.uniform(k, 0) < 0.5)
            given[i] = -given[i];
        if (kind == "noisy" && !given[i].isZero()) // tan 15 degrees = 0.27 = 1.18 sigma
            given[i] = (given[i] + 0.23 * Vector3d(noise.gaussian(k, 1), noise.gaussian(k, 2), noise.gaussian(k, 3)))
                           .normalized();
    }
    return given;
}

class CloudErrors final : public Part {
    std::vector<Parameter> rows() override {
        std::vector<Parameter> all{
            {"scene", "which scenes, with commas; empty = office, or outdoor for the sky", &scenes_},
            {"points", "how many points", &points_, "", 1, 1e9},
            {"rays", "rays per point, with commas; 0 = as run chooses", &rays_},
            {"smooth", "how often values become means of neighbours; -1 = by the spacing", &smooth_, "", -1, 16},
            {"normals", "any of recorded,noisy,none,random (random signs): what the points come with", &normals_},
            {"noises", "sigmas of the points along their normals, with commas", &noises_, "m"},
            {"strays", "adds this share of stray points: half of them near, half up to 10^8 m away", &strays_, "", 0,
             0.5},
            {"gpu", "computes on the Vulkan device instead of the processor", &gpu_},
            {"raycast", "measures the method raycast with 64 rays, too", &raycast_},
            {"sky", "measures the share of the sky instead, also by depth images", &sky_},
            {"raster", "sizes of these images, pixels a side, with commas", &rasters_}};
        for (Parameter& row : scanner_.parameters())
            if (row.name != "noise")
                all.push_back(std::move(row));
        return all;
    }

    int measure(const std::string& choice) override {
        if (gpu_)
            device_ = std::make_unique<gpu::Device>(choice);
        for (const std::string& name : comma_separated(!scenes_.empty() ? scenes_ : sky_ ? "outdoor" : "office"))
            measure(scene::World(scene::scene_named(name)));
        if (squares_.size() > 1) {
            Table table({"over all scenes", "scenes", "RMSE"});
            for (const auto& [name, squares] : squares_)
                table.row({name, fmt::format("{}", squares.size()),
                           fmt::format("{:.4f}", std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.0) /
                                                           static_cast<double>(squares.size())))});
        }
        return all_well;
    }

    void measure(const scene::World& world) {
        const std::vector<int> rasters = whole_numbers("raster", rasters_, 1);
        const auto points = static_cast<std::size_t>(points_);
        const double radius = world.scene().ao_radius_m;
        std::optional<Judge> judge; // noise does not change what is true
        std::optional<Table> table;
        for (const double noise : numbers("noises", noises_, 0)) {
            scanner_.noise_m = noise;
            const auto cloud = scene::scanned_cloud(world, points, scanner_);
            const std::size_t step = std::max<std::size_t>(1, cloud.points.size() / 50000);
            if (!judge) {
                fmt::print("\n{}: {} points, radius {} m; every {}. point is compared\n", world.scene().name,
                           cloud.points.size(), sky_ ? 0 : radius, step);
                judge = Judge{sky_ ? true_sky(world, cloud, step)
                                   : scene::true_visibility(world, cloud, {radius, 1024, 1, false}, step)};
                table.emplace(std::vector<std::string>{"noise, normals, rays", "RMSE", "bias", "correlation", "95 %",
                                                       "wall s", "CPU s", "peak MiB", "normals off, degrees", "95 %",
                                                       "wrong sides, %", "sure points, %", "of them wrong, %",
                                                       "changed by strays, RMS", "stages, ms", "notes"});
            }
            double spacing = 0;
            for (const std::string& kind : comma_separated(normals_))
                for (const int rays : whole_numbers("rays", rays_, 0))
                    spacing = row(*table, cloud, *judge, radius, noise, kind, rays);
            if (sky_)
                for (const int raster : rasters)
                    table->row(judge->measured([&] { return sky_by_views(cloud, spacing, 256, raster); })
                                   .cells(fmt::format("256 views of {0}x{0}", raster)));
            if (raycast_)
                table->row(judge
                               ->measured([&] {
                                   return Raycast({.radius_m = radius, .rays = 64})
                                       .compute({cloud.points, cloud.normals})
                                       .visibility;
                               })
                               .cells("raycast, 64 rays"));
        }
    }

    /// Returns the spacing.
    double row(Table& table, const scene::SceneCloud& cloud, const Judge& judge, double radius, double noise,
               const std::string& kind, int rays) {
        std::vector<Vector3d> points = cloud.points, normals = given_normals(kind, cloud.normals);
        add_strays(points, normals, kind != "none");
        const std::string name = fmt::format("{:g} mm, {}, {} rays", 1000 * noise, kind, rays);
        const CloudAoOptions options{.radius = radius, .rays = rays, .smooth = smooth_, .sky = sky_};
        PointVisibility found;
        const MeasuredCloud measured = judge.measured([&] {
            found = CloudAo(options, device_.get()).compute({points, normals});
            return std::vector<float>(found.visibility.begin(),
                                      found.visibility.begin() + static_cast<std::ptrdiff_t>(cloud.points.size()));
        });
        const auto same =
            std::find_if(squares_.begin(), squares_.end(), [&](const auto& r) { return r.first == name; });
        auto& squares =
            same != squares_.end() ? same->second : squares_.emplace_back(name, std::vector<double>()).second;
        squares.push_back(measured.difference.rms * measured.difference.rms);
        std::string stages;
        for (const auto& [stage, ms] : found.timings)
            stages += fmt::format("{}{} {:.0f}", stages.empty() ? "" : ", ", stage, ms);
        const Sides sides = sides_of(found, cloud.normals);
        std::vector<std::string> cells = measured.cells(name);
        for (const std::string& cell :
             {fmt::format("{:.1f}", sides.median_deg), fmt::format("{:.1f}", sides.most_deg),
              fmt::format("{:.2f}", 100 * sides.wrong), fmt::format("{:.0f}", 100 * sides.sure),
              fmt::format("{:.2f}", 100 * sides.wrong_where_sure),
              strays_ > 0
                  ? fmt::format("{:.4f}", changed_by_strays(found, options, cloud.points.size(), {points, normals}))
                  : std::string(),
              stages, fmt::format("{}", fmt::join(found.notes, " "))})
            cells.push_back(cell);
        table.row(std::move(cells));
        return found.spacing;
    }

    /// Half of them within three times the box of the points, half farther: 10 to 10^8 m off. All behind the others.
    void add_strays(std::vector<Vector3d>& points, std::vector<Vector3d>& normals, bool with_normals) const {
        const Noise noise(3, 0, 99);
        Eigen::AlignedBox3d box;
        for (const Vector3d& point : points)
            box.extend(point);
        const auto count = static_cast<int>(strays_ * static_cast<double>(points.size()));
        for (int i = 0; i < count; ++i) {
            const Vector3d towards =
                Vector3d(noise.gaussian(i, 0), noise.gaussian(i, 1), noise.gaussian(i, 2)).normalized();
            const Vector3d share(noise.uniform(i, 3), noise.uniform(i, 4), noise.uniform(i, 5));
            points.push_back(i % 2 ? Vector3d(std::pow(10.0, 1 + 7 * noise.uniform(i, 3)) * towards)
                                   : Vector3d(box.center() +
                                              3 * (share.array() - 0.5).matrix().cwiseProduct(Vector3d(box.sizes()))));
            if (with_normals)
                normals.push_back(towards);
        }
    }

    /// By how much they change the other points' values, RMS.
    double changed_by_strays(const PointVisibility& found, const CloudAoOptions& options, std::size_t others,
                             const PointSet& set) {
        const PointVisibility without =
            CloudAo(options, device_.get())
                .compute({set.points.first(others), set.normals.empty() ? set.normals : set.normals.first(others)});
        double sum = 0;
        for (std::size_t i = 0; i < others; ++i)
            if (const double off = static_cast<double>(found.visibility[i] - without.visibility[i]); !std::isnan(off))
                sum += off * off;
        return std::sqrt(sum / static_cast<double>(others));
    }

    std::string scenes_, rays_ = "8,16,32", rasters_ = "512,1024,2048", normals_ = "recorded", noises_ = "0";
    int points_ = 1000000, smooth_ = -1;
    double strays_ = 0;
    bool gpu_ = false, raycast_ = false, sky_ = false;
    scene::ScannerOptions scanner_;
    std::unique_ptr<gpu::Device> device_;
    std::vector<std::pair<std::string, std::vector<double>>> squares_; ///< of RMSEs, by row
};

} // namespace

std::unique_ptr<Command> clouds_part() { return std::make_unique<CloudErrors>(); }

} // namespace scanshade::bench
