// After a refinement: whether depth and colour now lie on each other, told by frames that took no part in it.
#pragma once

#include "projection/calibration/recording/sequence.h"

namespace scanshade::calibration {

/// Points of depth edges, and how many of them have an edge of colour, running the same way, within two pixels.
struct OutlineAgreement {
    std::size_t points = 0;
    double share = 0;                       ///< 0..1
    double by_chance = 0, chance_sigma = 0; ///< the same where colour is shifted aside: mean, standard deviation
    /// How far beyond chance.
    [[nodiscard]] double sigmas() const { return chance_sigma > 0 ? (share - by_chance) / chance_sigma : 0; }
};
/// `colour` is the colour camera beside `depth_camera` and its place, `gap_px` how far surfaces go on beyond their last
/// point. Edges of texture are everywhere, so that a distance to the nearest one says little: what the same frames show
/// under 24 shifts by 16 to 48 pixels is chance.
[[nodiscard]] OutlineAgreement outline_agreement(const std::vector<SequenceFrame>& frames, const Camera& depth_camera,
                                                 const Model& colour, double gap_px);

} // namespace scanshade::calibration
