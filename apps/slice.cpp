// --frames a:b:step.
#include "apps/slice.h"

#include "projection/base/error.h"
#include "projection/base/parameters.h"

#include <algorithm>
#include <fmt/format.h>
#include <sstream>

namespace scanshade {

std::vector<std::size_t> slice(const std::string& text, std::size_t count) {
    const auto refuse = [&] {
        throw Misuse("frames: '" + text + "' given, expected a:b:step, such as 10:50:2, :100 or 7");
    };
    std::vector<std::string> parts;
    std::istringstream stream(text + ":");
    for (std::string part; std::getline(stream, part, ':');)
        parts.push_back(part);
    if (parts.size() > 3)
        refuse();
    const auto total = static_cast<int>(count);
    const auto number = [&](std::size_t part, int otherwise) {
        int value = otherwise;
        if (part < parts.size() && !parts[part].empty())
            set({"frames", "", &value}, parts[part]);
        return value;
    };
    const auto from_end = [&](int index) { return index < 0 ? index + total : index; };
    const int first = from_end(number(0, 0)), step = number(2, 1);
    const int end = parts.size() == 1 && !text.empty() ? first + 1 : from_end(number(1, total));
    if (step < 1)
        refuse();
    std::vector<std::size_t> chosen;
    for (int index = std::max(first, 0); index < std::min(end, total); index += step)
        chosen.push_back(static_cast<std::size_t>(index));
    if (chosen.empty())
        throw Misuse(fmt::format("frames: '{}' takes none of the {} frames", text, count));
    return chosen;
}

} // namespace scanshade
