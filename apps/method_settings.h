// A method with its settings as plain data, and the flags that set them.
#pragma once

#include "ao/base/method.h"
#include "apps/command.h"

#include <string>
#include <utility>
#include <vector>

namespace scanshade {

/// Names and values of settings, as the method's rows take them: {"quality", "high"}.
using Settings = std::vector<std::pair<std::string, std::string>>;

struct Configuration {
    std::string method;
    std::string name; ///< unique among the method's configurations: "high", "high downsampled"
    Settings settings;

    [[nodiscard]] std::string full_name() const { return method + " " + name; }
};

/// Puts the settings into the rows of `setup`. Throws Misuse naming the configuration for a row that does not exist or
/// refuses its value.
void apply(const Configuration& configuration, MethodSetup& setup);

/// The value of every row; applying it later restores the settings.
[[nodiscard]] Settings values_of(MethodSetup& setup);

/// The method's rows as the command line shows them: "radius" of cacao is --cacao.radius.
[[nodiscard]] Stage method_stage(std::string_view name, MethodSetup& setup);

} // namespace scanshade
