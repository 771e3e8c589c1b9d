// Stations: drawn from free space, judged by fronts and backs.
#include "ao/cloud/sides/stations.h"

#include "projection/base/hash.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <tbb/parallel_for.h>

namespace scanshade {

using Eigen::Vector3f;

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

std::vector<RayHit> shoot(const CloudSurface& surface, const DiscRays& rays, std::size_t points) {
    const std::size_t asked = std::min(points, surface.size());
    const DirectionSet directions(DiscRays::together, 1);
    std::vector<std::array<RayHit, 2 * DiscRays::together>> met(asked);
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
            for (std::size_t i = 0; i < DiscRays::together; ++i)
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

Stations::Stations(const CloudSurface& surface, const DiscRays& rays, const std::vector<RayHit>& hits,
                   const Reach& reach, const std::optional<Vector3f>& up, const SidesEffort& effort)
    : surface_(surface), up_(up) {
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

double Stations::all_seen() const {
    return static_cast<double>(seen_.size()) - static_cast<double>(std::count(seen_.begin(), seen_.end(), 0));
}

double Stations::boxed(float size) const {
    constexpr double large = 0.03, beyond_at_most = 0.02;
    const float thick = 0.01F * size,
                near = 5 * thick; // noise turns a plane, so the far ends of its wall are only near
    constexpr float alike = 0.9F;
    std::vector<char> bounding(tests_.size(), 0);
    const auto all = static_cast<double>(tests_.size());
    tbb::parallel_for(std::size_t(0), tests_.size(), [&](std::size_t t) {
        const Vector3f& normal = surface_.normals[tests_[t]];
        std::vector<Vector3f> wall;
        for (const std::uint32_t other : tests_)
            if (std::abs((surface_.tree[other] - surface_.tree[tests_[t]]).dot(normal)) <= near &&
                std::abs(surface_.normals[other].dot(normal)) > alike)
                wall.push_back(surface_.tree[other]);
        if (static_cast<double>(wall.size()) < large * all)
            return;
        Vector3f middle = Vector3f::Zero();
        for (const Vector3f& at : wall)
            middle += at / static_cast<float>(wall.size());
        Eigen::Matrix3f spread = Eigen::Matrix3f::Zero();
        for (const Vector3f& at : wall)
            spread += (at - middle) * (at - middle).transpose();
        const Vector3f across =
            Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f>().computeDirect(spread).eigenvectors().col(0);
        std::size_t above = 0, below = 0, within = 0;
        for (const std::uint32_t other : tests_) {
            const float height = (surface_.tree[other] - middle).dot(across);
            above += height > thick;
            below += height < -thick;
            within += std::abs(height) <= thick && std::abs(surface_.normals[other].dot(across)) > alike;
        }
        bounding[t] = std::abs((surface_.tree[tests_[t]] - middle).dot(across)) <= thick &&
                      static_cast<double>(std::min(above, below)) <= beyond_at_most * all &&
                      static_cast<double>(within) >= large * all;
    });
    return tests_.empty() ? 0 : static_cast<double>(std::count(bounding.begin(), bounding.end(), 1)) / all;
}

double Stations::rise(const Signs& labels) const {
    double sum = 0;
    for (std::size_t t = 0; t < tests_.size(); ++t)
        sum += static_cast<double>(surface_.normals[tests_[t]].dot(up_.value_or(Vector3f::UnitZ()))) * labels[t];
    return sum / std::max(static_cast<double>(tests_.size()), 1.0);
}

Stations::Cover Stations::cover(const Signs& labels) const {
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

double Stations::seen_from_afar(const Signs& labels) const {
    std::size_t well = 0;
    for (std::size_t t = 0; t < tests_.size(); ++t) {
        int fronts = 0;
        for (std::size_t c = near_; c < positions_.size(); ++c)
            fronts += seen(c, t, labels) > 0;
        well += fronts >= 3;
    }
    return tests_.empty() ? 0 : static_cast<double>(well) / static_cast<double>(tests_.size());
}

double Stations::fronts_from_afar(const Signs& labels) const {
    double fronts = 0, all = 0;
    for (std::size_t c = near_; c < positions_.size(); ++c)
        for (std::size_t t = 0; t < tests_.size(); ++t) {
            fronts += seen(c, t, labels) > 0;
            all += seen(c, t, labels) != 0;
        }
    return all > 0 ? fronts / all : 0;
}

double Stations::density_fits(const Signs& labels) const {
    std::vector<std::vector<double>> made[2]; // by kind of scanner and station: density by test
    for (std::size_t c = 0; c < near_; ++c) {
        std::size_t fronts = 0, backs = 0;
        for (std::size_t t = 0; t < tests_.size(); ++t) {
            fronts += seen(c, t, labels) > 0;
            backs += seen(c, t, labels) < 0;
        }
        if (10 * fronts < tests_.size() || 20 * backs > fronts + backs)
            continue;
        for (auto& of_kind : made)
            of_kind.emplace_back(tests_.size(), 0.0);
        for (std::size_t t = 0; t < tests_.size(); ++t) {
            if (seen(c, t, labels) <= 0)
                continue;
            const Vector3f apart = positions_[c] - surface_.tree[tests_[t]];
            const Vector3f towards = apart.normalized();
            const double even =
                static_cast<double>(std::abs(towards.dot(surface_.normals[tests_[t]])) / apart.squaredNorm());
            const float rise = towards.dot(up_.value_or(Vector3f::UnitZ()));
            made[0].back()[t] = even;
            made[1].back()[t] = even / static_cast<double>(std::sqrt(std::max(1 - rise * rise, 0.01F)));
        }
    }
    return std::max(best_fit(made[0]), best_fit(made[1]));
}

std::vector<std::size_t> Stations::best(std::vector<std::size_t> chosen, const Signs& labels, std::size_t most) const {
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

double Stations::best_fit(const std::vector<std::vector<double>>& made) const {
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

double Stations::fit(const std::vector<double>& one, const std::vector<double>& other) const {
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

void Stations::add_near(const std::vector<RayHit>& hits, const Reach& reach, std::size_t count) {
    std::vector<double> up_to;
    double sum = 0;
    for (const RayHit& ray : hits)
        up_to.push_back(sum += static_cast<double>(std::min(ray.distance, 2 * reach.usual)));
    for (std::size_t k = 0; k < count && sum > 0; ++k) {
        const double at = (static_cast<double>(k) + 0.5) / static_cast<double>(count) * sum;
        const auto ray = static_cast<std::size_t>(std::upper_bound(up_to.begin(), up_to.end() - 1, at) - up_to.begin());
        const RayHit& chosen = hits[ray];
        const float along = 0.2F + 0.6F * static_cast<float>(hash(static_cast<std::uint32_t>(k)) * 0x1p-32);
        positions_.push_back(surface_.tree[chosen.from] + along * chosen.distance * chosen.direction);
    }
}

} // namespace scanshade
