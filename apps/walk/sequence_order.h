// The order in which frames enter the walk. In a sequence, each frame is computed after its neighbours have arrived.
#pragma once

#include "apps/frame/work.h"

#include <cstddef>
#include <deque>
#include <utility>
#include <vector>

namespace scanshade {

/// The frames that enter the pipeline, in order. Without a reach these are the wanted frames. With a reach, frames
/// within reach of a wanted frame enter as well, in recording order. Empty items follow, to flush the frames still
/// buffered.
class FrameOrder {
  public:
    /// `rows` belong to the wanted frames. The walk fills them in, so they must not move in memory.
    FrameOrder(const Capture& capture, std::vector<FrameRow>& rows, std::size_t reach);

    [[nodiscard]] bool has_next() const { return next_ < steps_.size() || empty_ > 0; }
    [[nodiscard]] WorkPtr next();

  private:
    const Capture& capture_;
    std::vector<std::pair<std::size_t, FrameRow*>> steps_; ///< null: only a neighbour
    std::size_t next_ = 0;
    std::deque<FrameRow> neighbour_rows_; ///< rows of frames that are only neighbours
    std::size_t empty_;
};

/// Holds frames of a sequence back until their neighbours have arrived. Without a sequence, frames pass through.
class SequenceBuffer {
  public:
    explicit SequenceBuffer(SequenceAo* sequence) : sequence_(sequence) {}

    /// Takes a frame, or none after the last one. Returns the next frame whose neighbours are complete, or none. A
    /// frame that lost a neighbour to an outage fails with that outage, so that --resume computes it again.
    [[nodiscard]] WorkPtr pass(WorkPtr arrived);
    /// Frames that an interrupted walk leaves behind.
    [[nodiscard]] const std::deque<WorkPtr>& rest() const { return queue_; }

  private:
    SequenceAo* sequence_;
    void fail_if_neighbour_lost(FrameRow& row) const;

    std::size_t newest_ = 0;
    std::deque<WorkPtr> queue_;
    std::vector<std::pair<std::size_t, std::string>> lost_; ///< frames lost to an outage, and why
};

} // namespace scanshade
