// A hash of integers: the source of all noise in the program, the same on every run.
#pragma once

#include <cstdint>

namespace scanshade {

/// Mixes well in two multiplications (the "lowbias32" constants of C. Wellons' hash prospector).
[[nodiscard]] constexpr std::uint32_t hash(std::uint32_t x) {
    x = (x ^ (x >> 16)) * 0x7feb352dU;
    x = (x ^ (x >> 15)) * 0x846ca68bU;
    return x ^ (x >> 16);
}
[[nodiscard]] constexpr std::uint32_t hash(std::uint32_t x, std::uint32_t y) { return hash(x ^ hash(y + 0x9e3779b9U)); }

} // namespace scanshade
