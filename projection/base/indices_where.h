// Choosing among many points on all cores.
#pragma once

#include <algorithm>
#include <cstdint>
#include <tbb/parallel_for.h>
#include <vector>

namespace scanshade {

/// The values of `from(0)` .. `from(count - 1)` for which `holds(value)`, in this order. Both are called from several
/// threads, and twice for each.
template <class From, class Holds>
[[nodiscard]] std::vector<std::uint32_t> indices_where(std::size_t count, From&& from, Holds&& holds) {
    constexpr std::size_t at_once = 1 << 16;
    const std::size_t blocks = (count + at_once - 1) / at_once;
    std::vector<std::size_t> starts(blocks + 1, 0);
    const auto for_each_chosen = [&](std::size_t block, auto&& visit) {
        for (std::size_t i = block * at_once; i < std::min((block + 1) * at_once, count); ++i)
            if (const std::uint32_t value = from(i); holds(value))
                visit(value);
    };
    tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
        std::size_t chosen = 0;
        for_each_chosen(block, [&](std::uint32_t) { ++chosen; });
        starts[block + 1] = chosen;
    });
    for (std::size_t block = 0; block < blocks; ++block)
        starts[block + 1] += starts[block];
    std::vector<std::uint32_t> all(starts.back());
    tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
        std::size_t at = starts[block];
        for_each_chosen(block, [&](std::uint32_t value) { all[at++] = value; });
    });
    return all;
}

/// The indices below `count` for which `holds`, ascending.
template <class Holds>
[[nodiscard]] std::vector<std::uint32_t> indices_where(std::size_t count, Holds&& holds) {
    return indices_where(
        count, [](std::size_t i) { return static_cast<std::uint32_t>(i); }, holds);
}
/// Those of `among` for which `holds`, in their order.
template <class Holds>
[[nodiscard]] std::vector<std::uint32_t> indices_where(const std::vector<std::uint32_t>& among, Holds&& holds) {
    return indices_where(
        among.size(), [&](std::size_t i) { return among[i]; }, holds);
}

} // namespace scanshade
