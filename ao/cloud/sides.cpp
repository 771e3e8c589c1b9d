// Sides of planes by shared free space and by stations; see the header for the idea.
#include "ao/cloud/sides.h"

#include "ao/cloud/patches.h"
#include "projection/hash.h"
#include "projection/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3f;
using Link = SignedGraph::Link;
using Signs = std::vector<std::int8_t>;

constexpr std::size_t bundle = DiscRays::together;

/// The size of a cloud as seen from its middle.
struct Reach {
    Vector3f centre;
    float usual = 0, far = 0; ///< distances from the centre: the median, 98 %
};

Reach reach_of(const CloudSurface& surface) {
    constexpr std::size_t enough = 50000;
    const std::size_t step = std::max<std::size_t>(1, surface.size() / enough);
    std::vector<Vector3f> some;
    for (std::size_t i = 0; i < surface.size(); i += step)
        if (!surface.normals[i].isZero())
            some.push_back(surface.tree[i]);
    Reach reach{Vector3f::Zero()};
    if (some.empty())
        return reach;
    std::vector<float> values(some.size());
    for (int axis = 0; axis < 3; ++axis) {
        std::transform(some.begin(), some.end(), values.begin(), [&](const Vector3f& at) { return at[axis]; });
        reach.centre[axis] = ranked(values, values.size() / 2);
    }
    std::transform(some.begin(), some.end(), values.begin(),
                   [&](const Vector3f& at) { return (at - reach.centre).norm(); });
    reach.usual = ranked(values, values.size() / 2);
    reach.far = quantile(values, 0.98);
    return reach;
}

/// A ray that left one plane and met another.
struct RayHit {
    std::uint32_t from, to; ///< indices in the tree
    std::int8_t sign;       ///< +1: both sides are their normals', or neither is
    float distance;
    Vector3f direction;
};

std::vector<RayHit> shoot(const CloudSurface& surface, const DiscRays& rays, std::size_t points) {
    const std::size_t asked = std::min(points, surface.size());
    const DirectionSet directions(bundle, 1);
    std::vector<std::array<RayHit, 2 * bundle>> met(asked);
    std::vector<std::uint8_t> counts(asked, 0);
    tbb::parallel_for(std::size_t(0), asked, [&](std::size_t k) {
        const std::size_t index = (2 * k + 1) * surface.size() / (2 * asked);
        const Vector3f& normal = surface.normals[index];
        if (normal.isZero() || !(surface.disc_radius[index] > 0))
            return;
        constexpr float least = 0.1F; // grazing hits say nothing
        for (const int side : {1, -1}) {
            const DiscRays::Hits hits =
                rays.first_hits(index, static_cast<float>(side) * normal, directions.run(2 * k + (side < 0)));
            for (std::size_t i = 0; i < bundle; ++i)
                if (std::isfinite(hits.distance[i]) && std::abs(hits.facing[i]) >= least)
                    met[k][counts[k]++] = {static_cast<std::uint32_t>(index), hits.index[i],
                                           static_cast<std::int8_t>(hits.facing[i] < 0 ? -side : side),
                                           hits.distance[i], hits.direction[i]};
        }
    });
    std::vector<RayHit> all;
    for (std::size_t k = 0; k < asked; ++k)
        all.insert(all.end(), met[k].begin(), met[k].begin() + counts[k]);
    return all;
}

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

/// Candidate stations and what they see of some points.
class Stations {
  public:
    Stations(const CloudSurface& surface, const DiscRays& rays, const std::vector<RayHit>& hits, const Reach& reach,
             const std::optional<Vector3f>& up, const SidesEffort& effort)
        : surface_(surface), up_(up), centre_(reach.centre) {
        add_near(hits, reach, effort.stations);
        near_ = positions_.size();
        for (const Eigen::Vector3d& direction : spread_directions(64))
            positions_.emplace_back(reach.centre + 3 * reach.far * direction.cast<float>());
        for (std::size_t k = 0; k < effort.tests; ++k) {
            const std::size_t index = (2 * k + 1) * surface.size() / (2 * effort.tests);
            if (!surface.normals[index].isZero() && (tests_.empty() || tests_.back() != index))
                tests_.push_back(static_cast<std::uint32_t>(index));
        }
        for (const std::uint32_t index : tests_) {
            const double disc = static_cast<double>(std::max(surface.disc_radius[index], 1e-30F));
            density_.push_back(std::log(static_cast<double>(surface.weight(index))) - 2 * std::log(disc));
        }
        seen_.resize(positions_.size() * tests_.size());
        tbb::parallel_for(std::size_t(0), positions_.size(), [&](std::size_t c) {
            for (std::size_t t = 0; t < tests_.size(); ++t)
                seen_[c * tests_.size() + t] = static_cast<std::int8_t>(rays.seen_from(tests_[t], positions_[c]));
        });
        const auto counts_here = [&](std::size_t c) {
            return c < near_ || !up_ ||
                   (positions_[c] - reach.centre).dot(*up_) >= -0.1F * (positions_[c] - reach.centre).norm();
        };
        for (std::size_t c = 0; c < positions_.size(); ++c)
            counts_.push_back(counts_here(c));
    }

