// How far a run has come: a bar with rate and remaining time on a terminal, one line per frame elsewhere. On stderr.
#pragma once

#include "apps/walk/frame_row.h"
#include "projection/stopwatch.h"

#include <memory>
#include <string>

namespace scanshade {

/// From now on, stderr gets one JSON object per line instead of prose: {"time", "message"}, and of frames {"time",
/// "capture", "frame", "status", "fault", "why", "warnings", "ms", "done", "of", "left_s"}. For programs that watch.
void log_as_json();

/// A line on stderr.
void say(const std::string& line);

/// Captures overlap, what is told of them does not: lines of a thread that has a turn (and of its Progress) are held
/// back until the turns begun before it have ended. JSON lines are told as they come: each says which capture it is of.
class Turn {
  public:
    Turn();
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    /// What JSON lines of this turn have as "capture" from now on.
    void is_of(const std::string& capture);

    struct Held;

  private:
    std::shared_ptr<Held> held_;
};

/// "1:02:03" or "2:03"
[[nodiscard]] std::string duration_text(double seconds);

class Progress {
  public:
    explicit Progress(std::size_t total);
    void add(const FrameRow& row);
    /// Leaves the terminal on a fresh line.
    void end();

  private:
    [[nodiscard]] std::string bar() const;
    [[nodiscard]] double seconds_left() const; ///< at the pace so far

    std::size_t total_, done_ = 0;
    bool on_terminal_;
    std::shared_ptr<Turn::Held> turn_; ///< of the thread that made it
    Stopwatch stopwatch_;
};

} // namespace scanshade
