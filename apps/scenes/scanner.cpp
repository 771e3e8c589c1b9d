// A simulated laser scanner: a grid of beams from each station, then noise, mixed pixels and misalignment.
#include "apps/scenes/scanner.h"

#include "apps/scenes/world/random_noise.h"

#include <cmath>
#include <numbers>
#include <tbb/parallel_for.h>

namespace scanshade::scene {
namespace {

using Eigen::Vector3d;
enum Purpose : std::uint32_t { shift = 101, turn, across, along, beam_turn, beam_share };

/// Beams of equal angles; half a step of jitter, so that no pattern is common to all stations.
struct Grid {
    double lowest, highest;
    int rows, columns;

    Grid(double beams, int rings)
        : lowest((rings > 0 ? -25 : -70) * std::numbers::pi / 180),
          highest((rings > 0 ? 15 : 90) * std::numbers::pi / 180),
          rows(rings > 0
                   ? rings
                   : std::max(1, static_cast<int>(std::sqrt(beams * (highest - lowest) / (2 * std::numbers::pi))))),
          columns(std::max(1, static_cast<int>(beams / rows))) {}

    [[nodiscard]] Vector3d direction(int column, int row) const {
        const double turned = 2 * std::numbers::pi * column / columns,
                     raised = lowest + (highest - lowest) * (row + 0.5) / rows;
        return {std::cos(raised) * std::cos(turned), std::cos(raised) * std::sin(turned), std::sin(raised)};
    }
};

Hit first_surface(const World& world, const Vector3d& eye, const Vector3d& direction) {
    const Hit hit = world.cast({eye, direction});
    return hit.body && hit.t <= world.scene().far_m ? hit : Hit{};
}

/// The share of all beams that meet a surface.
double share_met(const World& world, const std::vector<Vector3d>& eyes, int rings) {
    const Grid grid(4000, rings);
    std::size_t met = 0, all = 0;
    for (const Vector3d& eye : eyes)
        for (int row = 0; row < grid.rows; ++row)
            for (int column = 0; column < grid.columns; ++column, ++all)
                met += first_surface(world, eye, grid.direction(column, row)).body != nullptr;
    return std::max(static_cast<double>(met) / static_cast<double>(all), 1e-3);
}

/// What one beam records.
struct Record {
    Vector3d at, surface, normal; ///< with noise; exact; zero where the range is of no surface
    bool met = false;
};

Record record(const World& world, const Vector3d& eye, const Vector3d& direction, const ScannerOptions& options,
              int seed, int station, int column, int row) {
    const Hit hit = first_surface(world, eye, direction);
    if (!hit.body)
        return {};
    const auto noise = [&](Purpose purpose) { return Noise(seed, station, purpose); };
    Record made{eye + hit.t * direction, eye + hit.t * direction, hit.normal, true};
    if (options.beam_rad > 0) { // the beam's other half
        const double angle = 2 * std::numbers::pi * noise(beam_turn).uniform(column, row);
        const Vector3d x = direction.unitOrthogonal(), y = direction.cross(x);
        const Vector3d beside =
            (direction + options.beam_rad / 2 * (std::cos(angle) * x + std::sin(angle) * y)).normalized();
        const Hit other = first_surface(world, eye, beside);
        // Nearer together than this, a scanner's pulses merge into one range; farther apart, they are two echoes.
        constexpr double merged_from = 0.02, merged_to = 1;
        if (const double gap = std::abs(other.t - hit.t);
            other.body && gap > merged_from && gap < merged_to &&
            std::abs(hit.normal.dot(made.at - eye - other.t * beside)) > merged_from) {
            const double share = noise(beam_share).uniform(column, row);
            made.at = eye + (hit.t + share * (other.t - hit.t)) * direction;
            made.surface = made.at;
            made.normal.setZero();
        }
    }
    made.at += options.noise_m * noise(across).gaussian(column, row) * made.normal;
    made.at += options.noise_per_m * hit.t * noise(along).gaussian(column, row) * direction;
    return made;
}

/// By how much the registration of a station is off.
Eigen::Isometry3d misalignment(const ScannerOptions& options, const Vector3d& eye, int seed, int station) {
    constexpr double matched_at_m = 5;
    const auto draw = [&](Purpose purpose) {
        const Noise noise(seed, station, purpose);
        return Vector3d(noise.gaussian(0, 0), noise.gaussian(1, 0), noise.gaussian(2, 0));
    };
    const Vector3d turned = options.misaligned_m / matched_at_m * draw(turn);
    Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
    moved.translate(eye + options.misaligned_m * draw(shift));
    moved.rotate(Eigen::AngleAxisd(turned.norm(), turned.stableNormalized()));
    moved.translate(-eye);
    return moved;
}

} // namespace

std::vector<Parameter> ScannerOptions::parameters() {
    return {
        {.name = "rings",
         .help = "lasers of a spinning lidar at each station, between 25 degrees down and 15 up; 0 = equal angles",
         .value = &rings,
         .low = 0,
         .high = 1000},
        {.name = "stations",
         .help = "places on the scene's walk that a simulated scanner stands at; 0 = points of equal density",
         .value = &stations,
         .low = 0,
         .high = 1000},
        {.name = "noise",
         .help = "sigma of the points along their surface's normal",
         .value = &noise_m,
         .unit = "m",
         .low = 0,
         .high = 1},
        {.name = "range-noise",
         .help = "sigma of the range along the beam, for each metre of range",
         .value = &noise_per_m,
         .unit = "m",
         .low = 0,
         .high = 1},
        {.name = "beam",
         .help = "width of the scanner's beam: at edges it records points between two surfaces",
         .value = &beam_rad,
         .unit = "radians",
         .low = 0,
         .high = 0.1},
        {.name = "misaligned",
         .help = "sigma of the stations' or frames' shifts along each axis",
         .value = &misaligned_m,
         .unit = "m",
         .low = 0,
         .high = 1},
    };
}

SceneCloud scanned_cloud(const World& world, std::size_t count, const ScannerOptions& options, int seed) {
    SceneCloud cloud;
    if (options.stations == 0) {
        cloud = scene_cloud(world, count, seed);
        cloud.surface = cloud.points;
        const Noise noise(seed, 0, across);
        for (std::size_t i = 0; i < cloud.points.size(); ++i)
            cloud.points[i] += options.noise_m * noise.gaussian(static_cast<int>(i), 0) * cloud.normals[i];
        return cloud;
    }
    const Walk& walk = world.scene().walk;
    for (int i = 0; i < options.stations; ++i)
        cloud.stations.push_back(world_from_camera(walk, walk.period_s * i / options.stations).translation());
    const Grid grid(static_cast<double>(count) / options.stations / share_met(world, cloud.stations, options.rings),
                    options.rings);
    std::vector<Record> records(static_cast<std::size_t>(grid.rows) * static_cast<std::size_t>(grid.columns));
    for (int station = 0; station < options.stations; ++station) {
        const Vector3d& eye = cloud.stations[static_cast<std::size_t>(station)];
        const Eigen::Isometry3d moved = misalignment(options, eye, seed, station);
        tbb::parallel_for(0, grid.columns, [&](int column) {
            for (int row = 0; row < grid.rows; ++row)
                records[static_cast<std::size_t>(column) * static_cast<std::size_t>(grid.rows) +
                        static_cast<std::size_t>(row)] =
                    record(world, eye, grid.direction(column, row), options, seed, station, column, row);
        });
        cloud.starts.push_back(cloud.points.size());
        for (const Record& made : records)
            if (made.met) {
                cloud.points.push_back(moved * made.at);
                cloud.surface.push_back(made.surface);
                cloud.normals.push_back(made.normal);
            }
    }
    return cloud;
}

} // namespace scanshade::scene