    [[nodiscard]] const std::vector<std::uint32_t>& tests() const { return tests_; }
    [[nodiscard]] std::size_t near() const { return near_; }
    [[nodiscard]] const Vector3f& position(std::size_t c) const { return positions_[c]; }
    [[nodiscard]] std::size_t size() const { return positions_.size(); }
    /// +1: station c sees the front of test t, under `labels` (by test); -1: its back; 0: nothing.
    [[nodiscard]] int seen(std::size_t c, std::size_t t, const Signs& labels) const {
        return seen_[c * tests_.size() + t] * labels[t];
    }

    /// The same under the surface's own normals.
    [[nodiscard]] int seen(std::size_t c, std::size_t t) const { return seen_[c * tests_.size() + t]; }
    /// How many pairs of station and test see each other.
    [[nodiscard]] double all_seen() const {
        return static_cast<double>(seen_.size()) - static_cast<double>(std::count(seen_.begin(), seen_.end(), 0));
    }

    /// Share of the tests that lie in large planes with nearly everything on one side, as walls, floor and ceiling
    /// bound a room. Of things with round shapes next to none do.
    [[nodiscard]] double boxed(float size) const {
        constexpr double large = 0.03, beyond_at_most = 0.02;
        const float thick = 0.01F * size;
        std::vector<char> bounding(tests_.size(), 0);
        tbb::parallel_for(std::size_t(0), tests_.size(), [&](std::size_t t) {
            const Vector3f& at = surface_.tree[tests_[t]];
            const Vector3f& normal = surface_.normals[tests_[t]];
            std::size_t above = 0, below = 0, within = 0;
            for (const std::uint32_t other : tests_) {
                const float height = (surface_.tree[other] - at).dot(normal);
                above += height > thick;
                below += height < -thick;
                within += std::abs(height) <= thick && std::abs(surface_.normals[other].dot(normal)) > 0.98F;
            }
            const auto all = static_cast<double>(tests_.size());
            bounding[t] = static_cast<double>(std::min(above, below)) <= beyond_at_most * all &&
                          static_cast<double>(within) >= large * all;
        });
        return tests_.empty() ? 0
                              : static_cast<double>(std::count(bounding.begin(), bounding.end(), 1)) /
                                    static_cast<double>(tests_.size());
    }

    /// The mean rise of the tests' fronts: 1 where all look up.
    [[nodiscard]] double rise(const Signs& labels) const {
        double sum = 0;
        for (std::size_t t = 0; t < tests_.size(); ++t)
            sum += static_cast<double>(surface_.normals[tests_[t]].dot(up_.value_or(Vector3f::UnitZ()))) * labels[t];
        return sum / std::max(static_cast<double>(tests_.size()), 1.0);
    }

    struct Cover {
        double share = 0; ///< of the tests: fronts seen, less twice the backs
        std::vector<std::size_t> chosen;
    };
    /// The few stations that explain a labelling best, one after the other.
    [[nodiscard]] Cover cover(const Signs& labels) const {
        constexpr std::size_t most = 16;
        const double least = std::max(0.002 * static_cast<double>(tests_.size()), 1.0);
        Cover cover;
        std::vector<char> known(tests_.size(), 0);
        while (cover.chosen.size() < most) {
            double best = 0;
            std::size_t chosen = 0;
            for (std::size_t c = 0; c < positions_.size(); ++c) {
                if (!counts_[c])
                    continue;
                double gain = 0;
                for (std::size_t t = 0; t < tests_.size(); ++t) {
                    const int sign = seen(c, t, labels);
                    gain += sign < 0 ? -2 : sign > 0 && !known[t] ? 1 : 0;
                }
                if (gain > best) {
                    best = gain;
                    chosen = c;
                }
            }
            if (best < least)
                break;
            cover.chosen.push_back(chosen);
            cover.share += best / static_cast<double>(tests_.size());
            for (std::size_t t = 0; t < tests_.size(); ++t)
                known[t] |= seen(chosen, t, labels) > 0;
        }
        return cover;
    }

