// Presets of `scanshade run`: defaults that trade time for accuracy.
#pragma once

#include "apps/method_settings.h"

#include <array>

namespace scanshade {

enum class Preset { fast, balanced, best };

inline constexpr std::array preset_words{Named{"fast", Preset::fast}, Named{"balanced", Preset::balanced},
                                         Named{"best", Preset::best}};

/// The method of a preset and its settings, chosen from the measured Pareto front (apps/budget/front.json).
/// `balanced` comes within 1 to 5 % of the error of `best` in about half the time. `best` is not surfel's highest
/// quality: on noisy depth that has a larger error (RMSE 0.113 against 0.112 of structured light, 0.099 against 0.097
/// of time of flight).
[[nodiscard]] const Configuration& configuration_of(Preset preset);

} // namespace scanshade
