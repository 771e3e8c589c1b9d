#include "tests/bench/table.h"

#include <cstdio>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade::bench {

Table::Table(const std::vector<std::string>& heads) : columns_(heads.size()) {
    fmt::print("\n");
    row(heads);
    row(std::vector<std::string>(columns_, "---"));
}

void Table::row(std::vector<std::string> cells) {
    cells.resize(columns_);
    fmt::print("| {} |\n", fmt::join(cells, " | "));
    std::fflush(stdout);
}

} // namespace scanshade::bench
