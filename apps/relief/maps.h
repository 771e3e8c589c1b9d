// Heights with a place on the map -> layers as files, named and stretched as the Relief Visualization Toolbox does.
#pragma once

#include "ao/horizon/horizon.h"
#include "io/rasters/raster.h"

#include <filesystem>
#include <string>
#include <vector>

namespace scanshade::relief {

/// In metres, whatever the unit of a raster; radius 0 = 10 cells.
struct MapSettings {
    horizon::Settings walk;
    std::vector<std::string> write{"svf"}; ///< names of map_names()
    bool bytes = false;                    ///< each also with 8 bits, stretched
};

/// What `write` may hold: svf, asvf, openness, openness-neg, dominance, ao, dtm, source.
[[nodiscard]] const std::vector<std::string>& map_names();

/// The settings in the raster's own unit: distances divided by that of the plane, heights brought to it by the
/// exaggeration.
[[nodiscard]] horizon::Settings in_units_of(const rasters::Grid& grid, const horizon::Settings& settings);

/// A file of a layer: "dem_SVF_R10_D16_NRlow.tif". `name` is a file's name up to its first dot.
[[nodiscard]] std::string map_file_name(const std::string& name, const std::string& layer,
                                        const horizon::Settings& settings, double radius_cells, bool bytes);

/// As the toolbox stretches a layer: floor(255.9999 share), openness upside down inverted; NaN becomes 255.
[[nodiscard]] cv::Mat1b stretched(const cv::Mat1f& values, const std::string& layer);

/// The files that would be written.
[[nodiscard]] std::vector<std::filesystem::path> map_files(const std::string& name, const rasters::Grid& grid,
                                                           const MapSettings& settings,
                                                           const std::filesystem::path& folder);

/// Computes and writes all layers; returns the files. `source` may be empty where the input is a raster. Throws Error,
/// Misuse, Outage.
std::vector<std::filesystem::path> write_maps(const std::string& name, const rasters::Raster& raster,
                                              const cv::Mat1b& source, const MapSettings& settings,
                                              const std::filesystem::path& folder);

} // namespace scanshade::relief
