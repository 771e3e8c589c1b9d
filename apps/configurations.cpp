#include "apps/configurations.h"

#include "projection/error.h"

#include <algorithm>
#include <fmt/format.h>

namespace scanshade {
namespace {

/// What is worth measuring besides the levels of `quality`.
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
    for (const std::string& level : quality->choices)
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

void apply(const Configuration& configuration, MethodSetup& setup) {
    const std::vector<Parameter> rows = setup.parameters();
    for (const auto& [name, value] : configuration.settings) {
        const Parameter* row = row_named(rows, name);
        if (!row)
            throw Misuse(fmt::format("{}: the method has no setting '{}'", configuration.full_name(), name));
        during(configuration.full_name(), [&, &text = value] { set(*row, text); });
    }
}

Settings values_of(MethodSetup& setup) {
    Settings values;
    for (const Parameter& row : setup.parameters())
        values.emplace_back(row.name, value_text(row));
    return values;
}

const Parameter* row_named(const std::vector<Parameter>& rows, std::string_view name) {
    const auto row = std::ranges::find(rows, name, &Parameter::name);
    return row == rows.end() ? nullptr : &*row;
}

Stage method_stage(std::string_view name, MethodSetup& setup) {
    Stage stage{fmt::format("method {}", name), setup.parameters()};
    for (Parameter& row : stage.rows)
        row.name = fmt::format("{}.{}", name, row.name);
    return stage;
}

} // namespace scanshade
