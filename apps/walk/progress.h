// How far a run has come, on stderr: a bar with rate and remaining time on a terminal; elsewhere a line every few
// seconds, and one for each frame that failed.
#pragma once

#include "apps/walk/frame_row.h"
#include "projection/stopwatch.h"

#include <memory>
#include <optional>
#include <string>

namespace scanshade {

/// From now on, stderr gets one JSON object per line instead of prose: {"time", "message"}, and for each frame {"time",
/// "capture", "frame", "status", "fault", "why", "warnings", "ms", "done", "of", "left_s"}. For programs that watch.
void log_as_json();
/// From now on, stderr gets only warnings and failures.
void be_quiet();

/// A line on stderr.
void say(const std::string& line);
/// A line on stderr, however quiet the program is.
void warn(const std::string& line);

/// Keeps messages about one capture together while captures overlap. Lines of a thread that has a turn, and of its
/// Progress, wait until earlier turns have ended. JSON lines do not wait: each names its capture.
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
    [[nodiscard]] bool is_due(); ///< whether the last line off a terminal is long ago; then the next one counts as told
    [[nodiscard]] std::string bar() const;
    [[nodiscard]] double seconds_left() const; ///< at the pace so far

    std::size_t total_, done_ = 0;
    bool on_terminal_;
    std::shared_ptr<Turn::Held> turn_; ///< of the thread that made it
    Stopwatch stopwatch_;
    std::optional<Stopwatch> last_told_; ///< off a terminal
};

} // namespace scanshade
