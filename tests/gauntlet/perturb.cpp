// What may be wrong with a cloud, as a table.
#include "tests/gauntlet/perturb.h"

#include "apps/scenes/world/random_noise.h"

#include <cmath>
#include <Eigen/Geometry>

namespace scanshade::gauntlet {
namespace {

using Eigen::Vector3d;

/// The chance of index `i` in a stream of its own, even in [0, 1).
double chance(std::size_t i, int stream) { return Noise(1, stream, 99).uniform(static_cast<int>(i), 0); }
Vector3d gaussians(std::size_t i, int stream) {
    const Noise noise(2, stream, 99);
    const int k = static_cast<int>(i);
    return {noise.gaussian(k, 0), noise.gaussian(k, 1), noise.gaussian(k, 2)};
}

/// Keeps these points, with all that belongs to them.
void keep(Perturbed& p, const std::vector<std::size_t>& kept) {
    Perturbed few{.cloud = {.name = p.cloud.name, .points = {}, .scanner = p.cloud.scanner, .z_up = p.cloud.z_up}};
    for (const std::size_t i : kept) {
        few.cloud.points.push_back(p.cloud.points[i]);
        if (!p.cloud.normals.empty())
            few.cloud.normals.push_back(p.cloud.normals[i]);
        few.original.push_back(p.original[i]);
    }
    few.cloud.records = p.cloud.records;
    p = std::move(few);
}

void nothing(Perturbed&, const Known&) {}

void noise(Perturbed& p, const Known& known) {
    for (std::size_t i = 0; i < p.cloud.points.size(); ++i)
        p.cloud.points[i] += 0.3 * known.spacing * gaussians(i, 1).x() * known.normals[i];
}

/// Half of them within three times the box, half up to 1e8 m away.
void strays(Perturbed& p, const Known& known) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& point : p.cloud.points)
        if (point.allFinite())
            box.extend(point);
    for (std::size_t i = 0, count = p.cloud.points.size() / 100; i < count; ++i) {
        const Vector3d towards = gaussians(i, 2).normalized(), share(chance(i, 3), chance(i, 4), chance(i, 5));
        const double farthest = std::log10(1e8 / known.extent);
        p.cloud.points.push_back(box.center() +
                                 (i % 2 ? Vector3d(known.extent * std::pow(10.0, farthest * chance(i, 6)) * towards)
                                        : Vector3d(3 * (share.array() - 0.5).matrix().cwiseProduct(box.sizes()))));
        if (!p.cloud.normals.empty())
            p.cloud.normals.push_back(towards);
        p.original.push_back(Perturbed::none);
    }
}

void no_normals(Perturbed& p, const Known&) { p.cloud.normals.clear(); }

/// Records the known normals, turned over where `turns` says so.
template <class Turns>
void record_normals(Perturbed& p, const Known& known, Turns&& turns) {
    p.cloud.normals.assign(known.normals.begin(), known.normals.end());
    for (std::size_t i = 0; i < p.cloud.normals.size(); ++i)
        if (turns(i))
            p.cloud.normals[i] = -p.cloud.normals[i];
}

void flipped(Perturbed& p, const Known& known) {
    record_normals(p, known, [](std::size_t) { return true; });
}

void random_signs(Perturbed& p, const Known& known) {
    record_normals(p, known, [](std::size_t i) { return chance(i, 7) < 0.5; });
}

/// Cubes of a twentieth of the extent; half of them are turned over.
void flipped_patches(Perturbed& p, const Known& known) {
    record_normals(p, known, [&](std::size_t i) {
        std::uint32_t cube = 0;
        if (const Vector3d& at = p.cloud.points[i]; at.allFinite())
            for (const double along : at)
                cube = hash(
                    cube, static_cast<std::uint32_t>(static_cast<std::int64_t>(std::floor(20 * along / known.extent))));
        return (cube & 1) != 0;
    });
}

/// Of coordinates, normals and the scanner. Nothing then says where the sky is.
void change_axes(Perturbed& p, const Eigen::Matrix3d& turn) {
    for (Vector3d& point : p.cloud.points)
        point = turn * point;
    for (Vector3d& normal : p.cloud.normals)
        normal = turn * normal;
    if (p.cloud.scanner)
        p.cloud.scanner = turn * *p.cloud.scanner;
    p.cloud.z_up = false;
    p.turned = turn;
}

void y_up(Perturbed& p, const Known&) { change_axes(p, Eigen::Matrix3d{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}); }
void x_up(Perturbed& p, const Known&) { change_axes(p, Eigen::Matrix3d{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}); }

void ten_times(Perturbed& p, const Known&) {
    p.scaled = 10;
    for (Vector3d& point : p.cloud.points)
        point *= p.scaled;
    if (p.cloud.scanner)
        *p.cloud.scanner *= p.scaled;
}

void quarter(Perturbed& p, const Known&) {
    std::vector<std::size_t> kept;
    for (std::size_t i = 0; i < p.cloud.points.size(); ++i)
        if (chance(i, 8) < 0.25)
            kept.push_back(i);
    keep(p, kept);
}

void twice(Perturbed& p, const Known&) {
    std::vector<std::size_t> kept;
    for (std::size_t i = 0; i < 2 * p.cloud.points.size(); ++i)
        kept.push_back(i % p.cloud.points.size());
    keep(p, kept);
}

void misaligned(Perturbed& p, const Known& known) {
    for (std::size_t i = 0; i < p.cloud.points.size(); i += 2)
        p.cloud.points[i] += 0.3 * known.spacing * Vector3d(1, -2, 2) / 3;
}

constexpr Perturbation table[] = {
    {.name = "unperturbed", .apply = nothing},
    {.name = "noise", .apply = noise},
    {.name = "strays", .apply = strays},
    {.name = "no normals", .apply = no_normals, .normals = true, .recorded_only = true},
    {.name = "flipped", .apply = flipped, .normals = true, .turns_all = true},
    {.name = "random signs", .apply = random_signs, .normals = true},
    {.name = "flipped patches", .apply = flipped_patches, .normals = true},
    {.name = "10x units", .apply = ten_times},
    {.name = "y up", .apply = y_up},
    {.name = "x up", .apply = x_up},
    {.name = "a quarter", .apply = quarter, .other_density = true},
    {.name = "twice", .apply = twice, .other_density = true},
    {.name = "misaligned", .apply = misaligned},
};

} // namespace

std::span<const Perturbation> perturbations() { return table; }

Perturbed perturbed(const TestCloud& cloud, const Perturbation& perturbation, const Known& known) {
    Perturbed p{cloud};
    p.original.resize(cloud.points.size());
    for (std::size_t i = 0; i < p.original.size(); ++i)
        p.original[i] = static_cast<std::uint32_t>(i);
    perturbation.apply(p, known);
    return p;
}

TestCloud thinned(const TestCloud& cloud, std::size_t most) {
    Perturbed p = perturbed(cloud, table[0], {});
    std::vector<std::size_t> kept;
    const double share = static_cast<double>(most) / static_cast<double>(cloud.points.size());
    for (std::size_t i = 0; i < cloud.points.size(); ++i)
        if (chance(i, 9) < share)
            kept.push_back(i);
    keep(p, kept);
    return p.cloud;
}

} // namespace scanshade::gauntlet
