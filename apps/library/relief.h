// Maps of heights for the functions of the C interface: the walk of apps/relief, without its files.
#pragma once

#include "apps/library/settings.h"
#include "apps/relief/maps.h"

#include <string>

namespace scanshade::library {

/// Rows of the caller's floats, from north to south. Not finite, or beyond 1e30: no data.
struct HeightArray {
    const void* values = nullptr;
    bool doubles = false;
    cv::Size size;
    std::int64_t row_bytes = 0;
    double cell_m = 1;
};

struct ReliefMaps {
    relief::Maps maps; ///< floats
    std::string info;  ///< as scanshade_relief_info() has it
};

/// Throws Misuse for settings and arrays that are impossible.
[[nodiscard]] ReliefMaps relief_of(const HeightArray& heights, const Settings& given);
/// Of a GeoTIFF or .vrt; throws Error naming it, too.
[[nodiscard]] ReliefMaps relief_of(const std::string& file, const Settings& given);

} // namespace scanshade::library
