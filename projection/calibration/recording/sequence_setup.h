// Prepares a recorded sequence for its adjustment: tracks, missing poses, outlines, outliers.
#pragma once

#include "projection/calibration/recording/sequence_observations.h"

namespace scanshade::calibration {

/// Finds tracks. Where a pose is missing, follows the camera from frame to frame (PnP on matches with depth). Removes
/// outliers under the first model. Throws Error where too few points agree.
[[nodiscard]] SequenceObservations observe_sequence(std::vector<SequenceFrame> frames, const Camera& depth_camera,
                                                    const Model& first, const SequenceOptions& options);

/// The start of a fit: poses at their start, each point at the mean of its depths or nearest to its rays.
[[nodiscard]] Fit initial_fit(const SequenceObservations& sequence, const Model& model);

} // namespace scanshade::calibration
