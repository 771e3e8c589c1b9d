// The tone curves that were fitted to scenes with truth: one constant for each method, profile and quality.
#pragma once

#include "ao/base/quality.h"

#include <string_view>

namespace scanshade {

/// k of exp(-k (1 - V)) for the estimate of that name at that quality. Settings that replace the quality's numbers of
/// taps do not change it. Throws Misuse for a name without a fitted curve.
[[nodiscard]] float fitted_curve_of(std::string_view name, Quality quality);

} // namespace scanshade
