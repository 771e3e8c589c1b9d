// Sides of planes by shared free space and by stations; see the header for the idea.
#include "ao/cloud/sides/sides.h"

#include "ao/cloud/sides/stations.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numeric>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3f;
using Link = SignedGraph::Link;

std::vector<Link> ray_links(const std::vector<RayHit>& hits, const Patches& patches, float usual) {
    std::vector<Link> links;
    for (const RayHit& ray : hits) {
        const std::uint32_t a = patches.patch[ray.from], b = patches.patch[ray.to];
        if (a == b)
            continue;
        const double weight = static_cast<double>(ray.distance / (ray.distance + 0.2F * usual));
        links.push_back(
            {std::min(a, b), std::max(a, b), ray.sign * patches.sign(ray.from) * patches.sign(ray.to) * weight});
    }
    return summed(std::move(links));
}

double strength(const std::vector<Link>& links) {
    return std::accumulate(links.begin(), links.end(), 0.0,
                           [](double sum, const Link& link) { return sum + std::abs(link.weight); });
}

/// The sign of the whole labelling.
struct Decision {
    int sign = 1;
    bool body = false; ///< closed, seen from all round
    bool lost = false; ///< no station sees clean fronts
    std::vector<std::size_t> chosen;
    std::string why{};
    double explained = 0;
    bool sure = false;
    std::optional<Finding> finding{};
    std::optional<SideSigns> signs{};
    bool inner = false;
};

/// What decides between a labelling and its opposite, besides stations.
struct Scene {
    bool up_known = false;
    float far = 0;            ///< Reach::far
    double meets[2] = {0, 0}; ///< shares of the rays from fronts, and from backs, that meet something
    double smallest = 0;      ///< extent along the axes
};

Decision decide(const Stations& stations, const Signs& labels, const Scene& scene, SidesRule rule) {
    Signs other = labels;
    for (std::int8_t& label : other)
        label = static_cast<std::int8_t>(-label);
    const auto labels_of = [&](int sign) -> const Signs& { return sign > 0 ? labels : other; };
    const auto at = [](int sign) { return sign > 0 ? 0 : 1; };
    const Stations::Cover covers[] = {stations.cover(labels), stations.cover(other)};
    const int inner = scene.meets[0] > scene.meets[1] ? 1 : -1;
    const Stations::Cover &of_inner = covers[at(inner)], &of_outer = covers[at(-inner)];
    const SideSigns signs{.inner_cover = of_inner.share,
                          .outer_cover = of_outer.share,
                          .inner_stations = static_cast<double>(of_inner.chosen.size()),
                          .outer_stations = static_cast<double>(of_outer.chosen.size()),
                          .inner_meets = scene.meets[at(inner)],
                          .outer_meets = scene.meets[at(-inner)],
                          .fronts = stations.fronts_from_afar(labels_of(-inner)),
                          .afar = stations.seen_from_afar(labels_of(-inner)),
                          .within = stations.density_fits(labels_of(inner)),
                          .boxed = stations.boxed(scene.far),
                          .rise = stations.rise(labels_of(inner)),
                          .up_known = scene.up_known,
                          .smallest_m = scene.smallest};
    constexpr double level = 0.35; // mean rise of the fronts: terrain has it, rooms and halls have none
    Decision decision;
    decision.signs = signs;
    if (rule == SidesRule::outward || rule == SidesRule::inward) {
        decision.sign = rule == SidesRule::outward ? -inner : inner;
        decision.body = rule == SidesRule::outward;
    } else if (rule == SidesRule::terrain && std::abs(signs.rise) > level) {
        decision.sign = signs.rise > 0 ? inner : -inner;
    } else {
        constexpr double doubtful = 0.1, unlikely = 0.01; // probabilities of the other answer
        constexpr double hardly_explained = 0.7; // share of the points: among plants no station sees clean fronts
        const double probability = inner_probability(signs);
        decision.sign = probability > 0.5 ? inner : -inner;
        const bool nothing_known = !scene.up_known && covers[at(decision.sign)].share < hardly_explained;
        const double wrong = nothing_known ? 0.5 : std::min(probability, 1 - probability);
        decision.body = decision.sign != inner && signs.fronts >= 0.9 && signs.afar >= 0.97;
        decision.sure = wrong < unlikely;
        const Stations::Cover& cover = covers[at(decision.sign)];
        decision.why = fmt::format("{}: {} places see {:.0f} % of the points from the front",
                                   decision.sign == inner ? "inward, as of rooms" : "outward, as of bodies and grounds",
                                   cover.chosen.size(), 100 * std::clamp(cover.share, 0.0, 1.0));
        decision.finding = {Check::sides, wrong, doubtful, {}};
        if (wrong > doubtful)
            decision.finding->sentence = fmt::format("the {} sides of all surfaces were taken, and the opposite has a "
                                                     "chance of {:.0f} %; --cloud.outside sets them.",
                                                     decision.sign == inner ? "inner" : "outer", 100 * wrong);
    }
    decision.inner = decision.sign == inner;
    decision.chosen = covers[at(decision.sign)].chosen;
    decision.explained = std::clamp(covers[at(decision.sign)].share, 0.0, 1.0);
    if (scene.up_known && rule != SidesRule::outward && rule != SidesRule::inward && !decision.body &&
        decision.explained < 0.6) {
        decision.lost = true;
        decision.finding.reset();
        decision.why = "up, since no place of a scanner explains most of the surfaces (as among plants)";
    }
    return decision;
}

