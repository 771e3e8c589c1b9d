// The results of all frames of a run, counted for its last line and its exit code.
#pragma once

#include "apps/frame/frame_row.h"

#include <cstddef>
#include <set>
#include <string>
#include <vector>

namespace scanshade {

/// Counts results of frames for the exit code.
class Tally {
  public:
    /// `strict`: a doubtful result counts like a failed one for the exit code.
    explicit Tally(bool strict) : strict_(strict) {}
    void add(const std::vector<FrameRow>& rows);
    /// Of a whole capture.
    void add(Fault fault) { faults_.insert(fault); }
    /// The last line of a run; empty if no frame is doubtful.
    [[nodiscard]] std::string doubt_sentence() const;
    /// `unopened`: captures that gave no frames.
    [[nodiscard]] int exit_code(int unopened) const;

  private:
    bool strict_;
    std::size_t all_ = 0, ok_ = 0, doubtful_ = 0;
    std::set<Fault> faults_;
};

} // namespace scanshade
