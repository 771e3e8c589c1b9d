// What a run tells at its end: how far its results are from truth, and what a better preset would cost.
#pragma once

#include "apps/measure/front.h"
#include "apps/run/settings.h"

#include <string>
#include <vector>

namespace scanshade {

/// Sentences of measured numbers: the error expected of these settings on depth of this noise, and of the next better
/// preset with its time. Empty where nothing like it was measured: clouds, other radii, other depth preparation; and
/// for budgets, which tell it themselves.
[[nodiscard]] std::vector<std::string> outlook(const RunSettings& settings, const DepthNoise& noise,
                                               const Capture& capture, const ParetoFront& front);

} // namespace scanshade
