// Stations judged by what they see of their own points.
#include "ao/cloud/sides/recorded_stations.h"

#include "ao/cloud/surface/disc_rays.h"
#include "projection/base/hash.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

/// The number of the station that recorded each point.
std::vector<std::uint32_t> station_of_each(std::span<const Station> stations, std::size_t points) {
    std::vector<std::uint32_t> station(points);
    for (std::size_t s = 0; s < stations.size(); ++s) {
        const std::size_t end = s + 1 < stations.size() ? std::min(stations[s + 1].first, points) : points;
        for (std::size_t i = stations[s].first; i < end; ++i)
            station[i] = static_cast<std::uint32_t>(s);
    }
    return station;
}

/// Some points by a hash of their numbers: those of a scan are in the order of its grid, which steps would follow.
struct Sample {
    std::vector<Vector3d> points, normals;
    std::vector<std::uint32_t> station;

    Sample(const std::vector<std::uint32_t>& station_of, std::span<const Vector3d> all,
           std::span<const Vector3d> all_normals) {
        constexpr double wanted = 200000;
        const double share = wanted / static_cast<double>(std::max<std::size_t>(all.size(), 1));
        for (std::size_t i = 0; i < all.size(); ++i) {
            if (!all[i].allFinite() || hash(static_cast<std::uint32_t>(i), 3U) >= share * 0x1p32)
                continue;
            points.push_back(all[i]);
            station.push_back(station_of[i]);
            if (!all_normals.empty())
                normals.push_back(all_normals[i]);
        }
    }
};

/// Of the points that were looked for.
struct Seen {
    std::size_t tests = 0, visible = 0, opposed = 0;
    double rise = 0, level = 0; ///< sums over z of the normals that face the station, and over its amount

    void add(int side, double z) {
        ++tests, visible += side != 0, opposed += side < 0;
        rise += side * z, level += std::abs(side * z);
    }
    void add(const Seen& others) {
        tests += others.tests, visible += others.visible, opposed += others.opposed, rise += others.rise,
            level += others.level;
    }
    [[nodiscard]] double share(std::size_t part) const {
        return tests > 0 ? static_cast<double>(part) / static_cast<double>(tests) : 0;
    }
};

/// What each station sees of its own points.
std::vector<Seen> seen_by_each(std::span<const Station> stations, const CloudSurface& surface,
                               const std::vector<std::uint32_t>& station) {
    constexpr std::size_t most_tests = 40000;
    const DiscRays rays(surface);
    const std::size_t step = std::max<std::size_t>(1, surface.size() / most_tests);
    std::vector<int> sides((surface.size() + step - 1) / step);
    const auto number = [&](std::size_t k) { return station[surface.tree.original(k * step)]; };
    tbb::parallel_for(std::size_t(0), sides.size(), [&](std::size_t k) {
        sides[k] = rays.seen_from(k * step, (stations[number(k)].position - surface.middle).cast<float>());
    });
    std::vector<Seen> seen(stations.size());
    for (std::size_t k = 0; k < sides.size(); ++k)
        if (!surface.normals[k * step].isZero() && surface.disc_radius[k * step] > 0)
            seen[number(k)].add(sides[k], static_cast<double>(surface.normals[k * step].z()));
    return seen;
}

bool all_at_one_place(std::span<const Station> stations, const std::vector<Seen>& seen) {
    std::vector<Vector3d> places;
    for (std::size_t s = 0; s < stations.size(); ++s)
        if (seen[s].tests > 0)
            places.push_back(stations[s].position);
    return places.size() > 1 && std::ranges::all_of(places, [&](const Vector3d& each) { return each == places[0]; });
}

} // namespace

RecordedStations recorded_stations(std::span<const Station> stations, std::span<const Vector3d> points,
                                   std::span<const Vector3d> normals) {
    // Eight scenes of six stations, exact, with noise of 3 and 10 mm, with wide beams and scans 5 mm apart: true
    // stations see 0.78 to 0.99 of all, 0.53 and more of each scan. Places from where more than 3 % of the sides would
    // be wrong see less, such as those 2 m beside, or the stations of other scans in a house of many walls.
    constexpr double most = 0.7, some = 0.4;
    // z is up in such files. Terrain is as visible from deep below, as from heights of zero.
    constexpr double down = -0.5;
    constexpr std::size_t enough = 50; // points of a scan that tell
    const std::vector<std::uint32_t> station = station_of_each(stations, points.size());
    const Sample sample(station, points, normals);
    const CloudSurface surface = cloud_surface(LocalCloud(sample.points), sample.normals);
    const std::vector<Seen> seen = seen_by_each(stations, surface, sample.station);
    Seen all;
    std::size_t worst = 0;
    for (std::size_t s = 0; s < seen.size(); ++s) {
        all.add(seen[s]);
        if (seen[s].tests >= enough && seen[s].share(seen[s].visible) < seen[worst].share(seen[worst].visible))
            worst = s;
    }
    RecordedStations found;
    found.opposed = static_cast<double>(all.opposed) / static_cast<double>(std::max<std::size_t>(all.visible, 1));
    found.agreement = surface.agreement;
    const double visible = all.share(all.visible), least = seen[worst].share(seen[worst].visible);
    const bool one_place = all_at_one_place(stations, seen);
    found.contradict = !one_place && (visible < most || (seen[worst].tests >= enough && least < some));
    if (one_place)
        found.note = "where the scanners stood is not used: all scans name the same position.";
    else if (visible < most)
        found.note = fmt::format("where the scanners stood is not used: only {:.0f} % of the points can be seen from "
                                 "the position of their scan.",
                                 100 * visible);
    else if (all.rise < down * all.level)
        found.note = "where the scanners stood is not used: nearly all surfaces would look down.";
    else if (seen[worst].tests >= enough && least < some)
        found.note = fmt::format("where the scanners stood is not used: only {:.0f} % of the points of scan {} can be "
                                 "seen from its position.",
                                 100 * least, worst + 1);
    else {
        found.note = fmt::format("{:.0f} % of the points can be seen from the position of their scan.", 100 * visible);
        found.seen_from.resize(points.size());
        tbb::parallel_for(std::size_t(0), points.size(),
                          [&](std::size_t i) { found.seen_from[i] = stations[station[i]].position; });
    }
    return found;
}

} // namespace scanshade
