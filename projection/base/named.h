// Tables whose rows have names: methods, scenes, sensors.
#pragma once

#include "projection/base/error.h"

#include <string>
#include <string_view>

namespace scanshade {

/// The row of that name. Throws Misuse that lists all names of the `kind` where there is none.
template <class Rows>
[[nodiscard]] const typename Rows::value_type& one_named(const Rows& rows, std::string_view name,
                                                         std::string_view kind) {
    std::string known;
    for (const auto& row : rows) {
        if (row.name == name)
            return row;
        known += (known.empty() ? "" : ", ") + std::string(row.name);
    }
    throw Misuse("no " + std::string(kind) + " '" + std::string(name) + "', there are: " + known);
}

} // namespace scanshade
