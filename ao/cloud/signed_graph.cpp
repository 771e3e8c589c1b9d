// Greedy contraction of a signed graph by a queue of its links.
#include "ao/cloud/signed_graph.h"

#include <cmath>
#include <queue>
#include <tuple>
#include <utility>

namespace scanshade {

void SignedGraph::add(std::uint32_t a, std::uint32_t b, double weight) {
    if (a == b)
        return;
    links_[a][b] += weight;
    links_[b][a] += weight;
}

std::vector<std::int8_t> SignedGraph::signs(double least) const {
    struct Entry {
        double strength;
        std::uint32_t a, b; ///< a < b
        double weight;
        bool operator<(const Entry& other) const {
            return std::tie(strength, other.a, other.b) < std::tie(other.strength, a, b);
        }
    };
    auto links = links_;
    std::priority_queue<Entry> queue;
    const auto offer = [&](std::uint32_t a, std::uint32_t b, double weight) {
        if (std::abs(weight) >= least && weight != 0)
            queue.push({std::abs(weight), std::min(a, b), std::max(a, b), weight});
    };
    for (std::uint32_t a = 0; a < links.size(); ++a)
        for (const auto& [b, weight] : links[a])
            if (a < b)
                offer(a, b, weight);
    std::vector<std::vector<std::uint32_t>> members(links.size());
    for (std::uint32_t node = 0; node < members.size(); ++node)
        members[node] = {node};
    std::vector<std::int8_t> signs(links.size(), 1);
    while (!queue.empty()) {
        const Entry entry = queue.top();
        queue.pop();
        std::uint32_t kept = entry.a, gone = entry.b;
        const auto link = links[kept].find(gone);
        if (link == links[kept].end() || link->second != entry.weight) // has changed since, or an end is gone
            continue;
        if (links[kept].size() + members[kept].size() < links[gone].size() + members[gone].size())
            std::swap(kept, gone);
        const std::int8_t turn = entry.weight < 0 ? -1 : 1;
        for (const std::uint32_t member : members[gone])
            signs[member] = static_cast<std::int8_t>(signs[member] * turn);
        members[kept].insert(members[kept].end(), members[gone].begin(), members[gone].end());
        members[gone] = {};
        for (const auto& [other, weight] : links[gone]) {
            links[other].erase(gone);
            if (other == kept)
                continue;
            double& sum = links[kept][other];
            sum += turn * weight;
            links[other][kept] = sum;
            offer(kept, other, sum);
        }
        links[gone] = {};
    }
    return signs;
}

} // namespace scanshade
