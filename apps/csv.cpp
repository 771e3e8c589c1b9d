#include "apps/csv.h"

namespace scanshade {

std::string csv_field(const std::string& text) {
    const std::size_t first = text.find_first_not_of('\'');
    const bool formula = first != std::string::npos && std::string("=+-@\t\r\n").find(text[first]) != std::string::npos;
    std::string cell = formula ? "'" + text : text;
    if (cell.find_first_of(",\"\r\n") == std::string::npos)
        return cell;
    std::string quoted = "\"";
    for (const char c : cell)
        quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
    return quoted + '"';
}

} // namespace scanshade
