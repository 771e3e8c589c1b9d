// The configurations that `bench` measures and an error budget chooses among.
#pragma once

#include "apps/method_settings.h"

#include <vector>

namespace scanshade {

/// What is measured: every level of each method's `quality` (the method as it comes where it has none), then the rows
/// of a table of more. In the order of the table of methods.
[[nodiscard]] std::vector<Configuration> configurations();

} // namespace scanshade