/// Votes of the stations for and against the side of each patch.
struct Votes {
    std::vector<double> sum, all; ///< by patch
};

Votes votes_of(const CloudSurface& surface, const DiscRays& rays, const Patches& patches, const Signs& label,
               const std::vector<Vector3f>& stations) {
    constexpr std::size_t wanted = 3;
    std::vector<std::array<std::uint32_t, wanted>> points(patches.count);
    std::vector<std::uint32_t> sizes(patches.count, 0), passed(patches.count, 0);
    std::vector<std::uint8_t> counts(patches.count, 0);
    for (std::size_t i = 0; i < surface.size(); ++i)
        ++sizes[patches.patch[i]];
    for (std::size_t i = 0; i < surface.size(); ++i) { // the first, and those a third and two thirds on
        const std::uint32_t patch = patches.patch[i];
        if (passed[patch]++ * wanted >= counts[patch] * sizes[patch] && counts[patch] < wanted &&
            !surface.normals[i].isZero())
            points[patch][counts[patch]++] = static_cast<std::uint32_t>(i);
    }
    Votes votes{std::vector<double>(patches.count, 0.0), std::vector<double>(patches.count, 0.0)};
    tbb::parallel_for(std::uint32_t(0), patches.count, [&](std::uint32_t patch) {
        for (std::size_t k = 0; k < counts[patch]; ++k) {
            const std::uint32_t index = points[patch][k];
            for (const Vector3f& station : stations) {
                const int seen = rays.seen_from(index, station);
                if (seen == 0)
                    continue;
                const double cosine = static_cast<double>(
                    std::abs((station - surface.tree[index]).normalized().dot(surface.normals[index])));
                votes.sum[patch] += seen * patches.sign(index) * label[patch] * cosine / counts[patch];
                votes.all[patch] += cosine / counts[patch];
            }
        }
    });
    return votes;
}

/// What is known of the sides of patches, for (positive) and against their label, and at most.
struct UnaryTerms {
    std::vector<double> stations, stations_most, rays, rays_most; ///< by patch

    explicit UnaryTerms(std::size_t patches)
        : stations(patches, 0.0), stations_most(patches, 0.0), rays(patches, 0.0), rays_most(patches, 0.0) {}
    [[nodiscard]] double sum(std::size_t patch) const { return 10 * stations[patch] + 0.3 * rays[patch]; }
    [[nodiscard]] double most(std::size_t patch) const { return 10 * stations_most[patch] + 0.3 * rays_most[patch]; }
};

