// The one printer of tables: Markdown, so that a README can quote them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace scanshade::bench {

/// A table on stdout. Each row is printed at once, since some take minutes.
class Table {
  public:
    /// Prints the heads, after an empty line.
    explicit Table(const std::vector<std::string>& heads);
    /// Missing cells at the end stay empty.
    void row(std::vector<std::string> cells);

  private:
    std::size_t columns_;
};

} // namespace scanshade::bench
