// Local dominance: how much a cell stands above its surroundings (Hesse 2016).
#pragma once

#include "ao/horizon/horizon.h"

namespace scanshade::horizon {

/// Of some rows: 1 on a level plane, and where nothing is known around a cell; NaN where the field is.
[[nodiscard]] cv::Mat1f dominance_of(const HeightField& field, const Settings& settings, cv::Range rows);

} // namespace scanshade::horizon