    /// Share of the tests whose front at least three far stations see.
    [[nodiscard]] double seen_from_afar(const Signs& labels) const {
        std::size_t well = 0;
        for (std::size_t t = 0; t < tests_.size(); ++t) {
            int fronts = 0;
            for (std::size_t c = near_; c < positions_.size(); ++c)
                fronts += seen(c, t, labels) > 0;
            well += fronts >= 3;
        }
        return tests_.empty() ? 0 : static_cast<double>(well) / static_cast<double>(tests_.size());
    }
    /// Fronts among all that far stations see.
    [[nodiscard]] double fronts_from_afar(const Signs& labels) const {
        double fronts = 0, all = 0;
        for (std::size_t c = near_; c < positions_.size(); ++c)
            for (std::size_t t = 0; t < tests_.size(); ++t) {
                fronts += seen(c, t, labels) > 0;
                all += seen(c, t, labels) != 0;
            }
        return all > 0 ? fronts / all : 0;
    }
    /// How well the density of the points is that of scans: the correlation of its logarithm with that of what a few
    /// stations would make together, each cosine / distance^2, or more towards their poles, as beams of equal angles
    /// have it. -1 where no station sees much. From `within`: near stations; else those round the cloud, at distances
    /// that scanners round a body stand at.
    [[nodiscard]] double density_fits(const Signs& labels, bool within) const {
        std::vector<std::vector<double>> made[2]; // by kind of scanner and station: density by test
        for (std::size_t c = within ? 0 : near_; c < (within ? near_ : size()); ++c) {
            std::size_t fronts = 0, backs = 0;
            for (std::size_t t = 0; t < tests_.size(); ++t) {
                fronts += seen(c, t, labels) > 0;
                backs += seen(c, t, labels) < 0;
            }
            if (10 * fronts < tests_.size() || 20 * backs > fronts + backs)
                continue;
            for (const float nearer : within ? std::vector<float>{1} : std::vector<float>{1, 2.0F / 3, 0.45F}) {
                const Vector3f position = centre_ + nearer * (positions_[c] - centre_);
                for (auto& of_kind : made)
                    of_kind.emplace_back(tests_.size(), 0.0);
                for (std::size_t t = 0; t < tests_.size(); ++t) {
                    if (seen(c, t, labels) <= 0)
                        continue;
                    const Vector3f apart = position - surface_.tree[tests_[t]];
                    const Vector3f towards = apart.normalized();
                    const double even =
                        static_cast<double>(std::abs(towards.dot(surface_.normals[tests_[t]])) / apart.squaredNorm());
                    const float rise = towards.dot(up_.value_or(Vector3f::UnitZ()));
                    made[0].back()[t] = even;
                    made[1].back()[t] = even / static_cast<double>(std::sqrt(std::max(1 - rise * rise, 0.01F)));
                }
            }
        }
        return std::max(best_fit(made[0]), best_fit(made[1]));
    }

    /// The chosen ones first, then those that see most fronts and few backs.
    [[nodiscard]] std::vector<std::size_t> best(std::vector<std::size_t> chosen, const Signs& labels,
                                                std::size_t most) const {
        std::vector<std::pair<double, std::size_t>> others;
        for (std::size_t c = 0; c < positions_.size(); ++c) {
            if (!counts_[c] || std::find(chosen.begin(), chosen.end(), c) != chosen.end())
                continue;
            double worth = 0;
            for (std::size_t t = 0; t < tests_.size(); ++t) {
                const int sign = seen(c, t, labels);
                worth += sign < 0 ? -3 : sign;
            }
            if (worth > 0)
                others.emplace_back(-worth, c);
        }
        std::sort(others.begin(), others.end());
        for (std::size_t k = 0; k < others.size() && chosen.size() < most; ++k)
            chosen.push_back(others[k].second);
        return chosen;
    }

