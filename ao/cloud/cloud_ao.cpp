// Visibility of every point of a cloud: which way it goes, at once, in tiles, or against the faces of a mesh.
#include "ao/cloud/cloud_ao.h"

#include "ao/cloud/cloud_work.h"
#include "ao/cloud/large_cloud.h"
#include "ao/cloud/sides/recorded_stations.h"
#include "ao/cloud/splat_ao.h"
#include "ao/gpu/device.h"
#include "ao/raycast/raycast.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace scanshade {

using Eigen::Vector3d;

double default_radius(double extent, double spacing) {
    return std::clamp(extent / 20, 10 * spacing, std::max(200 * spacing, 0.0));
}

PointVisibility CloudAo::compute(const PointSet& cloud, const std::optional<Vector3d>& scanner) {
    if (!cloud.triangles.empty() && !options_.sky)
        return of_mesh(cloud);
    if (!cloud.stations.empty() && cloud.seen_from.empty() && options_.outside == "auto" &&
        options_.normals != CloudNormals::recorded)
        return of_scans(cloud, scanner);
    const CloudSetup setup{options_, device_, up_, viewpoint_};
    if (!cloud.splats.empty())
        return visibility_of_splats(setup, cloud, scanner);
    if (!options_.sky && cloud.points.size() > points_at_once(setup))
        return in_tiles(setup, cloud, scanner);
    CloudWork work = CloudWork::of_cloud(setup, cloud, scanner);
    PointVisibility found = work.run();
    signs_ = work.take_signs();
    return found;
}

/// Each side to the station that recorded it, if the stations can be right. Recorded normals that face theirs stay.
PointVisibility CloudAo::of_scans(PointSet cloud, const std::optional<Vector3d>& scanner) {
    constexpr double hardly_opposed = 0.05, same_planes = 0.8;
    const Stopwatch stopwatch;
    const bool recorded = !cloud.normals.empty() && options_.normals != CloudNormals::estimated;
    const RecordedStations found =
        recorded_stations(cloud.stations, cloud.points, recorded ? cloud.normals : std::span<const Vector3d>());
    const double judged_ms = stopwatch.ms();
    const bool believed = !found.seen_from.empty(), on_planes = recorded && found.agreement >= same_planes;
    cloud.stations = {};
    if (!on_planes || found.opposed > hardly_opposed)
        cloud.seen_from = found.seen_from;
    PointVisibility result = compute(cloud, scanner);
    result.timings.insert(result.timings.begin(), {"stations", judged_ms});
    result.notes.push_back(found.note);
    constexpr double unlikely = 0.01; // that the opposite of the sides found is right
    for (Finding& finding : result.findings)
        if (found.contradict && finding.check == Check::sides && finding.value > unlikely && finding.sentence.empty())
            finding.sentence = found.note + " So they tell no sides; --cloud.outside sets them.";
    if (on_planes && believed)
        at_most(result.findings, Check::normals_to_station, found.opposed, hardly_opposed, [&] {
            return fmt::format("{:.0f} % of the recorded normals face away from the scanner that recorded them; they "
                               "were turned: --cloud.normals recorded keeps them.",
                               100 * found.opposed);
        });
    return result;
}

/// The sky is seen at any distance, past all tiles.
std::size_t CloudAo::most_at_once() const {
    return options_.sky ? std::numeric_limits<std::size_t>::max()
                        : points_at_once({options_, device_, up_, viewpoint_});
}

std::string CloudAo::fingerprint() const {
    CloudAoOptions options = options_;
    std::string all = device_ ? device_->info().name : "processor";
    for (const Parameter& row : options.parameters())
        all += fmt::format(" {}={}", row.name, value_text(row));
    return all;
}

PointVisibility CloudAo::compute_large(PointSource& source, TileStore& store, double shown,
                                       const std::function<bool()>& stop) {
    const CloudSetup setup{options_, device_, up_, viewpoint_};
    return scanshade::compute_large(setup, source, store, shown, stop);
}

/// Rays against the faces are exact: no mean over neighbours is needed, but more rays.
PointVisibility CloudAo::of_mesh(const PointSet& mesh) const {
    PointVisibility result;
    std::vector<float> edges;
    for (const auto& [a, b, c] : mesh.triangles)
        if (std::min({a, b, c}) >= 0)
            edges.push_back(static_cast<float>(
                (mesh.points[static_cast<std::size_t>(a)] - mesh.points[static_cast<std::size_t>(b)]).norm()));
    if (!edges.empty())
        result.spacing = static_cast<double>(median(std::move(edges)));
    const double extent = extent_of(sampled(mesh.points, finite(mesh.points), 60000)).size;
    result.radius =
        std::clamp(options_.radius > 0 ? options_.radius : default_radius(extent, result.spacing), 1e-6, 1e6);
    const int rays = options_.rays > 0 ? options_.rays : 64;
    Raycast raycast({.radius_m = result.radius, .rays = rays, .mesh = MeshRays::vertices, .seed = options_.seed});
    result.visibility = raycast.compute(mesh).visibility;
    result.timings = raycast.timings();
    ErrorSum sum;
    for (const float visibility : result.visibility) { // that of independent rays; a set of even ones errs less
        result.error.push_back(std::sqrt(visibility * (1 - visibility) / static_cast<float>(rays)));
        sum.add(result.error.back());
    }
    result.expected_error = sum.rms();
    result.notes = {
        fmt::format("{} faces: {} rays from every vertex against them, about the mean of their normals.",
                    mesh.triangles.size(), rays),
        fmt::format("radius {:.4g} ({}).", result.radius,
                    options_.radius > 0 ? "as given" : "a twentieth of the extent, within 10 .. 200 edge lengths")};
    return result;
}

} // namespace scanshade
