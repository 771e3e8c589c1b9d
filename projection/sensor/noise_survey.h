// Differences between pixels of depth images, in bands of z: what noise is measured from.
#pragma once

#include "projection/maps.h"

#include <span>
#include <vector>

namespace scanshade {

constexpr int noise_lag_px = 4; ///< longer than most sensors' own smoothing, shorter than most surfaces
constexpr double noise_nearest_m = 0.2, noise_farthest_m = 50; ///< pixels nearer or farther tell nothing

/// Where depth goes on growing, or falling, over two lags.
struct DepthSlope {
    float z_m;
    float rise_m; ///< |difference| of depth over the flatter lag
    float bend_m; ///< |second difference|
    float off_m;  ///< how far the difference to the next pixel is off its share of the lag's
};

/// The deviations of one value, in metres, that the second differences of a band show.
struct NoiseBand {
    double z;                           ///< the mean
    double pixel_sigma;                 ///< by differences of adjacent pixels
    double near_sigma;                  ///< by those over noise_lag_px
    double wide_sigma;                  ///< by those over more pixels, too
    double adjacent, over_two, distant; ///< by those over one, two and noise_lag_px pixels, steps as they are
    double weight;                      ///< the number of differences
    double sigma = 0;                   ///< what is believed of these
    bool hidden = false;                ///< smaller than what a step explains: most values are on the same one
};

struct NoiseSurvey {
    std::vector<NoiseBand> bands;
    std::vector<float> values_m; ///< the distinct depths, in order; as recorded, before a lens's distortion was removed
    std::vector<DepthSlope> slopes;
};

/// Of all images, on all cores. Results do not depend on timing.
[[nodiscard]] NoiseSurvey noise_survey_of(std::span<const DepthImage> images);

} // namespace scanshade
