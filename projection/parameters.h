// One row per setting: the same rows parse the flags, print the help, check the ranges and fill the manifest.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace scanshade {

/// A setting bound to the variable that holds it.
struct Parameter {
    using Target = std::variant<bool*, int*, float*, double*, std::string*>;

    std::string name;   ///< "radius"
    std::string help;   ///< one line, without default and range (they are printed from the row)
    Target value;       ///< holds the default until set
    std::string unit{}; ///< "m", "rad", "" ...
    double low = -std::numeric_limits<double>::infinity(); ///< inclusive
    double high = std::numeric_limits<double>::infinity(); ///< inclusive
    std::vector<std::string> choices{};                    ///< for strings: the only values allowed; empty = any
};

/// Sets the row's variable from text. Throws Misuse naming the row, the text, and what was expected.
void set(const Parameter& row, const std::string& text);
/// The row's present value as text: numbers shortest round trip, booleans "true"/"false".
[[nodiscard]] std::string value_text(const Parameter& row);
/// "m, 0 .. 100000" or "lowest | low | ..." : what may be given.
[[nodiscard]] std::string range_text(const Parameter& row);
/// Throws Misuse when the value is out of the row's range, not finite, or not among its choices.
void check(const Parameter& row);
/// The row of that name; null where there is none.
[[nodiscard]] const Parameter* row_named(const std::vector<Parameter>& rows, std::string_view name);

} // namespace scanshade
