#include "tests/gauntlet/check_rows.h"

#include "apps/doubts/checks.h"
#include "apps/json.h"

#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

namespace scanshade::gauntlet {

void write_checks(const std::string& data, const std::string& perturbation, RowKind kind, const Findings& findings) {
    const char* const file = std::getenv("GAUNTLET_ROWS");
    if (!file)
        return;
    constexpr std::array names{"valid", "harmless", "wrong"};
    json found = json::array();
    for (const Finding& finding : findings)
        found.push_back({row_of(finding.check).name, finding.value, finding.limit, is_doubt(finding)});
    std::ofstream(file, std::ios::app) << json{{"data", data},
                                               {"perturbation", perturbation},
                                               {"kind", names.at(static_cast<std::size_t>(kind))},
                                               {"found", found}}
                                       << '\n';
}

} // namespace scanshade::gauntlet
