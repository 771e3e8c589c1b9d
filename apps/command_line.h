// The command line as typed: every report keeps it, so that it can be made again.
#pragma once

#include <string>

namespace scanshade {

/// The program's own command line quoted for a shell; empty if the kernel does not provide it.
[[nodiscard]] std::string command_line();

} // namespace scanshade
