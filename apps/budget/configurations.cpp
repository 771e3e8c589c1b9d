#include "apps/budget/configurations.h"

#include "projection/base/error.h"

#include <algorithm>

namespace scanshade {
namespace {

/// Configurations measured besides the levels of `quality`.
const std::vector<Configuration>& more() {
    static const std::vector<Configuration> table{
        {"cacao", "lowest downsampled", {{"quality", "lowest"}, {"downsampled", "true"}}},
        {"cacao", "medium downsampled", {{"quality", "medium"}, {"downsampled", "true"}}},
        {"cacao", "high downsampled", {{"quality", "high"}, {"downsampled", "true"}}},
        {"cacao", "highest downsampled", {{"quality", "highest"}, {"downsampled", "true"}}},
        {"cacao", "high, as AMD ships it", {{"quality", "high"}, {"profile", "reference"}}},
        {"surfel", "lowest downsampled", {{"quality", "lowest"}, {"downsampled", "true"}}},
        {"surfel", "low downsampled", {{"quality", "low"}, {"downsampled", "true"}}},
        {"surfel", "high downsampled", {{"quality", "high"}, {"downsampled", "true"}}},
        {"alchemy", "lowest, sao", {{"quality", "lowest"}, {"profile", "sao"}}},
        {"alchemy", "low, sao", {{"quality", "low"}, {"profile", "sao"}}},
        {"alchemy", "medium, sao", {{"quality", "medium"}, {"profile", "sao"}}},
        {"alchemy", "high, sao", {{"quality", "high"}, {"profile", "sao"}}},
        {"alchemy", "highest, sao", {{"quality", "highest"}, {"profile", "sao"}}},
        {"hbao", "lowest, plus", {{"quality", "lowest"}, {"profile", "plus"}}},
        {"hbao", "low, plus", {{"quality", "low"}, {"profile", "plus"}}},
        {"hbao", "medium, plus", {{"quality", "medium"}, {"profile", "plus"}}},
        {"hbao", "high, plus", {{"quality", "high"}, {"profile", "plus"}}},
        {"hbao", "highest, plus", {{"quality", "highest"}, {"profile", "plus"}}},
        {"hbao", "medium, plus, interleaved", {{"quality", "medium"}, {"profile", "plus"}, {"interleaved", "true"}}},
        {"raycast", "depth surface, 16 rays", {{"rays", "16"}}},
        {"raycast", "depth surface, thickness 0.1 m", {{"rays", "64"}, {"thickness", "0.1"}}},
    };
    return table;
}

std::vector<Configuration> levels(const MethodRow& method) {
    const std::string name(method.name);
    const auto setup = method.setup();
    const std::vector<Parameter> rows = setup->parameters();
    const Parameter* quality = row_named(rows, "quality");
    if (!quality)
        return {{name, "as it comes", {}}};
    std::vector<Configuration> all;
    for (const std::string& level : choices_of(*quality))
        all.push_back({name, level, {{"quality", level}}});
    return all;
}

} // namespace

std::vector<Configuration> configurations() {
    std::vector<Configuration> all;
    for (const MethodRow& method : methods()) {
        std::ranges::move(levels(method), std::back_inserter(all));
        std::ranges::copy_if(more(), std::back_inserter(all),
                             [&](const auto& row) { return row.method == method.name; });
    }
    return all;
}

} // namespace scanshade
