// What was typed: kept in every report, so that it can be made again.
#pragma once

#include <string>

namespace scanshade {

/// The program's own command line as a shell would take it back; empty where the kernel does not tell.
[[nodiscard]] std::string command_line();

} // namespace scanshade
