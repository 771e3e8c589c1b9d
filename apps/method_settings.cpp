#include "apps/method_settings.h"

#include "projection/base/error.h"

#include <fmt/format.h>

namespace scanshade {

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

Stage method_stage(std::string_view name, MethodSetup& setup) {
    Stage stage{fmt::format("method {}", name), setup.parameters(), std::string(name)};
    for (Parameter& row : stage.rows)
        row.name = fmt::format("{}.{}", name, row.name);
    return stage;
}

} // namespace scanshade
