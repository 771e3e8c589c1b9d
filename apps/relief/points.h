// Values of cells -> the points that lie in them, as fields of their clouds.
#pragma once

#include "apps/relief/maps.h"
#include "apps/relief/surface.h"

#include <filesystem>
#include <vector>

namespace scanshade::relief {

/// The file of each cloud of a survey: "tile_POINTS.laz", in the format it was read in.
[[nodiscard]] std::vector<std::filesystem::path> point_files(const SurveyPoints& survey,
                                                             const std::filesystem::path& folder);

/// Writes each cloud again, with a field for each map: svf, openness_neg, ambient_occlusion ... NaN where a point has
/// no cell. `cells` is of cells_of_points(). Throws Error naming the file where it is no longer what was read.
void write_points(const SurveyPoints& survey, const std::vector<int>& cells, const Maps& maps,
                  const std::vector<std::filesystem::path>& files);

} // namespace scanshade::relief
