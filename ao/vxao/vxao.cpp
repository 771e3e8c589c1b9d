#include "ao/vxao/vxao.h"

#include "shaders/shared/vxao.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <Eigen/Geometry>
#include <fmt/format.h>

namespace scanshade {
namespace {

struct Level {
    Quality quality;
    int cones, voxels; // a radius
};
constexpr std::array levels{Level{Quality::lowest, 6, 8}, Level{Quality::low, 6, 16}, Level{Quality::medium, 16, 16},
                            Level{Quality::high, 16, 32}, Level{Quality::highest, 32, 32}};

/// The tone curve fitted to scenes with truth: see ao/README.md.
constexpr float curve = 1.4F;

constexpr double coarsest = 4, finest = 1 << (shared::vxao_levels - 1); // voxels a radius

VxaoOptions resolved(VxaoOptions options) {
    options = checked(std::move(options));
    const Level& level = level_of(levels, options.quality);
    if (options.cones == 0)
        options.cones = level.cones;
    const double radius = options.screen.radius;
    if (options.voxel_m == 0)
        options.voxel_m = radius / level.voxels;
    if (options.voxel_m < radius / finest * 0.9999 || options.voxel_m > radius / coarsest)
        throw Misuse(fmt::format("voxel {} m: from {} to {} m with a radius of {} m, or 0", options.voxel_m,
                                 radius / finest, radius / coarsest, radius));
    if (options.screen.curve == fitted_curve)
        options.screen.curve = curve;
    return options;
}

/// V of an open plane with so many voxels a radius, measured over tilts and offsets of the grid: the own surface's
/// voxels are not quite out of the cones' way.
float open_of_plane(double voxels) {
    constexpr std::array measured{1.0, 1.0, 0.994, 0.988, 0.980, 0.970};
    const double at = std::clamp(std::log2(voxels), 0.0, measured.size() - 1.001);
    const auto below = static_cast<std::size_t>(at);
    return static_cast<float>(std::lerp(measured[below], measured[below + 1], at - static_cast<double>(below)));
}

/// Of a brick, with the sums of its voxels and its keys.
constexpr std::size_t sum_bytes = std::size_t{12} * shared::vxao_inner;
constexpr std::size_t brick_bytes = sum_bytes + std::size_t{4} * (shared::vxao_stored + shared::vxao_levels);

/// As many as the memory holds, and a buffer of the device their sums.
int bricks_on(const gpu::Device& device, const VxaoOptions& options) {
    const std::size_t held = static_cast<std::size_t>(options.memory_mib) * 1024 * 1024 / brick_bytes;
    return static_cast<int>(std::min(held, device.info().most_buffer_bytes / sum_bytes));
}

/// Levels of voxels up to the radius.
int levels_of(const VxaoOptions& options) {
    return 1 + static_cast<int>(std::ceil(std::log2(options.screen.radius / options.voxel_m) - 1e-3));
}

/// What there was room for: shaders/vxao/room.glsl says the same.
struct Room {
    int finest = 0;    ///< the level that still has bricks; as many as there are levels where none has
    double wanted = 0; ///< bricks of all levels. Of a level without room this is a guess: four times those of the next,
                       ///< since surfaces have that many
};
Room room_for(std::span<const std::uint32_t> bricks_of_level, int count, int bricks) {
    Room room{.finest = count};
    bool fits = true;
    double held = 0, last = 0;
    for (int level = count - 1; level >= 0; --level) {
        const double own = bricks_of_level[static_cast<std::size_t>(level)];
        fits = fits && held + own <= bricks;
        last = fits ? own : std::max(own, 4 * last);
        held += fits ? own : 0;
        room.wanted += last;
        room.finest = fits ? level : room.finest;
    }
    return room;
}

/// Of one hash table, which is at most half full.
int slots_log2(int bricks) { return std::bit_width(2 * static_cast<unsigned>(bricks) - 1); }

} // namespace

std::vector<Parameter> VxaoOptions::parameters() {
    return joined(
        joined(screen.parameters(), {screen.curve_row()}),
        {
            {.name = "quality",
             .help = "cones and voxels a radius: lowest 6 of 8, low 6 of 16, medium 16 of 16, high 16 of 32, "
                     "highest 32 of 32",
             .value = OneOf(&quality, quality_words)},
            {.name = "cones",
             .help = "cones over the surface; 0 = as the quality says",
             .value = &cones,
             .low = 0,
             .high = 256},
            {.name = "voxel",
             .help = "edge of a voxel, from 1/32 to 1/4 of the radius; 0 = as the quality says. Farther away, "
                     "where a pixel is wider than half of it, voxels are larger",
             .value = &voxel_m,
             .unit = "m",
             .low = 0,
             .high = 1e6},
            {.name = "memory",
             .help = "for voxels; where surfaces need more, larger voxels are taken",
             .value = &memory_mib,
             .unit = "MiB",
             .low = 1,
             .high = 4096},
        });
}

Vxao::Vxao(gpu::Device& device, const VxaoOptions& options)
    : ScreenMethod(device, resolved(options).screen), options_(resolved(options)), bricks_(bricks_on(device, options)) {
}

void Vxao::add_passes(ScreenTables& tables) const {
    using Texels = gpu::BufferRow::Texels;
    constexpr auto none = gpu::BufferRow::Host::none;
    const auto count = static_cast<std::size_t>(bricks_);
    const std::size_t slots = std::size_t{1} << slots_log2(bricks_);
    const int table = tables.add_buffer({"bricks", shared::vxao_tables * slots * 8, none, Texels::rg32ui});
    const int counters = tables.add_buffer({.name = "counters",
                                            .bytes = shared::vxao_counters * 4,
                                            .host = gpu::BufferRow::Host::download,
                                            .texels = Texels::r32ui,
                                            .always_downloaded = true});
    const int keys = tables.add_buffer({"keys", shared::vxao_levels * count * 4, none, Texels::r32ui});
    const int sums = tables.add_buffer({"sums", count * sum_bytes, none});
    const int voxels = tables.add_buffer({"voxels", count * shared::vxao_stored * 4, none, Texels::r32ui});
    const cv::Size window = tables.window.size();
    const auto over_bricks = [&](std::string name, std::string_view shader, std::vector<int> reads,
                                 std::vector<int> writes, std::vector<std::pair<int, int>> constants = {}) {
        tables.passes.push_back({std::move(name),
                                 shader,
                                 std::move(reads),
                                 std::move(writes),
                                 {shared::vxao_groups, 1, 1},
                                 std::move(constants)});
    };
    tables.passes.push_back({"clear", "", {}, {table, counters}, {1, 1, 1}, {}});
    tables.add_pass_over(window, "bricks", "vxao/bricks", {screen_surfaces}, {table, counters, keys});
    if (tables.neighbours > 0) {
        tables.add_pass_over(window, "other bricks", "vxao/neighbour_bricks", {screen_neighbours},
                             {table, counters, keys});
        tables.passes.back().groups[2] = static_cast<std::uint32_t>(tables.neighbours);
    }
    tables.add_pass_over(window, "splat", "vxao/splat", {screen_surfaces, table, counters}, {sums});
    over_bricks("merge", "vxao/merge", {counters}, {sums, voxels}, {{shared::spec_first, 1}});
    for (int i = 0; i < tables.neighbours; ++i) {
        tables.add_pass_over(window, "splat others", "vxao/neighbour_splat", {screen_neighbours, table, counters},
                             {sums});
        over_bricks("merge others", "vxao/merge", {counters}, {sums, voxels}, {{shared::spec_first, 0}});
        tables.passes.push_back({"next", "vxao/next", {}, {counters}, {1, 1, 1}, {}});
    }
    for (int level = 1; level < shared::vxao_levels; ++level)
        over_bricks("mips", "vxao/mip", {table, counters, keys}, {voxels}, {{shared::spec_level, level}});
    over_bricks("rims", "vxao/rim", {table, counters, keys}, {voxels});
    tables.add_pass_over(window, "cones", "vxao/cones",
                         {screen_depth, screen_surfaces, screen_noise, table, counters, voxels}, {screen_raw});
}

void Vxao::look_at(gpu::Program& program, int first_own) {
    constexpr int counters = 1; // after the table of bricks: see add_passes()
    remarks_ = {};
    const int count = levels_of(options_);
    const Room room = room_for(program.host_as<std::uint32_t>(first_own + counters), count, bricks_);
    if (room.finest == 0)
        return;
    constexpr double mib = 1024 * 1024;
    const double wanted_mib = std::ceil(room.wanted * static_cast<double>(brick_bytes) / mib);
    const double taken_mib = std::round(static_cast<double>(bricks_) * static_cast<double>(brick_bytes) / mib);
    const std::string why =
        fmt::format("voxels of {:.3g} m would take some {:.0f} MiB, and {} MiB are there (--vxao.memory)",
                    options_.voxel_m, wanted_mib, taken_mib);
    if (room.finest == count) {
        must_not(remarks_.findings, Check::voxel_room, true,
                 [&] { return why + ": not even the largest have room, so nothing is occluded."; });
        return;
    }
    const double used_m = options_.voxel_m * (1 << room.finest), voxels = options_.screen.radius / used_m;
    const std::string sentence = fmt::format("{}: the smallest are {:.3g} m, {:.3g} a radius; what lies closer to a "
                                             "surface than that does not occlude.",
                                             why, used_m, voxels);
    constexpr double fewest = 7.9; // as quality lowest has them
    at_least(remarks_.findings, Check::voxel_room, voxels, fewest, [&] { return sentence; });
    if (voxels >= fewest)
        remarks_.warnings.push_back(sentence);
}

std::vector<std::byte> Vxao::constants(const shared::ScreenConstants& screen) const {
    shared::VxaoConstants c{};
    c.screen = screen;
    // No surface is likely to lie along this grid: those that do differ from all others.
    const Eigen::Matrix3d grid =
        (Eigen::AngleAxisd(0.6, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()))
            .toRotationMatrix();
    const auto row = [&](int i) {
        return shared::vec3(static_cast<float>(grid(i, 0)), static_cast<float>(grid(i, 1)),
                            static_cast<float>(grid(i, 2)));
    };
    c.grid_x = row(0);
    c.grid_y = row(1);
    c.grid_z = row(2);
    // Frames that are averaged have grids of their own, also of their largest voxels.
    c.shift = {32 * screen.turn.x, 32 * screen.turn.y, 32 * std::fmod(screen.turn.x + screen.turn.y, 1.0F)};
    c.voxel = static_cast<float>(options_.voxel_m);
    c.per_voxel = 1 / c.voxel;
    c.sampled = 2;
    c.sigmas = screen.tangent_sigmas > 0 ? 3.0F : 0.0F;
    c.levels = levels_of(options_);
    c.bricks = bricks_;
    c.slots_log2 = slots_log2(c.bricks);
    c.cones = options_.cones;
    c.tangent = static_cast<float>(std::tan(std::acos(1 - 1.0 / options_.cones)));
    c.gain = 1.5F;
    for (int level = 0; level < shared::vxao_levels; ++level)
        c.open[level] = open_of_plane(options_.screen.radius / options_.voxel_m / (1 << level));
    return bytes_of(c);
}

} // namespace scanshade
