// The progress of a run, on stderr. A terminal shows a bar with rate and remaining time. Elsewhere a line appears every
// few seconds, and one for each failed frame.
#pragma once

#include "apps/frame/frame_row.h"
#include "projection/base/stopwatch.h"

#include <memory>
#include <optional>
#include <string>

namespace scanshade {

/// From now on, stderr gets one JSON object per line, for programs: {"time", "message"}, and for each frame {"time",
/// "capture", "frame", "status", "fault", "why", "doubts", "warnings", "ms", "done", "of", "left_s"}.
void log_as_json();
/// From now on, stderr gets only warnings and failures.
void be_quiet();

/// Prints a line on stderr, unless quiet.
void say(const std::string& line);
/// Prints a line on stderr, even if quiet.
void warn(const std::string& line);

/// Keeps messages about one capture together while captures overlap. A thread that holds one of these
/// buffers its lines, and those of its Progress, until all earlier ones have ended. JSON lines do not wait: each names
/// its capture.
class OrderedOutput {
  public:
    OrderedOutput();
    ~OrderedOutput();
    OrderedOutput(const OrderedOutput&) = delete;
    OrderedOutput& operator=(const OrderedOutput&) = delete;
    /// Sets "capture" in the JSON lines that follow.
    void set_capture(const std::string& capture);

    struct Buffer;

  private:
    std::shared_ptr<Buffer> buffer_;
};

/// "1:02:03" or "2:03"
[[nodiscard]] std::string duration_text(double seconds);
/// The same for work that is left: never less than a second.
[[nodiscard]] std::string time_left_text(double seconds);
/// "99.8": 100 only where nothing is left.
[[nodiscard]] std::string percent_text(double share_done, bool anything_left, int digits = 0);

class Progress {
  public:
    explicit Progress(std::size_t total);
    void add(const FrameRow& row);
    /// Leaves the terminal on a fresh line.
    void end();

  private:
    [[nodiscard]] bool is_due(); ///< whether another line is due off a terminal; counts it as printed
    [[nodiscard]] std::string bar() const;
    [[nodiscard]] double seconds_left() const; ///< at the pace so far

    std::size_t total_, done_ = 0;
    bool on_terminal_;
    std::shared_ptr<OrderedOutput::Buffer> buffer_; ///< of the thread that made this
    Stopwatch stopwatch_;
    std::optional<Stopwatch> last_line_; ///< off a terminal
};

} // namespace scanshade
