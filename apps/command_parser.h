// Words and flags as typed -> the variables of a command's rows.
#pragma once

#include "apps/command.h"

#include <string>
#include <vector>

namespace scanshade {

/// Fills the command's words and rows, a preset first; reads the file that --settings names. `arguments` are those
/// after the command's name. Throws Misuse for what is unknown, missing or out of range.
void parse(Command& command, std::vector<std::string> arguments);

} // namespace scanshade
