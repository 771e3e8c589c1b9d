// cloud_bench: visibility of a scene's points, from the points alone, against rays on the scene itself: error, time, memory.
//   cloud_bench [--scene office] [--points 1000000] [--rays 16,32,64] [--no-normals]
#include "ao/cloud/cloud_ao.h"
#include "ao/compare.h"
#include "ao/raycast/raycast.h"
#include "apps/scene_cloud.h"

#include <chrono>
#include <ctime>
#include <fstream>
#include <CLI/CLI.hpp>
#include <fmt/format.h>

using namespace scanshade;

int main(int argc, char** argv) {
    std::string scene = "office";
    std::size_t points = 1000000;
    std::vector<int> rays{16, 32, 64};
    std::vector<int> smooth{0, 1, 2};
    bool no_normals = false, old = false;
    CLI::App parser;
    parser.add_option("--scene", scene);
    parser.add_option("--points", points);
    parser.add_option("--rays", rays)->delimiter(',');
    parser.add_option("--smooth", smooth)->delimiter(',');
    parser.add_flag("--no-normals", no_normals);
    parser.add_flag("--old", old);
    CLI11_PARSE(parser, argc, argv);
    const scene::World world(scene::scene_named(scene));
    const auto cloud = scene::scene_cloud(world, points);
    const std::size_t step = std::max<std::size_t>(1, points / 50000);
    const double radius = world.scene().ao_radius_m;
    const auto truth = scene::true_visibility(world, cloud, {radius, 1024, 1, false}, step);
    const auto tell = [&](const std::string& name, const std::vector<float>& values, double s) {
        cv::Mat1f a(1, static_cast<int>(values.size())), b(a.size());
        for (int i = 0; i < a.cols; ++i) a(0, i) = values[i], b(0, i) = truth[i];
        const Difference d = compare(a, b);
        fmt::print("{:<24} rmse {:.4f} bias {:+.4f} corr {:.4f} p95 {:.3f}  {:.2f} s  n {}\n", name, d.rms, d.bias, d.correlation, d.percentile_95, s, d.pixels);
    };
    const auto now = [] { return std::chrono::steady_clock::now(); };
    const PointSet set{cloud.points, no_normals ? std::span<const Eigen::Vector3d>() : cloud.normals};
    for (const int r : rays)
        for (const int s : smooth) {
            CloudAoOptions options;
            options.radius = radius, options.rays = r, options.smooth = s;
            const auto start = now();
            const auto cpu = std::clock();
            const auto out = CloudAo(options).compute(set);
            tell(fmt::format("rays {} smooth {}", r, s), out.visibility, std::chrono::duration<double>(now() - start).count());
            fmt::print("   CPU {:.2f} s ", static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC);
            if (getenv("DUMP")) { std::ofstream f(getenv("DUMP")); for (std::size_t i = 0; i < truth.size(); i += step) f << cloud.points[i].transpose() << " " << cloud.normals[i].transpose() << " " << truth[i] << " " << out.visibility[i] << "\n"; }
            if (no_normals) for (auto& n : out.notes) fmt::print("{} ", n);
            for (const auto& [name, ms] : out.timings) fmt::print("   {} {:.0f}", name, ms);
            fmt::print("\n");
        }
    if (old) {
        const auto start = now();
        const auto out = Raycast(RaycastOptions{.radius_m = radius, .rays = 64}).compute(set);
        tell("raycast 64", out, std::chrono::duration<double>(now() - start).count());
    }
}
