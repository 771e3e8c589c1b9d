// The walk for many frames: load, project, compute, attach, write, with a bounded number of frames in memory.
#pragma once

#include "apps/frame/frame_row.h"
#include "apps/frame/method_pool.h"
#include "apps/walk/batch_options.h"

namespace scanshade {

/// Runs the walk over the frames. It computes as many at once as the pool has free methods, or one at a time in a
/// sequence. A failed frame has the reason in its row, leaves no file, and stops no other frame. A lost device ends the
/// run: frames in flight and later ones come back as skipped, with fault `outage`.
/// `on_frame` is called once per row, in the order of `options.frames`, never concurrently.
/// Rows come back in that order, too. The files do not depend on timing.
[[nodiscard]] std::vector<FrameRow> run_batch(const Capture& capture, MethodPool& pool, const BatchOptions& options,
                                              const std::function<void(const FrameRow&)>& on_frame = {});

} // namespace scanshade
