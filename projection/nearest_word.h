// What somebody meant who mistyped a word.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// The candidate that is fewest edits away (letters added, left out, changed, or two swapped), the first of equals;
/// empty where none is near: more than a third of the word's letters, and at most three, would have to change.
[[nodiscard]] std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates);

/// "; did you mean WORD?", or nothing.
[[nodiscard]] std::string suggestion(std::string_view word, const std::vector<std::string>& candidates);

} // namespace scanshade
