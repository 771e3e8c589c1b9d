#include "io/shallow_json.h"

namespace scanshade {
namespace {

// The library's documentation numbers its exceptions.
constexpr int of_syntax_below = 200, other_type = 302, key_missing = 403, number_too_large = 406;

} // namespace

std::string json_problem(int id, std::string_view text) {
    if (id < of_syntax_below)
        return "not JSON, or NaN or infinity in it";
    if (id == number_too_large)
        return "a number too large for a double";
    if (id == other_type)
        return "a value is of another type than expected";
    if (const auto open = text.find('\''), close = text.rfind('\''); id == key_missing && close > open)
        return fmt::format("\"{}\" is missing", text.substr(open + 1, close - open - 1));
    return "JSON other than expected";
}

} // namespace scanshade
