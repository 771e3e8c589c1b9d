// Texts as Windows' programs write them.
#pragma once

#include <string>

namespace scanshade {

/// UTF-16 text with its byte order mark as UTF-8 without one; other bytes as they are. Halves of characters and what
/// has none in UTF-8 become '?'.
[[nodiscard]] std::string plain_text(std::string bytes);

} // namespace scanshade
