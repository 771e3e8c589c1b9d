// Flags that hold several values: "8,16,32".
#pragma once

#include <string>
#include <vector>

namespace scanshade {

/// The words between the commas; empty ones are left out.
[[nodiscard]] std::vector<std::string> comma_separated(const std::string& list);
/// The same as whole numbers. Throws Misuse naming the flag if a word is not a number or is below `least`.
[[nodiscard]] std::vector<int> whole_numbers(const std::string& flag, const std::string& list, int least);
/// The same as real numbers of at least `least`.
[[nodiscard]] std::vector<double> numbers(const std::string& flag, const std::string& list, double least);

} // namespace scanshade
