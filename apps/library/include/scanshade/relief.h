// Heights in, maps of sky view and openness out. Header-only, as scanshade/session.h.
#pragma once

#include <scanshade/session.h>

#include <map>

namespace scanshade {

namespace detail {
inline std::map<std::string, cv::Mat1f> relief(const scanshade_heights& heights, const Settings& settings,
                                               const std::vector<std::string>& maps) {
    Settings given = settings;
    std::string names;
    for (const std::string& map : maps)
        names += (names.empty() ? "" : ",") + map;
    given.emplace_back("write", names);
    const std::vector<scanshade_setting> all = to_c(given);
    scanshade_relief_maps* handle = nullptr;
    check(scanshade_relief(&heights, all.data(), all.size(), &handle));
    const std::unique_ptr<scanshade_relief_maps, void (*)(scanshade_relief_maps*)> owner(handle, scanshade_relief_free);
    std::map<std::string, cv::Mat1f> found;
    cv::Size size;
    check(scanshade_relief_size(handle, &size.width, &size.height));
    for (const std::string& map : maps)
        if (const float* values = scanshade_relief_map(handle, map.c_str()))
            found[map] = cv::Mat1f(size.height, size.width, const_cast<float*>(values)).clone();
    return found;
}
} // namespace detail

/// Maps by name (svf, asvf, openness, openness-neg, dominance, ao, error, dtm, source), as large as `heights`: metres,
/// rows from north to south, NaN = no data. `cell_m`: side of a cell. Settings are those of the program's `relief`,
/// such as
/// {"radius", "10"} (metres). Throws Error.
[[nodiscard]] inline std::map<std::string, cv::Mat1f>
relief(const cv::Mat1f& heights, double cell_m, const std::vector<std::string>& maps, const Settings& settings = {}) {
    scanshade_heights given = SCANSHADE_HEIGHTS_INIT;
    given.values = heights.data, given.width = heights.cols, given.height = heights.rows;
    given.row_bytes = static_cast<std::int64_t>(heights.step), given.cell = cell_m;
    return detail::relief(given, settings, maps);
}

/// Of a GeoTIFF or .vrt, which has its own units and place.
[[nodiscard]] inline std::map<std::string, cv::Mat1f>
relief(const std::string& path, const std::vector<std::string>& maps, const Settings& settings = {}) {
    scanshade_heights given = SCANSHADE_HEIGHTS_INIT;
    given.path = path.c_str();
    return detail::relief(given, settings, maps);
}

} // namespace scanshade