UnaryTerms facing(const CloudSurface& surface, const Patches& patches, const Signs& label, const Vector3f& up) {
    UnaryTerms evidence(patches.count);
    std::vector<double> sizes(patches.count, 0.0);
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const std::uint32_t patch = patches.patch[i];
        const double rise = static_cast<double>(surface.normals[i].dot(up)) * patches.sign(i) * label[patch];
        evidence.stations[patch] += rise;
        evidence.stations_most[patch] += std::abs(rise);
        sizes[patch] += 1;
    }
    for (std::uint32_t patch = 0; patch < patches.count; ++patch) {
        evidence.stations[patch] /= std::max(sizes[patch], 1.0);
        evidence.stations_most[patch] /= std::max(sizes[patch], 1.0);
    }
    return evidence;
}

/// Signs of patches relative to each other, and what the stations and the rays say of them.
struct Judged {
    Signs label;
    UnaryTerms evidence;
    Decision decision;
    std::optional<double> explained_as_given{};
};

/// The smallest extent of the tests along the axes, without the outermost.
double smallest_extent(const CloudSurface& surface, const std::vector<std::uint32_t>& tests) {
    double smallest = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<float> along;
        for (const std::uint32_t index : tests)
            along.push_back(surface.tree[index][axis]);
        const auto low = static_cast<double>(quantile(along, 0.02)), high = static_cast<double>(quantile(along, 0.98));
        smallest = std::min(smallest, high - low);
    }
    return smallest;
}

Judged judged(const CloudSurface& surface, const DiscRays& rays, const Patches& patches, const std::vector<Link>& near,
              const std::optional<Vector3f>& up, SidesRule rule, const SidesEffort& effort, const Reach& reach) {
    const std::vector<RayHit> hits = shoot(surface, rays, effort.points);
    std::vector<Link> free = ray_links(hits, patches, reach.usual);
    if (const double all = strength(free); all > 0) { // rays correct what neighbours say, and do not outvote it
        const double scale = std::min(1.0, 0.7 * strength(near) / all);
        for (Link& link : free)
            link.weight *= scale;
    }
    const Stations stations(surface, rays, hits, reach, up, effort);
    // All that is seen from one station is seen through the same free space: every station is one more node.
    SignedGraph relative(patches.count + stations.size());
    for (const Link& link : near)
        relative.add(link.a, link.b, link.weight);
    for (const Link& link : free)
        relative.add(link.a, link.b, link.weight);
    const double of_station = 0.2 * strength(near) / std::max(stations.all_seen(), 1.0);
    for (std::size_t c = 0; c < stations.size(); ++c)
        for (std::size_t t = 0; t < stations.tests().size(); ++t)
            if (const std::uint32_t index = stations.tests()[t]; stations.seen(c, t) != 0)
                relative.add(patches.patch[index], static_cast<std::uint32_t>(patches.count + c),
                             stations.seen(c, t) * patches.sign(index) * std::min(of_station, 1.0));
    Signs label = relative.signs();
    label.resize(patches.count);

    Signs of_tests;
    for (const std::uint32_t index : stations.tests())
        of_tests.push_back(static_cast<std::int8_t>(label[patches.patch[index]] * patches.sign(index)));
    double meets[2] = {0, 0}; // from fronts, from backs
    const double shot = 8.0 * static_cast<double>(std::min(effort.points, surface.size()));
    for (const RayHit& ray : hits) {
        const bool normal_side = ray.direction.dot(surface.normals[ray.from]) > 0;
        const bool front = (label[patches.patch[ray.from]] * patches.sign(ray.from) > 0) == normal_side;
        meets[front ? 0 : 1] += 1 / shot;
    }
    Decision decision =
        decide(stations, of_tests,
               {up.has_value(), reach.far, {meets[0], meets[1]}, smallest_extent(surface, stations.tests())}, rule);
    std::optional<double> as_given;
    if (effort.given_too)
        as_given = stations.cover(Signs(of_tests.size(), 1)).share;
    for (Signs* signs : {&label, &of_tests})
        for (std::int8_t& sign : *signs)
            sign = static_cast<std::int8_t>(sign * decision.sign);
    if (decision.lost)
        return {label, facing(surface, patches, label, *up), std::move(decision), as_given};

    constexpr std::size_t most = 24;
    std::vector<std::size_t> chosen = decision.chosen;
    if (decision.body) {
        std::erase_if(chosen, [&](std::size_t c) { return c >= stations.near(); });
        for (std::size_t c = stations.near(); c < stations.size(); ++c)
            chosen.push_back(c);
    } else {
        chosen = stations.best(std::move(chosen), of_tests, most);
    }
    std::vector<Vector3f> positions;
    for (const std::size_t c : chosen)
        positions.push_back(stations.position(c));
    UnaryTerms evidence(patches.count);
    Votes votes = votes_of(surface, rays, patches, label, positions);
    evidence.stations = std::move(votes.sum);
    evidence.stations_most = std::move(votes.all);
    for (const Link& link : free) {
        const double agreed = link.weight * label[link.a] * label[link.b];
        for (const std::uint32_t patch : {link.a, link.b}) {
            evidence.rays[patch] += agreed;
            evidence.rays_most[patch] += std::abs(agreed);
        }
    }
    return {std::move(label), std::move(evidence), std::move(decision), as_given};
}

} // namespace

