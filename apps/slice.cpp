// --frames a:b:step.
#include "apps/slice.h"

#include "projection/base/error.h"
#include "projection/base/parameters.h"

#include <algorithm>
#include <cstdint>
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
    const auto total = static_cast<std::int64_t>(count); // wider than the numbers given: sums of both have room
    const auto number = [&](std::size_t part, std::int64_t otherwise) {
        if (part >= parts.size() || parts[part].empty())
            return otherwise;
        int value = 0;
        set({"frames", "", &value}, parts[part]);
        return std::int64_t{value};
    };
    const auto from_end = [&](std::int64_t index) { return index < 0 ? index + total : index; };
    const std::int64_t first = from_end(number(0, 0)), step = number(2, 1);
    const std::int64_t end = parts.size() == 1 && !text.empty() ? first + 1 : from_end(number(1, total));
    if (step < 1)
        refuse();
    std::vector<std::size_t> chosen;
    for (std::int64_t index = std::max<std::int64_t>(first, 0); index < std::min(end, total); index += step)
        chosen.push_back(static_cast<std::size_t>(index));
    if (chosen.empty())
        throw Misuse(fmt::format("frames: '{}' takes none of the {} frames", text, count));
    return chosen;
}

} // namespace scanshade
