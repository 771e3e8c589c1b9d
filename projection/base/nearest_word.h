// The word meant by a mistyped one.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// The candidate with the fewest edits (letters added, removed, changed, or two swapped), the first of equals. Empty if
/// that takes more than three edits, or more than a third of the word's letters.
[[nodiscard]] std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates);

/// "; did you mean WORD?", or nothing.
[[nodiscard]] std::string suggestion(std::string_view word, const std::vector<std::string>& candidates);

} // namespace scanshade
