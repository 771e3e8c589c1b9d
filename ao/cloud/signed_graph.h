// A graph whose links say that two nodes agree or oppose each other, and by how much.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

namespace scanshade {

/// Weights are positive where two nodes agree, negative where they oppose each other.
class SignedGraph {
  public:
    explicit SignedGraph(std::size_t nodes) : links_(nodes) {}

    struct Link {
        std::uint32_t a, b;
        double weight;
    };
    /// Links add up.
    void add(std::uint32_t a, std::uint32_t b, double weight);
    [[nodiscard]] std::size_t size() const { return links_.size(); }

    /// Greedy contraction: again and again the strongest link joins its ends, one of which turns over where the link is
    /// negative; links that become parallel add up. Ends when none is stronger than `least`. Returns a sign per node,
    /// +1 or -1: those of one joined part agree with each other.
    /// Deterministic.
    [[nodiscard]] std::vector<std::int8_t> signs(double least) const;

  private:
    std::vector<std::unordered_map<std::uint32_t, double>> links_; ///< by node: to others
};

} // namespace scanshade
