// Scrambled low-discrepancy points in the unit square, from which ray directions are made.
#pragma once

#include <cstdint>

namespace scanshade {

[[nodiscard]] constexpr std::uint32_t bits_reversed(std::uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = ((x & 0x00ff00ffU) << 8) | ((x & 0xff00ff00U) >> 8);
    x = ((x & 0x0f0f0f0fU) << 4) | ((x & 0xf0f0f0f0U) >> 4);
    x = ((x & 0x33333333U) << 2) | ((x & 0xccccccccU) >> 2);
    return ((x & 0x55555555U) << 1) | ((x & 0xaaaaaaaaU) >> 1);
}

/// Owen's scrambling as a hash in which every bit depends on the higher ones alone (Laine and Karras 2011). The
/// constants are those of Burley 2020, "Practical Hash-based Owen Scrambling".
[[nodiscard]] constexpr std::uint32_t owen_scrambled(std::uint32_t x, std::uint32_t seed) {
    x = bits_reversed(x) + seed;
    x ^= x * 0x6c50b47cU;
    x ^= x * 0xb82f1e52U;
    x ^= x * 0xc7afe638U;
    x ^= x * 0x8d22f6e6U;
    return bits_reversed(x);
}

/// Second dimension of Sobol's sequence; the first is the reversed index.
[[nodiscard]] constexpr std::uint32_t sobol(std::uint32_t index) {
    std::uint32_t x = 0;
    for (std::uint32_t v = 1U << 31; index; index >>= 1, v ^= v >> 1)
        if (index & 1U)
            x ^= v;
    return x;
}

} // namespace scanshade
