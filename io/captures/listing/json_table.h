// JSON tables that are too large to be held: a list of objects, row by row.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace scanshade {

/// What a row has of the keys that were asked for, in their order; empty where it has no such text or numbers.
struct TableRow {
    std::vector<std::string> texts;
    std::vector<std::vector<double>> numbers; ///< one, or those of a list
};

/// Calls `take` for each object of the list that the file holds. Takes some MiB of memory, however large the file is.
/// Throws Error naming file and byte for what is no list of objects, for a word of more than 1 MiB, and for more than
/// 64 levels.
void for_each_row(const std::filesystem::path& file, const std::vector<std::string>& keys,
                  const std::function<void(TableRow&)>& take);

} // namespace scanshade
