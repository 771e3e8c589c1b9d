// Signs of a graph's nodes by its leading eigenvector.
#include "ao/cloud/signed_graph.h"

#include "projection/hash.h"

#include <algorithm>
#include <cmath>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

/// Links by node, in rows: each is there for both of its ends.
struct Rows {
    struct To {
        std::uint32_t node;
        float weight;
    };
    std::vector<std::size_t> starts;
    std::vector<To> links;

    Rows(std::size_t nodes, const std::vector<SignedGraph::Link>& all) : starts(nodes + 2, 0) {
        for (const auto& link : all)
            ++starts[link.a + 2], ++starts[link.b + 2];
        for (std::size_t node = 2; node < starts.size(); ++node)
            starts[node] += starts[node - 1];
        links.resize(starts.back());
        for (const auto& link : all) {
            links[starts[link.a + 1]++] = {link.b, static_cast<float>(link.weight)};
            links[starts[link.b + 1]++] = {link.a, static_cast<float>(link.weight)};
        }
        starts.pop_back();
    }
    [[nodiscard]] std::size_t size() const { return starts.size() - 1; }
    /// Sums `of(link)` over the links of a node, in their order.
    template <class Of>
    [[nodiscard]] double sum(std::size_t node, Of&& of) const {
        double sum = 0;
        for (std::size_t k = starts[node]; k < starts[node + 1]; ++k)
            sum += of(links[k]);
        return sum;
    }
};

std::vector<double> leading_eigenvector(const Rows& rows) {
    constexpr int rounds = 100;
    constexpr double shift = 0.3; // eigenvalues lie within -1 .. 1: without it, the most negative one might lead
    const std::size_t size = rows.size();
    std::vector<double> scale(size), found(size), next(size), scaled(size);
    const auto for_each = [size](auto&& visit) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, size, 256), [&](const auto& range) {
            for (std::size_t node = range.begin(); node < range.end(); ++node)
                visit(node);
        });
    };
    for_each([&](std::size_t node) {
        const double weight =
            rows.sum(node, [](const Rows::To& to) { return std::abs(static_cast<double>(to.weight)); });
        scale[node] = weight > 0 ? 1 / std::sqrt(weight) : 0;
        found[node] = (hash(static_cast<std::uint32_t>(node)) & 1 ? 1 : -1) * std::sqrt(weight);
    });
    for (int round = 0; round < rounds; ++round) {
        for_each([&](std::size_t node) { scaled[node] = scale[node] * found[node]; });
        for_each([&](std::size_t node) {
            next[node] = shift * found[node] + scale[node] * rows.sum(node, [&](const Rows::To& to) {
                return static_cast<double>(to.weight) * scaled[to.node];
            });
        });
        found.swap(next);
    }
    return found;
}

} // namespace

void SignedGraph::add(std::uint32_t a, std::uint32_t b, double weight) {
    if (a != b)
        links_.push_back({a, b, weight});
}

std::vector<std::int8_t> SignedGraph::signs() const {
    const Rows rows(nodes_, links_);
    const std::vector<double> eigenvector = leading_eigenvector(rows);
    std::vector<std::int8_t> signs(nodes_);
    std::transform(eigenvector.begin(), eigenvector.end(), signs.begin(),
                   [](double value) { return static_cast<std::int8_t>(value < 0 ? -1 : 1); });
    constexpr int most_rounds = 100; // each turn makes the sum larger, so that there is an end
    for (int round = 0; round < most_rounds; ++round) {
        bool any = false;
        for (std::size_t node = 0; node < nodes_; ++node) {
            const double agreed =
                rows.sum(node, [&](const Rows::To& to) { return static_cast<double>(to.weight) * signs[to.node]; });
            if (agreed * signs[node] < 0) {
                signs[node] = static_cast<std::int8_t>(-signs[node]);
                any = true;
            }
        }
        if (!any)
            break;
    }
    return signs;
}

} // namespace scanshade
