// All checks in one table: what each measures, and from where on a result is doubtful.
#pragma once

#include "projection/base/finding.h"

#include <span>
#include <string>
#include <string_view>

namespace scanshade {

struct CheckRow {
    Check check;
    std::string_view name;      ///< in checks.json
    std::string_view subject;   ///< camera, depth, cloud, setting or result
    std::string_view statistic; ///< the number that is measured
    std::string_view doubtful;  ///< from where on; "yes" where it is no number
};

/// By subject, in the order of Check.
[[nodiscard]] std::span<const CheckRow> all_checks();
[[nodiscard]] const CheckRow& row_of(Check check);
/// Throws Error naming the check where there is none of that name.
[[nodiscard]] Check check_named(std::string_view name);

/// All checks as a table for people, or as README.md has them.
[[nodiscard]] std::string checks_text();
[[nodiscard]] std::string checks_markdown();

} // namespace scanshade
