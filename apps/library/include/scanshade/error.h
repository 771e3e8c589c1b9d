// Errors of the library, with the program's own sentences.
#pragma once

#include <scanshade/scanshade.h>

#include <stdexcept>

namespace scanshade {

/// What a function of the C interface reported. The text names the value given and what was expected.
class Error : public std::runtime_error {
  public:
    Error(scanshade_status status, const char* sentence) : std::runtime_error(sentence), status_(status) {}
    /// Whose fault it is: SCANSHADE_MISUSE, SCANSHADE_BAD_INPUT, SCANSHADE_OUTAGE or SCANSHADE_INTERNAL.
    [[nodiscard]] scanshade_status status() const { return status_; }

  private:
    scanshade_status status_;
};

namespace detail {
/// Throws Error where a call has failed.
inline void check(scanshade_status status) {
    if (status != SCANSHADE_OK)
        throw Error(status, scanshade_last_error());
}
} // namespace detail

} // namespace scanshade