Sides sides_of(const CloudSurface& surface, const Patches& patches, const DiscRays* rays,
               const std::optional<Vector3f>& up, SidesRule rule, const SidesEffort& effort) {
    Sides sides{.sign = Signs(surface.size(), 1), .confidence = std::vector<float>(surface.size(), 0.0F), .why = {}};
    const Reach reach = reach_of(surface);
    if (!(reach.far > 0)) {
        sides.why = "as estimated: there are no surfaces to tell sides by";
        return sides;
    }
    const std::vector<Link>& near = patches.links;
    auto [label, evidence, decision, as_given] = [&]() -> Judged {
        if (rule != SidesRule::up)
            return judged(surface, *rays, patches, near, up, rule, effort, reach);
        Signs all(patches.count, 1);
        return {all, facing(surface, patches, all, up.value_or(Vector3f::UnitZ())), {}, {}};
    }();
    sides.why = decision.why;
    sides.finding = decision.finding;
    sides.sure = decision.sure;
    sides.signs = decision.signs;
    sides.inner = decision.inner;
    if (as_given) {
        sides.explained = decision.explained;
        sides.explained_as_given = as_given;
    }

    // One more node is the truth: it links to every patch by what was seen of it.
    SignedGraph absolute(patches.count + 1);
    const std::uint32_t truth = patches.count;
    for (const Link& link : near)
        absolute.add(link.a, link.b, link.weight * label[link.a] * label[link.b]);
    for (std::uint32_t patch = 0; patch < patches.count; ++patch)
        absolute.add(patch, truth, evidence.sum(patch) + 0.001);
    const Signs found = absolute.signs();
    Signs turn(patches.count);
    for (std::uint32_t patch = 0; patch < patches.count; ++patch) {
        turn[patch] = static_cast<std::int8_t>(found[patch] * found[truth]);
        label[patch] = static_cast<std::int8_t>(label[patch] * turn[patch]);
    }
    std::vector<double> agreed(patches.count, 0.0), most(patches.count, 0.0); // with neighbouring patches
    for (const Link& link : near)
        for (const std::uint32_t patch : {link.a, link.b}) {
            agreed[patch] += link.weight * label[link.a] * label[link.b];
            most[patch] += std::abs(link.weight);
        }
    tbb::parallel_for(std::size_t(0), surface.size(), [&, &label = label, &evidence = evidence](std::size_t i) {
        const std::uint32_t patch = patches.patch[i];
        sides.sign[i] = static_cast<std::int8_t>(label[patch] * patches.sign(i));
        const double known = turn[patch] * evidence.sum(patch) + 0.3 * agreed[patch];
        sides.confidence[i] =
            static_cast<float>(std::clamp(known / (evidence.most(patch) + 0.3 * most[patch] + 2), 0.0, 1.0));
    });
    return sides;
}

} // namespace scanshade
