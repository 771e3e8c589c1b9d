// The numbers of a Difference for people and programs: one list of columns for tables, CSV and JSON.
#pragma once

#include "ao/compare.h"
#include "apps/json.h"

#include <string>

namespace scanshade {

/// The columns' heads and one row's cells, aligned with each other.
[[nodiscard]] std::string figure_heads();
[[nodiscard]] std::string figure_cells(const Difference& difference);

/// "pixels,only_a,only_b,mae,rms,..." and one row; unknown numbers are empty fields.
[[nodiscard]] std::string figure_csv_heads();
[[nodiscard]] std::string figure_csv(const Difference& difference);

/// Every number by name; unknown ones are null.
[[nodiscard]] json to_json(const Difference& difference);

} // namespace scanshade
