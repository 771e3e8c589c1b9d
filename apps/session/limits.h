// Limits of error and time that a run is asked to keep within.
#pragma once

namespace scanshade {

/// 0 = no limit.
struct Budget {
    double max_error = 0; ///< RMSE to truth
    double max_ms = 0;    ///< per frame on the device, transfers left out
    [[nodiscard]] bool any() const { return max_error > 0 || max_ms > 0; }
};

} // namespace scanshade
