// Which frames: Python's a:b:step, as --frames takes it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace scanshade {

/// The indices that a:b:step takes of 0 .. count - 1; a lone number takes that one frame, nothing takes all. Throws
/// Misuse if the text is invalid or selects none.
[[nodiscard]] std::vector<std::size_t> slice(const std::string& text, std::size_t count);

} // namespace scanshade
