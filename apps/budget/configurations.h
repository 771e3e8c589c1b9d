// The configurations that `bench` measures and an error budget chooses among.
#pragma once

#include "apps/method_settings.h"

#include <vector>

namespace scanshade {

/// Every level of each method's `quality` (the method's defaults where it has none), then more rows. They are in the
/// order of the table of methods.
[[nodiscard]] std::vector<Configuration> configurations();

} // namespace scanshade
