#include "tests/bench/terrain.h"

#include "ao/horizon/horizon.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <tbb/parallel_for.h>

namespace scanshade::bench {

namespace {

/// Waves in all directions, heights in proportion to a power of their lengths.
Terrain waves(unsigned seed, double shortest_m, double longest_m, double steepness, double power) {
    struct Wave {
        double x, y, phase, height;
    };
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    constexpr int count = 60;
    std::vector<Wave> all;
    for (int i = 0; i < count; ++i) {
        const double length = shortest_m * std::pow(longest_m / shortest_m, uniform(random));
        const double k = 2 * std::numbers::pi / length, angle = 2 * std::numbers::pi * uniform(random);
        all.push_back({k * std::cos(angle), k * std::sin(angle), 2 * std::numbers::pi * uniform(random),
                       steepness * longest_m * std::pow(length / longest_m, power) / std::sqrt(count)});
    }
    return [all](double x, double y) {
        double z = 0;
        for (const Wave& wave : all)
            z += wave.height * std::cos(wave.x * x + wave.y * y + wave.phase);
        return z;
    };
}

/// From 0 to 1 over `width` around 0.
double step(double x, double width) {
    const double t = std::clamp(x / width + 0.5, 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

Terrain mounds(unsigned seed) {
    struct Mound {
        double x, y, radius, height;
        bool ring;
    };
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<Mound> all;
    for (int i = 0; i < 150; ++i)
        all.push_back({80 * uniform(random), 80 * uniform(random), 0.8 + 3 * uniform(random),
                       (0.2 + uniform(random)) * (i % 2 == 0 ? 1 : -1), i % 3 == 0});
    return [all, ground = waves(seed + 1, 15, 60, 0.04, 1.2)](double x, double y) {
        double z = ground(x, y);
        for (const Mound& mound : all) {
            const double r = std::hypot(x - mound.x, y - mound.y) / mound.radius, d = mound.ring ? (r - 1.5) * 2 : r;
            z += std::abs(d) < 4 ? mound.height * std::exp(-d * d) : 0;
        }
        return z;
    };
}

/// Houses on gentle ground: walls of `wall_m` in plan.
Terrain town(unsigned seed, double wall_m) {
    struct House {
        double x, y, length, width, height, c, s;
    };
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<House> all;
    for (int i = 0; i < 36; ++i) {
        const double angle = uniform(random) * 0.6;
        all.push_back({13.0 * (i % 6) + 5 * uniform(random), 13.0 * (i / 6) + 5 * uniform(random),
                       3 + 4 * uniform(random), 2 + 3 * uniform(random), 3 + 8 * uniform(random), std::cos(angle),
                       std::sin(angle)});
    }
    return [all, wall_m, ground = waves(seed + 1, 20, 60, 0.03, 1.2)](double x, double y) {
        double roof = 0;
        for (const House& house : all) {
            const double dx = x - house.x, dy = y - house.y;
            const double u = std::abs(house.c * dx + house.s * dy), v = std::abs(house.c * dy - house.s * dx);
            roof = std::max(roof, house.height * step(house.length - u, wall_m) * step(house.width - v, wall_m));
        }
        return ground(x, y) + roof;
    };
}

struct Row {
    const char* name;
    Terrain (*make)(unsigned seed);
};

const std::vector<Row>& rows() {
    static const std::vector<Row> all{
        {"hills", [](unsigned seed) { return waves(seed, 10, 80, 0.06, 1.3); }},
        {"rough", [](unsigned seed) { return waves(seed, 1.2, 40, 0.08, 1.1); }},
        {"mounds", &mounds},
        {"town", [](unsigned seed) { return town(seed, 0.8); }},
        {"terraces",
         [](unsigned seed) -> Terrain {
             return [ground = waves(seed, 15, 60, 0.1, 1.2)](double x, double y) {
                 const double z = ground(x, y), floor = std::floor(z);
                 return floor + step(z - floor - 0.5, 0.3);
             };
         }},
        {"dunes",
         [](unsigned seed) -> Terrain {
             return [ground = waves(seed, 10, 60, 0.05, 1.2), bend = waves(seed + 9, 20, 60, 0.05, 1)](double x,
                                                                                                       double y) {
                 const double phase = (x + 3 * bend(x, y)) / 6, share = phase - std::floor(phase);
                 return ground(x, y) +
                        1.2 * (share < 0.75 ? step(share / 0.75 - 0.5, 1) : step(0.5 - (share - 0.75) * 4, 1));
             };
         }},
        {"gullies",
         [](unsigned seed) -> Terrain {
             return [a = waves(seed, 6, 40, 0.1, 1), b = waves(seed + 5, 10, 60, 0.12, 1.3)](double x, double y) {
                 return b(x, y) + std::sqrt(a(x, y) * a(x, y) + 0.02);
             };
         }},
        {"quarry",
         [](unsigned seed) -> Terrain {
             return [ground = waves(seed, 2, 40, 0.05, 1.2), edge = waves(seed + 5, 15, 60, 0.12, 1.2)](double x,
                                                                                                        double y) {
                 return ground(x, y) + 6 * step(edge(x, y), 1.5) + 2.5 * step(edge(y, x) - 1, 0.6);
             };
         }},
    };
    return all;
}

constexpr int finer = 5; // odd, so that centres meet

} // namespace

const std::vector<std::string>& terrain_names() {
    static const std::vector<std::string> names = [] {
        std::vector<std::string> all;
        for (const Row& row : rows())
            all.emplace_back(row.name);
        return all;
    }();
    return names;
}

Terrain terrain_named(const std::string& name, unsigned seed) {
    for (const Row& row : rows())
        if (name == row.name)
            return row.make(seed);
    throw Misuse(name + ": no such terrain");
}

cv::Mat1f heights_of(const Terrain& terrain, int cells, double cell_m) {
    cv::Mat1f z(cells, cells);
    tbb::parallel_for(0, cells, [&](int r) {
        for (int c = 0; c < cells; ++c)
            z(r, c) = static_cast<float>(terrain((c + 0.5) * cell_m, (r + 0.5) * cell_m));
    });
    return z;
}

cv::Mat1f true_view(const Terrain& terrain, int cells, double cell_m, double radius_m) {
    horizon::Settings settings;
    settings.radius = radius_m, settings.directions = 64;
    const int rim = static_cast<int>(std::ceil(radius_m / cell_m)) + 1;
    const Terrain moved = [&](double x, double y) { return terrain(x - rim * cell_m, y - rim * cell_m); };
    const cv::Mat1f fine = heights_of(moved, (cells + 2 * rim) * finer, cell_m / finer);
    const cv::Range rows(rim * finer, (rim + cells) * finer);
    const cv::Mat1f all = horizon::layers_of({fine, cell_m / finer}, settings, {.svf = true}, rows).svf;
    cv::Mat1f view(cells, cells);
    for (int r = 0; r < cells; ++r)
        for (int c = 0; c < cells; ++c)
            view(r, c) = all(r * finer + finer / 2, (c + rim) * finer + finer / 2);
    return view;
}

std::vector<Eigen::Vector3d> scan_of(const Terrain& terrain, double side_m, double density, double sigma_m,
                                     const std::vector<Eigen::Vector3d>& gaps, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, side_m);
    std::normal_distribution<double> normal(0, 1);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0, count = static_cast<int>(side_m * side_m * density); i < count; ++i) {
        const double x = uniform(random), y = uniform(random), error = sigma_m * normal(random);
        if (std::ranges::none_of(
                gaps, [&](const Eigen::Vector3d& gap) { return std::hypot(x - gap.x(), y - gap.y()) < gap.z(); }))
            points.emplace_back(x, y, terrain(x, side_m - y) + error); // y to the north
    }
    return points;
}

std::vector<Eigen::Vector3d> discs_of(double side_m, int count, double most_m, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<Eigen::Vector3d> discs;
    for (int i = 0; i < count; ++i)
        discs.emplace_back(side_m * uniform(random), side_m * uniform(random), 1 + (most_m - 1) * uniform(random));
    return discs;
}

} // namespace scanshade::bench
