// The median of many values on all cores, and the order of a few.
#pragma once

#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <tbb/combinable.h>
#include <tbb/parallel_for.h>
#include <vector>

namespace scanshade {

/// Ascending. Of millions of small arrays, since nothing branches on values: odd-even transposition (Knuth 1998, The
/// Art of Computer Programming 3, 5.3.4).
template <std::size_t count>
[[nodiscard]] std::array<float, count> ascending(std::array<float, count> values) {
    for (std::size_t round = 0; round < count; ++round)
        for (std::size_t i = round % 2; i + 1 < count; i += 2) {
            const float low = std::min(values[i], values[i + 1]), high = std::max(values[i], values[i + 1]);
            values[i] = low, values[i + 1] = high;
        }
    return values;
}

/// The median of values of at least 0, the upper one of two; 0 for no values. Equal to median(). Bits of such floats
/// are in the order of their values: they are counted by their upper half, then by their lower half.
[[nodiscard]] inline float median_of_lengths(std::span<const float> values) {
    if (values.empty())
        return 0;
    constexpr std::size_t worth_all_cores = 1 << 18, at_once = 1 << 16;
    static constexpr std::size_t kinds = 1 << 16;
    if (values.size() < worth_all_cores)
        return median(std::vector<float>(values.begin(), values.end()), 0.0F);
    using Counts = std::vector<std::uint32_t>;
    std::size_t rank = values.size() / 2;
    const auto kind_at_rank = [&](auto&& kind_of) { // `kinds` = none
        tbb::combinable<Counts> parts([&] { return Counts(kinds, 0U); });
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, values.size(), at_once), [&](const auto& range) {
            Counts& counts = parts.local();
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                if (const std::size_t kind = kind_of(std::bit_cast<std::uint32_t>(values[i])); kind < kinds)
                    ++counts[kind];
        });
        Counts all(kinds, 0);
        parts.combine_each([&](const Counts& part) {
            for (std::size_t kind = 0; kind < kinds; ++kind)
                all[kind] += part[kind];
        });
        std::uint32_t kind = 0;
        for (; rank >= all[kind]; ++kind)
            rank -= all[kind];
        return kind;
    };
    const std::uint32_t upper = kind_at_rank([](std::uint32_t bits) { return bits >> 16; });
    const std::uint32_t lower =
        kind_at_rank([&](std::uint32_t bits) { return bits >> 16 == upper ? bits & 0xffffU : kinds; });
    return std::bit_cast<float>(upper << 16 | lower);
}

} // namespace scanshade
