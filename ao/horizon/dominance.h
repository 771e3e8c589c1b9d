// Local dominance: how much a cell stands above its surroundings (Hesse 2016).
#pragma once

#include "ao/horizon/horizon.h"

namespace scanshade::horizon {

/// 1 on a level plane; NaN where the field is.
[[nodiscard]] cv::Mat1f dominance_of(const HeightField& field, const Settings& settings);

} // namespace scanshade::horizon
