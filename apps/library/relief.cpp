#include "apps/library/relief.h"

#include "io/images/image_check.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade::library {

namespace {

class ArrayReader final : public rasters::RasterReader {
  public:
    explicit ArrayReader(const HeightArray& heights) : heights_(heights) {
        size = heights.size, grid.cell = heights.cell_m;
        // As of files: what single precision cannot hold loses a whole number first.
        for (int row = 0; heights.doubles && row < size.height; ++row)
            for (int column = 0; column < size.width; ++column)
                if (const double height = at(row, column); !std::isnan(height)) {
                    base = std::floor(height);
                    return;
                }
    }

    void read(int first, cv::Mat1f& z) override {
        for (int r = 0; r < z.rows; ++r)
            for (int c = 0; c < z.cols; ++c)
                z(r, c) = static_cast<float>(at(first + r, c) - base);
    }

  private:
    [[nodiscard]] double at(int row, int column) const {
        const auto* from = static_cast<const std::byte*>(heights_.values) + row * heights_.row_bytes;
        double height = 0;
        if (heights_.doubles) {
            std::memcpy(&height, from + column * std::ptrdiff_t{sizeof(double)}, sizeof(double));
        } else {
            float single = 0;
            std::memcpy(&single, from + column * std::ptrdiff_t{sizeof(float)}, sizeof(float));
            height = static_cast<double>(single);
        }
        constexpr double absurd = 1e30;
        return std::abs(height) < absurd ? height : std::nan("");
    }

    HeightArray heights_;
};

ReliefMaps computed(rasters::RasterReader& rows, const relief::ReliefSettings& settings) {
    if (settings.maps.bytes || settings.maps.svfs || settings.points)
        throw Misuse("--write: 8bit, points and svfs are files of the program; name maps");
    ReliefMaps result;
    result.maps = relief::maps_of({rows, {}}, settings.maps);
    json names = json::array();
    for (relief::NamedMap& map : result.maps) {
        map.values.convertTo(map.values, CV_32F);
        names.push_back(map.name);
    }
    const rasters::Grid& grid = rows.grid;
    result.info = json_line({{"maps", names},
                             {"width", rows.size.width},
                             {"height", rows.size.height},
                             {"cell", grid.cell},
                             {"x0", grid.x0},
                             {"y0", grid.y0},
                             {"unit_m", grid.crs.unit_m},
                             {"epsg", grid.crs.epsg},
                             {"notes", rows.notes}});
    return result;
}

} // namespace

ReliefMaps relief_of(const HeightArray& heights, const Settings& given) {
    relief::ReliefSettings settings;
    fill(settings, false, given);
    const auto width = static_cast<std::int64_t>(heights.size.width), height = std::int64_t{heights.size.height};
    if (width < 1 || height < 1 || static_cast<std::uint64_t>(width * height) > most_pixels)
        throw Misuse(fmt::format("heights: {}x{} cells given, expected 1 to {} cells", width, height, most_pixels));
    if (!(heights.cell_m > 0) || !std::isfinite(heights.cell_m))
        throw Misuse(fmt::format("heights: cells of {} m given, expected a number above 0", heights.cell_m));
    const std::int64_t packed = width * static_cast<std::int64_t>(heights.doubles ? sizeof(double) : sizeof(float));
    HeightArray own = heights;
    own.row_bytes = own.row_bytes == 0 ? packed : own.row_bytes;
    if (own.row_bytes < packed)
        throw Misuse(fmt::format("heights: rows of {} bytes given, expected at least {}", own.row_bytes, packed));
    ArrayReader rows(own);
    return computed(rows, settings);
}

ReliefMaps relief_of(const std::string& file, const Settings& given) {
    relief::ReliefSettings settings;
    fill(settings, true, given);
    const auto rows = rasters::open_raster(file, settings.band);
    return during(file, [&] { return computed(*rows, settings); });
}

} // namespace scanshade::library
