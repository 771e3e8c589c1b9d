// Sky view of generated terrain: its errors, expected and found.
#pragma once

#include "ao/horizon/horizon.h"
#include "tests/bench/terrain.h"

#include <vector>

namespace scanshade::bench {

/// How heights come to be.
struct HeightSource {
    const char* name;
    double cell_m = 0.5, radius_cells = 10;
    double sigma_m = 0;  ///< of heights or points
    double density = 0;  ///< points a square metre; 0 = a raster
    int missing = 0;     ///< discs of a raster without data
    int gaps = 0;        ///< discs without points
    double rounding = 0; ///< of a raster's heights, metres
    int directions = 32;
    horizon::Profile profile = horizon::Profile::exact;
    bool classified = true;
};

/// A cell's error, expected and found.
struct ErrorPair {
    float expected, found;
};

/// Of all cells of a square that have a value. `truth`: true_view() of as many cells; other sources of the same cells
/// and radius may share it.
[[nodiscard]] std::vector<ErrorPair> errors_of(const HeightSource& source, const Terrain& terrain, unsigned seed,
                                               const cv::Mat1f& truth);

/// RMS found over RMS expected.
[[nodiscard]] double ratio_of(const std::vector<ErrorPair>& pairs);

} // namespace scanshade::bench
