// How far a run has come: a bar with rate and remaining time on a terminal, one line per frame elsewhere. On stderr.
#pragma once

#include "apps/batch.h"

#include <chrono>

namespace scanshade {

/// From now on, stderr gets one JSON object per line instead of prose: {"time", "message"}, and of frames {"time",
/// "frame", "status", "fault", "why", "warnings", "ms", "done", "of", "left_s"}. For programs that watch.
void log_as_json();

/// A line on stderr.
void say(const std::string& line);

/// "1:02:03" or "2:03"
[[nodiscard]] std::string duration_text(double seconds);

class Progress {
  public:
    explicit Progress(std::size_t total);
    void add(const FrameRow& row);
    /// Leaves the terminal on a fresh line.
    void end();

  private:
    void draw();
    [[nodiscard]] double seconds_left() const; ///< at the pace so far

    std::size_t total_, done_ = 0;
    bool on_terminal_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

} // namespace scanshade
