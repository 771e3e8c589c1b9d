// A graph whose links say that two nodes agree or oppose each other, and by how much.
#pragma once

#include <cstdint>
#include <vector>

namespace scanshade {

/// Weights are positive where two nodes agree, negative where they oppose each other.
class SignedGraph {
  public:
    explicit SignedGraph(std::size_t nodes) : nodes_(nodes) {}

    struct Link {
        std::uint32_t a, b;
        double weight;
    };
    /// Links between the same nodes add up; those of a node to itself say nothing.
    void add(std::uint32_t a, std::uint32_t b, double weight);
    [[nodiscard]] std::size_t size() const { return nodes_; }

    /// A sign per node, +1 or -1, that makes the sum of weight x sign x sign over all links large, in two steps. First
    /// come the signs of the leading eigenvector of the links, each divided by the root of its ends' weights. (Singer
    /// 2011, "Angular synchronization by eigenvectors", for two angles.) Then nodes that most of their links oppose
    /// turn over, until there are none. Parts without a link between them have signs of their own. Deterministic.
    [[nodiscard]] std::vector<std::int8_t> signs() const;

  private:
    std::size_t nodes_;
    std::vector<Link> links_;
};

} // namespace scanshade
