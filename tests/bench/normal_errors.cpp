#include "tests/bench/normal_errors.h"

#include "ao/fit_plane/fit_plane.h"
#include "ao/gpu/transfer.h"
#include "ao/screen/screen.h"
#include "apps/compare/error_classes.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/sensor.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

/// The limits in tests and READMEs are of these.
constexpr std::array measured_scenes{"office", "staircase", "columns", "clutter", "outdoor", "thin"};

const Pinhole camera{525, 525, 319.5, 239.5, {640, 480}};

struct Sighted {
    scene::Geometry exact;
    DepthImage recorded;
};

/// Two views of the scene, far apart on its walk.
std::vector<Sighted> views_of(const scene::Scene& scene, const Sensor& sensor) {
    const scene::World world(scene);
    std::vector<Sighted> views;
    for (const int frame : {20, 87}) {
        const Eigen::Isometry3d pose = scene::world_from_camera(scene.walk, 0.1 * frame);
        Sight sight{world, camera, pose, render_geometry(world, camera, pose), 1, frame};
        views.push_back({sight.exact, {camera, sensor.record(sight), {}}});
    }
    return views;
}

/// The normals of clean depth, by the pass `normals`.
FittedDepth from_depth(gpu::Device& device, const DepthImage& depth) {
    using Host = gpu::BufferRow::Host;
    const std::size_t pixels = depth.z_m.total();
    ScreenTables tables{{{}, depth.z_m.size()},
                        depth.z_m.size(),
                        0,
                        {{"depth", pixels * 4, Host::upload, gpu::BufferRow::Texels::r32f},
                         {"surfaces", pixels * 16, Host::download, gpu::BufferRow::Texels::rgba32f}},
                        {}};
    tables.add_pass("normals", "normals", {0, 0}, {1}, {{shared::spec_supplied, 0}});
    const shared::ScreenConstants constants = constants_from(ScreenOptions{}, {depth});
    const std::unique_ptr<gpu::Program> program = tables.program(device, sizeof constants);
    gpu::upload_depth(depth.z_m, program->host_as<float>(0));
    program->run(bytes_of(constants));
    FittedDepth found{depth, {cv::Mat3f(depth.z_m.size())}};
    const auto surfaces = program->host_as<cv::Vec4f>(1);
    std::transform(surfaces.begin(), surfaces.end(), found.normals.normals.begin(),
                   [](const cv::Vec4f& s) { return cv::Vec3f(s[0], s[1], s[2]); });
    return found;
}

/// Whether depth jumps here by more than noise does: 10 cm and 5 %.
bool jumps(const cv::Mat1f& z, int v, int u) {
    const float most = std::max(0.1F, 0.05F * z(v, u));
    for (const auto& [y, x] : {std::pair{v, u - 1}, {v, u + 1}, {v - 1, u}, {v + 1, u}})
        if (y >= 0 && x >= 0 && y < z.rows && x < z.cols && std::abs(z(y, x) - z(v, u)) > most)
            return true;
    return false;
}

struct Figures {
    std::vector<double> degrees, near_degrees; // of all pixels with a normal; of those at 1 .. 3 m
    double depths = 0, edges = 0, kept = 0;    // pixels with recorded depth; at true edges; of those, near a found one
};

void add(Figures& figures, const Sighted& view, const FittedDepth& found) {
    const cv::Mat1f& z = view.exact.z_m;
    const cv::Mat1b true_edge = by_edge_distance(z).of, found_edge = by_edge_distance(found.depth.z_m).of;
    cv::Mat1b surrounded;
    cv::erode(found.depth.z_m > 0, surrounded, cv::Mat(), {-1, -1}, 2);
    for (int v = 0; v < z.rows; ++v)
        for (int u = 0; u < z.cols; ++u) {
            if (!(view.recorded.z_m(v, u) > 0 && z(v, u) > 0))
                continue;
            ++figures.depths;
            const cv::Vec3f normal = found.normals.normals(v, u);
            if (cv::norm(normal) > 0.5) {
                const double degrees =
                    std::acos(std::clamp(normal.dot(view.exact.normals(v, u)), -1.0F, 1.0F)) * 180 / std::numbers::pi;
                figures.degrees.push_back(degrees);
                if (z(v, u) >= 1 && z(v, u) <= 3)
                    figures.near_degrees.push_back(degrees);
            }
            if (true_edge(v, u) != 0 || !jumps(z, v, u) || !surrounded(v, u))
                continue;
            ++figures.edges;
            figures.kept += found_edge(v, u) <= 1; // a distance of 0, or of 1 and diagonally
        }
}

} // namespace

const std::vector<NormalCase>& normal_cases() {
    constexpr double no_aim = 180;
    const double cacao = method_named("cacao").smoothing;
    static const std::vector<NormalCase> cases{{"ideal", "ideal", 1, 1},
                                               {"kinect", "kinect", 1, no_aim},
                                               {"kinect, CACAO's windows", "kinect", cacao, 5},
                                               {"tof", "tof", 1, no_aim},
                                               {"tof, CACAO's windows", "tof", cacao, 5}};
    return cases;
}

NormalErrors normal_errors(gpu::Device& device, const NormalCase& which) {
    const Sensor& sensor = sensor_named(which.sensor);
    Figures figures;
    for (const char* name : measured_scenes) {
        const scene::Scene& scene = scene::scene_named(name);
        const std::vector<Sighted> views = views_of(scene, sensor);
        std::vector<DepthImage> images;
        for (const Sighted& view : views)
            images.push_back(view.recorded);
        const DepthNoise noise = measure_noise(images);
        std::optional<FitPlane> fit;
        if (noise.any())
            fit.emplace(device, noise, FitPlaneOptions{.smoothing = which.smoothing});
        for (const Sighted& view : views)
            add(figures, view, fit ? fit->compute(view.recorded) : from_depth(device, view.recorded));
    }
    const auto angles = [](std::vector<double>& degrees) {
        return NormalErrors::Angles{quantile(degrees, 0.5), quantile(degrees, 0.95)};
    };
    return {static_cast<double>(figures.degrees.size()) / figures.depths, angles(figures.degrees),
            angles(figures.near_degrees), figures.kept / figures.edges};
}

} // namespace scanshade