  private:
    /// The correlation that the best few of these densities reach together; the next is added while that helps.
    [[nodiscard]] double best_fit(const std::vector<std::vector<double>>& made) const {
        constexpr std::size_t most = 8;
        constexpr double helps = 0.01;
        std::vector<double> sum(tests_.size(), 0.0), fits(made.size());
        double best = -1;
        for (std::size_t round = 0; round < most && !made.empty(); ++round) {
            tbb::parallel_for(std::size_t(0), made.size(), [&](std::size_t c) { fits[c] = fit(sum, made[c]); });
            const auto next = std::max_element(fits.begin(), fits.end());
            if (*next < best + helps)
                break;
            best = *next;
            const std::vector<double>& chosen = made[static_cast<std::size_t>(next - fits.begin())];
            std::transform(sum.begin(), sum.end(), chosen.begin(), sum.begin(), std::plus());
        }
        return best;
    }
    [[nodiscard]] double fit(const std::vector<double>& one, const std::vector<double>& other) const {
        double n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
        for (std::size_t t = 0; t < tests_.size(); ++t) {
            const double both = one[t] + other[t];
            if (!(both > 0))
                continue;
            const double expected = std::log(both), density = density_[t];
            n += 1, x += expected, y += density;
            xx += expected * expected, yy += density * density, xy += expected * density;
        }
        if (n < 0.3 * static_cast<double>(tests_.size()))
            return -1;
        constexpr double even = 0.6; // the logarithm's standard deviation where nothing but chance makes it
        if ((yy - y * y / n) / n < even * even)
            return -1;
        const double spread = (xx - x * x / n) * (yy - y * y / n);
        return spread > 0 ? (xy - x * y / n) / std::sqrt(spread) : -1;
    }

    /// On rays through free space, or the space behind: long ones are likelier.
    void add_near(const std::vector<RayHit>& hits, const Reach& reach, std::size_t count) {
        std::vector<double> up_to;
        double sum = 0;
        for (const RayHit& ray : hits)
            up_to.push_back(sum += static_cast<double>(std::min(ray.distance, 2 * reach.usual)));
        for (std::size_t k = 0; k < count && sum > 0; ++k) {
            const double at = (static_cast<double>(k) + 0.5) / static_cast<double>(count) * sum;
            const auto ray =
                static_cast<std::size_t>(std::upper_bound(up_to.begin(), up_to.end() - 1, at) - up_to.begin());
            const RayHit& chosen = hits[ray];
            const float along = 0.2F + 0.6F * static_cast<float>(hash(static_cast<std::uint32_t>(k)) * 0x1p-32);
            positions_.push_back(surface_.tree[chosen.from] + along * chosen.distance * chosen.direction);
        }
    }

    const CloudSurface& surface_;
    std::optional<Vector3f> up_;
    Vector3f centre_;
    std::vector<Vector3f> positions_; ///< the near ones first
    std::size_t near_ = 0;
    std::vector<std::uint32_t> tests_;
    std::vector<double> density_;   ///< its logarithm, by test
    std::vector<std::int8_t> seen_; ///< by station and test, under the surface's own normals
    std::vector<char> counts_;      ///< whether a station may explain a labelling
};

/// The sign of the whole labelling.
struct Decision {
    int sign = 1;
    bool body = false; ///< closed, seen from all round
    bool lost = false; ///< no station sees clean fronts
    std::vector<std::size_t> chosen;
    std::string why{};
    double margin = 0;
    std::optional<std::string> doubt{};
};

/// What decides between a labelling and its opposite.
struct Scene {
    const Reach& reach;
    bool up_known = false;
    double front_meets = 0.5; ///< share of the rays that met something, that left fronts
};

