// Stereo matchers' preference for whole disparities.
#pragma once

#include <vector>

namespace scanshade {

/// Block matchers find disparities near whole pixels more often than between them (pixel locking: Shimizu and Okutomi
/// 2001; Prasad et al. 1992 in particle images). So errors follow the disparity, and slanted surfaces get waves that no
/// difference over some pixels tells from shapes. But the fractions of disparities tell, which are even where nothing
/// is preferred: how far the share of smaller fractions is off the fraction is the error (histogram equalisation).
///
/// Walls prefer the disparities that they are at. So whole ones have to be preferred near, far and between.
///
/// Returns the deviation of 1/z that locking adds, in 1/m; 0 = no whole disparity is preferred. `inverse_m`: 1/z of
/// some thousand pixels, in 1/m; `step_per_m`: the step that these come in, an eighth of a pixel's disparity or a finer
/// power of two.
[[nodiscard]] double locking_of(const std::vector<float>& inverse_m, double step_per_m);

} // namespace scanshade
