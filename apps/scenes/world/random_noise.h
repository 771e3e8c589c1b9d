// Noise as a hash of seed, frame, purpose and pixel: the same on every run, however many threads there are.
#pragma once

#include "projection/base/hash.h"

#include <cmath>
#include <cstdint>
#include <numbers>

namespace scanshade {

/// A stream of independent numbers by seed, frame and purpose, indexed by pixel.
class Noise {
  public:
    constexpr Noise(int seed, int frame, std::uint32_t purpose)
        : key_(hash(hash(static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(frame)), purpose)) {}

    /// Even in [0, 1).
    [[nodiscard]] double uniform(int u, int v) const { return bits(u, v) * 0x1p-32; }
    /// Normal, mean 0, sigma 1 (Box and Muller 1958).
    [[nodiscard]] double gaussian(int u, int v) const {
        const std::uint32_t first = bits(u, v), second = hash(first ^ 0x68bc21ebU);
        return std::sqrt(-2 * std::log((first + 0.5) * 0x1p-32)) * std::cos(2 * std::numbers::pi * second * 0x1p-32);
    }

  private:
    [[nodiscard]] constexpr std::uint32_t bits(int u, int v) const {
        return hash(hash(key_, static_cast<std::uint32_t>(u)), static_cast<std::uint32_t>(v));
    }
    std::uint32_t key_;
};

} // namespace scanshade