Decision decide(const Stations& stations, const Signs& labels, const Scene& scene, SidesRule rule) {
    Signs other = labels;
    for (std::int8_t& label : other)
        label = static_cast<std::int8_t>(-label);
    const auto labels_of = [&](int sign) -> const Signs& { return sign > 0 ? labels : other; };
    const auto at = [](int sign) { return sign > 0 ? 0 : 1; };
    const Stations::Cover covers[] = {stations.cover(labels), stations.cover(other)};
    const double shares[] = {std::clamp(covers[0].share, 0.0, 1.0), std::clamp(covers[1].share, 0.0, 1.0)};
    const int inner = scene.front_meets > 0.5 ? 1 : -1, covered = shares[0] >= shares[1] ? 1 : -1;
    const double fronts = stations.fronts_from_afar(labels_of(-inner)),
                 afar = stations.seen_from_afar(labels_of(-inner)),
                 within = stations.density_fits(labels_of(inner), true),
                 outside = stations.density_fits(labels_of(-inner), false), boxed = stations.boxed(scene.reach.far);
    constexpr double scanned_within = 0.4, clearly_better = 0.1; // correlations of density with stations' distances
    constexpr double walled = 0.3, hardly_walled = 0.1;          // shares of the points in walls that bound the cloud
    constexpr double empty = 0.02; // of the rays that meet something, those from the outer side
    // Between shares of points that stations explain. Through the shadows of furniture, walls are seen from behind.
    constexpr double tie = 0.05, near_tie = 0.1, walled_tie = 0.2;
    constexpr double hardly_explained = 0.7; // share of the points
    constexpr double level = 0.35;           // mean rise of the fronts: terrain has it, rooms and halls have none
    const double outer_meets = std::min(scene.front_meets, 1 - scene.front_meets);
    Decision decision;
    const double margin = std::abs(shares[0] - shares[1]);
    const auto explained = [&](int sign) {
        return fmt::format("{} places see {:.0f} % of the points from the front", covers[at(sign)].chosen.size(),
                           100 * shares[at(sign)]);
    };
    if (rule == SidesRule::outward || rule == SidesRule::inward) {
        decision.sign = rule == SidesRule::outward ? -inner : inner;
        decision.body = rule == SidesRule::outward;
    } else if (const double rise = stations.rise(labels); rule == SidesRule::terrain && std::abs(rise) > level) {
        decision.sign = rise > 0 ? 1 : -1;
    } else if (const bool body = fronts >= 0.9 && afar >= 0.97; body || margin < (boxed > walled ? walled_tie : tie)) {
        // Both sides could be the scanned one: a closed room looks like a body from outside. Walls and floors tell,
        // less so the density of the points.
        const bool room =
            boxed > (body ? walled : hardly_walled) || within > std::max(scanned_within, outside + clearly_better);
        const bool sure_room = boxed > walled && outer_meets > empty;
        decision.sign = room ? inner : -inner;
        decision.body = body && !room;
        if (room)
            decision.why = fmt::format("inward, as of a room: {}", explained(inner));
        else if (body)
            decision.why = fmt::format("outward, as of a body: {:.0f} % of it is seen from all round", 100 * afar);
        else
            decision.why = "to the outer side of a shell";
        if (room ? !sure_room : !body || within > std::max(scanned_within, outside))
            decision.doubt = fmt::format("both sides of all surfaces could be the scanned one, as of a room and of a "
                                         "body of its shape: the {} one was taken; --cloud.outside sets it",
                                         room ? "inner" : "outer");
    } else {
        decision.sign = covered;
        decision.margin = margin;
        decision.why = "to where a scanner could stand: " + explained(covered);
        if (margin < near_tie && !(covered == inner && boxed > walled))
            decision.doubt = fmt::format("the other side of all surfaces explains the cloud nearly as well ({:.0f} % "
                                         "against {:.0f} %); --cloud.outside sets it",
                                         100 * shares[at(-covered)], 100 * shares[at(covered)]);
        else if (!scene.up_known && shares[at(covered)] < hardly_explained)
            decision.doubt = fmt::format("the places where a scanner could have stood see only {:.0f} % of the points "
                                         "from the front, as among plants; --cloud.outside sets the side",
                                         100 * shares[at(covered)]);
    }
    decision.chosen = covers[at(decision.sign)].chosen;
    if (scene.up_known && rule != SidesRule::outward && rule != SidesRule::inward && !decision.body &&
        shares[at(decision.sign)] < 0.6) {
        decision.lost = true;
        decision.doubt.reset();
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
};

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
    double front_meets = 0, meets = 0;
    for (const RayHit& ray : hits) {
        const bool normal_side = ray.direction.dot(surface.normals[ray.from]) > 0;
        front_meets += (label[patches.patch[ray.from]] * patches.sign(ray.from) > 0) == normal_side;
        meets += 1;
    }
    Decision decision =
        decide(stations, of_tests, {reach, up.has_value(), meets > 0 ? front_meets / meets : 0.5}, rule);
    for (Signs* signs : {&label, &of_tests})
        for (std::int8_t& sign : *signs)
            sign = static_cast<std::int8_t>(sign * decision.sign);
    if (decision.lost)
        return {label, facing(surface, patches, label, *up), std::move(decision)};

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
    return {std::move(label), std::move(evidence), std::move(decision)};
}

} // namespace

