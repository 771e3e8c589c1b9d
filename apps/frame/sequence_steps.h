// A frame that is computed with its neighbours: the options, and the step of the walk.
#pragma once

#include "ao/sequence/sequence_ao.h"
#include "apps/frame/work.h"

namespace scanshade {

/// The options asked for. A reach that is not given follows from the capture's poses.
[[nodiscard]] SequenceAoOptions sequence_options(SequenceAoOptions asked, const Capture& capture, double radius_m);

/// Computes a frame's visibility with its neighbours. The row's notes list the neighbours used, and those left out with
/// the reason. Returns what share of the usual gain these bring (share_of_gain()).
[[nodiscard]] double compute_in_sequence(Work& work, const Capture& capture, SequenceAo& sequence);

} // namespace scanshade
