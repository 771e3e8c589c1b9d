// What every check found in each row of a gauntlet, for rates.py.
#pragma once

#include "projection/base/finding.h"

#include <string>

namespace scanshade::gauntlet {

enum class RowKind { valid, harmless, wrong }; ///< unperturbed; perturbed with a result that is as good; a worse result

/// Appends a line of JSON to the file that GAUNTLET_ROWS names; nothing where it names none.
void write_checks(const std::string& data, const std::string& perturbation, RowKind kind, const Findings& findings);

} // namespace scanshade::gauntlet
