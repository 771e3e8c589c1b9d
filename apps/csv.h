// Fields of CSV files.
#pragma once

#include <string>

namespace scanshade {

/// The text in quotes where it holds a comma, quote or line end (RFC 4180).
[[nodiscard]] std::string csv_field(const std::string& text);

} // namespace scanshade
