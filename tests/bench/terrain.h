// Generated terrain that is known between cells, too: for errors of relief.
#pragma once

#include <cstdint>
#include <Eigen/Core>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace scanshade::bench {

/// Height in metres at a place in metres.
using Terrain = std::function<double(double x, double y)>;

/// hills, rough, mounds, town, terraces; dunes, gullies, quarry.
[[nodiscard]] const std::vector<std::string>& terrain_names();
/// Throws Misuse for other names.
[[nodiscard]] Terrain terrain_named(const std::string& name, unsigned seed);

/// Heights at the centres of cells; the first one's corner is at 0, 0, rows go to the south.
[[nodiscard]] cv::Mat1f heights_of(const Terrain& terrain, int cells, double cell_m);

/// Sky view of cells by rays on cells of a fifth of their side, 64 directions. The terrain goes on beyond.
[[nodiscard]] cv::Mat1f true_view(const Terrain& terrain, int cells, double cell_m, double radius_m);

/// Points of a scan from above: evenly spread at random, with noise; none within `gaps` (x, y, radius).
[[nodiscard]] std::vector<Eigen::Vector3d> scan_of(const Terrain& terrain, double side_m, double density,
                                                   double sigma_m, const std::vector<Eigen::Vector3d>& gaps,
                                                   unsigned seed);

/// Discs at random, radii 1 m to `most_m`.
[[nodiscard]] std::vector<Eigen::Vector3d> discs_of(double side_m, int count, double most_m, unsigned seed);

} // namespace scanshade::bench
