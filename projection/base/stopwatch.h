// Elapsed wall-clock time, for reports and timings.
#pragma once

#include <chrono>
#include <utility>

namespace scanshade {

/// Runs from its construction.
class Stopwatch {
  public:
    [[nodiscard]] double ms() const { return between<std::milli>(start_, Clock::now()); }
    [[nodiscard]] double seconds() const { return between<std::ratio<1>>(start_, Clock::now()); }
    /// The milliseconds so far; the watch starts again from zero.
    double lap_ms() {
        const Clock::time_point now = Clock::now();
        return between<std::milli>(std::exchange(start_, now), now);
    }

  private:
    using Clock = std::chrono::steady_clock;
    template <class Unit>
    [[nodiscard]] static double between(Clock::time_point from, Clock::time_point to) {
        return std::chrono::duration<double, Unit>(to - from).count();
    }

    Clock::time_point start_ = Clock::now();
};

} // namespace scanshade
