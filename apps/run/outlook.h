// The last messages of a run: the expected error of its results, and the cost of a better preset.
#pragma once

#include "apps/budget/front.h"
#include "apps/frame/frame_row.h"
#include "apps/session/settings.h"

#include <string>
#include <vector>

namespace scanshade {

/// Sentences with measured numbers: the error expected of these frames, or where they have none of these settings at
/// this depth noise, and the error and time of the next better preset. Empty if nothing like it was measured (clouds,
/// other radii, other depth preparation), and for budgets, which print their own.
/// `setup`: the method's settings, as the capture was computed with.
[[nodiscard]] std::vector<std::string> outlook(const RunSettings& settings, MethodSetup& setup, const DepthNoise& noise,
                                               const Capture& capture, const std::vector<FrameRow>& rows,
                                               const ParetoFront& front);

} // namespace scanshade
