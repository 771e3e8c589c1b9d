// A few of many.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace scanshade {

/// `count` of `total` indices, spread evenly from the first on; all where there are no more.
[[nodiscard]] inline std::vector<std::size_t> spread(std::size_t count, std::size_t total) {
    count = std::min(count, total);
    std::vector<std::size_t> indices(count);
    for (std::size_t i = 0; i < count; ++i)
        indices[i] = i * total / count;
    return indices;
}

} // namespace scanshade
