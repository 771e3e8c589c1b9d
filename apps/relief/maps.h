// Heights with a place on the map -> layers as files, named and stretched as the Relief Visualization Toolbox does.
#pragma once

#include "ao/horizon/horizon.h"
#include "apps/relief/surface.h"
#include "io/rasters/raster.h"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace scanshade::relief {

/// In metres, whatever the unit of a raster; radius 0 = 10 cells.
struct MapSettings {
    horizon::Settings walk;
    std::vector<std::string> write{"svf"}; ///< names of map_names()
    bool bytes = false;                    ///< each also with 8 bits, stretched
    bool svfs = false;                     ///< svfs.zip, too
    double height_noise_m = 0;             ///< standard deviation of heights, for `error`; of surveys it is measured
};

/// What `write` may hold: svf, asvf, openness, openness-neg, dominance, ao, error, dtm, source.
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

/// What maps are made of.
struct Heights {
    rasters::RasterReader& rows;
    SurfaceReader* surface = nullptr; ///< the same, where it is the surface of points
};

/// A map of `write` and its values: floats, `source` bytes.
struct NamedMap {
    std::string name;
    cv::Mat values;
};
using Maps = std::vector<NamedMap>;

/// Rows of one map from `first` on.
using TakeRows = std::function<void(const std::string& layer, int first, const cv::Mat& rows)>;

/// All maps, and views of svfs_views() by their names in front of ".tif", by bands of rows from the north; memory grows
/// with the width of the raster alone. Values do not depend on `band_rows`. Returns how many cells have a height, and
/// adds what is doubtful about heights to the reader's notes. Throws Error, Misuse.
std::int64_t compute_maps(const Heights& heights, const MapSettings& settings, const TakeRows& take,
                          int band_rows = 512);

/// The same as whole arrays.
[[nodiscard]] Maps maps_of(const Heights& heights, const MapSettings& settings);

struct Written {
    std::vector<std::filesystem::path> files;
    std::int64_t known = 0; ///< cells with a height
};

/// Computes and writes all maps, and keeps them where `kept` is not null. Throws Error, Misuse, Outage.
Written write_maps(const std::string& name, const Heights& heights, const MapSettings& settings,
                   const std::filesystem::path& folder, Maps* kept = nullptr);

} // namespace scanshade::relief
