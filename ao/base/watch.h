// Time between stages, by name.
#pragma once

#include "ao/base/method.h"
#include "projection/base/stopwatch.h"

namespace scanshade {

/// Adds what passed since the last lap, or since it was made, to a method's timings.
class Watch {
  public:
    /// `begun`: when the first stage began.
    explicit Watch(Timings& timings, const Stopwatch& begun = {}) : timings_(timings), stopwatch_(begun) {}
    void lap(const std::string& name) { add(timings_, name, stopwatch_.lap_ms()); }

  private:
    Timings& timings_;
    Stopwatch stopwatch_;
};

} // namespace scanshade
