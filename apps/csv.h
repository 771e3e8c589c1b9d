// Fields of CSV files.
#pragma once

#include <string>

namespace scanshade {

/// A text as a field of a CSV file (RFC 4180): in quotes where it holds a comma, quote or line end.
///
/// Spreadsheets run a cell as a formula if it begins with = + - @, a tab or a line end, in quotes or not. Names come
/// from others, so that such a text gets an apostrophe in front. It gets another one if it begins with apostrophes and
/// then one of those, so that no two texts become the same. Numbers are not texts: they keep their sign. Back: of a
/// field that matches ^'+[=+\-@\t\r\n] the first character goes.
[[nodiscard]] std::string csv_field(const std::string& text);

} // namespace scanshade
