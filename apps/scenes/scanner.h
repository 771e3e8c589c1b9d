// A simulated laser scanner: a scene as terrestrial scans record it, with the faults that real ones have.
#pragma once

#include "apps/scenes/scene_cloud.h"
#include "projection/base/parameters.h"

namespace scanshade::scene {

/// How a cloud of a scene is recorded. All zero: points of equal density, exact.
struct ScannerOptions {
    int stations = 0;        ///< places on the scene's walk that it is scanned from; 0 = points of equal density
    int rings = 0;           ///< lasers of a spinning lidar, 25 degrees down to 15 up; 0 = a grid of equal angles
    double noise_m = 0;      ///< sigma of points along their surface's normal
    double noise_per_m = 0;  ///< sigma of the range along the beam, for each metre of range
    double beam_rad = 0;     ///< full width of the beam: where it meets two surfaces, the range lies between them
    double misaligned_m = 0; ///< sigma of each station's shift along each axis; it is turned to match, at 5 m

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// About `count` points, all stations in turn. Each beam of a grid of equal angles meets its first surface. Stations
/// see from nadir + 20 degrees to the zenith, up to the scene's far_m; spinning lidars, rings. The same seed gives the
/// same points.
[[nodiscard]] SceneCloud scanned_cloud(const World& world, std::size_t count, const ScannerOptions& options,
                                       int seed = 1);

} // namespace scanshade::scene
