// After a refinement: whether depth and colour now agree, measured on frames that were not refined.
#pragma once

#include "projection/calibration/recording/sequence_observations.h"

namespace scanshade::calibration {

/// Points of depth edges, and how many of them have a colour edge of the same direction within two pixels.
struct OutlineAgreement {
    std::size_t points = 0;
    double share = 0;                       ///< 0..1
    double by_chance = 0, chance_sigma = 0; ///< the same with colour translated: mean, standard deviation
    /// How far above chance.
    [[nodiscard]] double sigmas() const { return chance_sigma > 0 ? (share - by_chance) / chance_sigma : 0; }
};
/// `colour` is the colour camera and its extrinsics to `depth_camera`; `gap_px` is how far surfaces extend beyond their
/// last point. Texture has edges everywhere, so the distance to the nearest one says little. Chance is therefore
/// measured on the same frames with colour translated 24 ways, by 16 to 48 pixels.
[[nodiscard]] OutlineAgreement outline_agreement(const std::vector<SequenceFrame>& frames, const Camera& depth_camera,
                                                 const Model& colour, double gap_px);

} // namespace scanshade::calibration