Sides sides_of(const CloudSurface& surface, const DiscRays* rays, const std::optional<Vector3f>& up, SidesRule rule,
               const SidesEffort& effort) {
    Sides sides{Signs(surface.size(), 1), std::vector<float>(surface.size(), 0.0F), {}, 0, {}};
    const Reach reach = reach_of(surface);
    if (!(reach.far > 0)) {
        sides.why = "as estimated: there are no surfaces to tell sides by";
        return sides;
    }
    const SurePairs pairs(surface);
    const Patches patches = patches_of(surface, pairs);
    const std::vector<Link> near = surface_links(surface, pairs, patches);
    auto [label, evidence, decision] = [&]() -> Judged {
        if (rule != SidesRule::up)
            return judged(surface, *rays, patches, near, up, rule, effort, reach);
        Signs all(patches.count, 1);
        return {all, facing(surface, patches, all, up.value_or(Vector3f::UnitZ())), {}};
    }();
    sides.why = decision.why;
    sides.doubt = decision.doubt;
    sides.margin = decision.margin;

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

Sides sides_to(const CloudSurface& surface, const Vector3f& position) {
    Sides sides{Signs(surface.size(), 1), std::vector<float>(surface.size(), 1.0F), {}, 0, {}};
    std::vector<float> towards(surface.size()); // cosines
    for (std::size_t i = 0; i < surface.size(); ++i)
        towards[i] = surface.normals[i].dot((position - surface.tree[i]).stableNormalized());
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        float votes = towards[i];
        for (const std::uint32_t j : surface.near[i])
            if (j != i)
                votes += surface.normals[i].dot(surface.normals[j]) * towards[j];
        if (votes < 0)
            sides.sign[i] = -1;
    });
    return sides;
}

RecordedSides recorded_sides(const CloudSurface& surface) {
    const Patches patches = patches_of(surface, SurePairs(surface));
    std::vector<std::array<std::uint32_t, 2>> kinds(patches.count, {0, 0});
    for (std::size_t i = 0; i < surface.size(); ++i)
        ++kinds[patches.patch[i]][patches.turned[i] ? 1 : 0];
    // Heights over their neighbours, along the patch's side, of both kinds: sums for a t test.
    struct Heights {
        double sum[2] = {0, 0}, squares[2] = {0, 0};
    };
    std::vector<Heights> heights(patches.count);
    constexpr std::uint32_t fewest = 8;
    const auto mixed = [&](std::uint32_t patch) {
        const auto [one, other] = kinds[patch];
        return one + other >= fewest && 10 * std::min(one, other) >= one + other;
    };
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const std::uint32_t patch = patches.patch[i];
        if (!mixed(patch) || !(surface.disc_radius[i] > 0))
            continue;
        const Vector3f side = static_cast<float>(patches.sign(i)) * surface.normals[i];
        float mean = 0;
        for (const std::uint32_t j : surface.near[i])
            mean += (surface.tree[i] - surface.tree[j]).dot(side) / CloudSurface::kept;
        const double height = static_cast<double>(mean / surface.disc_radius[i]);
        heights[patch].sum[patches.turned[i] ? 1 : 0] += height;
        heights[patch].squares[patches.turned[i] ? 1 : 0] += height * height;
    }
    double all = 0, random = 0, opposed = 0;
    for (std::uint32_t patch = 0; patch < patches.count; ++patch) {
        const double one = kinds[patch][0], other = kinds[patch][1];
        if (one + other < fewest)
            continue;
        all += one + other;
        if (!mixed(patch))
            continue;
        const Heights& h = heights[patch];
        const double mean_one = h.sum[0] / one, mean_other = h.sum[1] / other;
        const double error =
            (h.squares[0] / one - mean_one * mean_one) / one + (h.squares[1] / other - mean_other * mean_other) / other;
        constexpr double surely = 3;
        if (error > 0 && (mean_one - mean_other) / std::sqrt(error) > surely)
            continue; // two sheets: those that face a side stand on it
        random += one + other;
        opposed += std::min(one, other);
    }
    return all > 0 ? RecordedSides{random / all, opposed / all} : RecordedSides{};
}

} // namespace scanshade
