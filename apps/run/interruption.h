// Ctrl-C, or the end of the terminal: a run ends after its frames in flight.
#pragma once

#include <atomic>

namespace scanshade {

extern std::atomic<bool> interrupted; ///< set by a signal; runs look at it between frames

/// The first Ctrl-C, or the end of the terminal, ends the run after the frames in flight; the second one kills it, as
/// always.
void end_gracefully_on_signals();

} // namespace scanshade
