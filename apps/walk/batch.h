// The walk for many frames: load, project, compute, attach, write, with a bounded number of frames in memory.
#pragma once

#include "apps/walk/batch_options.h"
#include "apps/walk/frame_row.h"
#include "apps/walk/method_pool.h"

namespace scanshade {

/// Runs the walk over the frames, as many of them computed at once as the pool has methods free; a sequence takes one
/// after the other. A frame that fails says why in its row, leaves no file, and stops no other. A
/// lost device ends the run: frames in flight and those after them come back as skipped, the fault of an outage.
/// `on_frame` is called once per row, in the order of `options.frames`, never concurrently.
/// Rows come back in that order too; what is written does not depend on timing.
[[nodiscard]] std::vector<FrameRow> run_batch(const Capture& capture, MethodPool& pool, const BatchOptions& options,
                                              const std::function<void(const FrameRow&)>& on_frame = {});

} // namespace scanshade
