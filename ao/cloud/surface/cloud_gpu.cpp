// A cloud on a Vulkan device: the k-d tree that the host has made serves both searches there.
#include "ao/cloud/surface/cloud_gpu.h"

#include "ao/raycast/ray_surface.h"

#include <algorithm>
#include <array>
#include <Eigen/Geometry>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

namespace scanshade {
namespace {

using gpu::BufferRow, gpu::PassRow;
using shared::vec4;

/// A dispatch of this many work groups, in rows that every device allows.
std::array<std::uint32_t, 3> in_rows(std::size_t groups) {
    constexpr std::size_t row = 65535;
    return {static_cast<std::uint32_t>(std::min(groups, row)), static_cast<std::uint32_t>((groups + row - 1) / row), 1};
}

/// One thread for each.
std::array<std::uint32_t, 3> groups_for(std::size_t items) {
    return in_rows((items + shared::cloud_group - 1) / shared::cloud_group);
}

std::size_t leaves_of(const NeighbourTree& tree) { return std::size_t(1) << tree.levels(); }

/// The first buffers of either table.
enum Buffers : int { points, boxes, begins, others };

std::vector<BufferRow> tree_buffers(const NeighbourTree& tree) {
    using Host = BufferRow::Host;
    return {{"points", tree.size() * sizeof(vec4), Host::streamed},
            {"boxes", leaves_of(tree) * 12 * sizeof(float)},
            {"begins", (leaves_of(tree) + 1) * sizeof(std::uint32_t)}};
}

/// Fills a streamed buffer by `value(index)`, on all cores.
template <class Item, class Value>
void stream_in(gpu::Program& program, int buffer, Value&& value) {
    program.stream_in(buffer, sizeof(Item), [&](std::size_t first, std::span<std::byte> to) {
        const std::span items(reinterpret_cast<Item*>(to.data()), to.size() / sizeof(Item));
        tbb::parallel_for(std::size_t(0), items.size(), [&](std::size_t i) { items[i] = value(first + i); });
    });
}

/// Visits parts of a streamed buffer.
template <class Item, class Visit>
void stream_out(gpu::Program& program, int buffer, Visit&& visit) {
    program.stream_out(buffer, sizeof(Item), [&](std::size_t first, std::span<const std::byte> from) {
        visit(first, std::span(reinterpret_cast<const Item*>(from.data()), from.size() / sizeof(Item)));
    });
}

/// Copies a streamed buffer, on all cores.
template <class Item>
void stream_out(gpu::Program& program, int buffer, std::span<Item> to) {
    stream_out<Item>(program, buffer, [&](std::size_t first, std::span<const Item> from) {
        constexpr std::size_t at_once = 1 << 16;
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, from.size(), at_once), [&](const auto& range) {
            std::ranges::copy(from.subspan(range.begin(), range.size()),
                              to.begin() + static_cast<std::ptrdiff_t>(first + range.begin()));
        });
    });
}

/// Passes from the points and the normals of their discs to the boxes of all nodes. Points without discs need no
/// normals: any buffer of that size will do.
std::vector<PassRow> box_passes(const NeighbourTree& tree, int normals) {
    std::vector<PassRow> passes{
        {"leaves", "cloud/leaves", {points, normals}, {boxes, begins}, groups_for(leaves_of(tree)), {}}};
    for (int level = tree.levels() - 1; level > 0; level -= shared::cloud_levels) {
        const int per_group = std::min(level, shared::cloud_levels - 1);
        passes.push_back({"join",
                          "cloud/join",
                          {},
                          {boxes},
                          in_rows(std::size_t(1) << (level - per_group)),
                          {{shared::spec_level, level}}});
    }
    return passes;
}

} // namespace

std::size_t CloudGpu::most_points() const {
    constexpr std::size_t bytes_per_point = 96; // of either program, boxes included
    const gpu::DeviceInfo& info = device_.info();
    return static_cast<std::size_t>(
        std::min(info.most_buffer_bytes / sizeof(CloudSurface::Near), info.memory_bytes / 2 / bytes_per_point));
}

void CloudGpu::run(gpu::Program& program, const shared::CloudConstants& constants) {
    program.run(std::as_bytes(std::span(&constants, 1)));
    for (const auto& [name, ms] : program.timings())
        add(timings_, name, ms);
}

void CloudGpu::neighbourhoods(const NeighbourTree& tree, std::span<CloudSurface::Near> near,
                              const std::function<void(std::size_t, std::span<const shared::CloudRound>)>& visit) {
    const std::size_t count = tree.size();
    const int nearest = others, rounds = others + 1;
    std::vector<BufferRow> buffers = tree_buffers(tree);
    buffers.push_back({"near", count * sizeof(CloudSurface::Near), BufferRow::Host::streamed});
    buffers.push_back({"rounds", count * sizeof(shared::CloudRound), BufferRow::Host::streamed});
    std::vector<PassRow> passes = box_passes(tree, points);
    passes.push_back({"nearest", "cloud/nearest", {points, boxes, begins}, {nearest, rounds}, groups_for(count), {}});
    gpu::Program program(device_, std::move(buffers), std::move(passes), sizeof(shared::CloudConstants));
    stream_in<vec4>(program, points, [&](std::size_t i) { return vec4{tree[i].x(), tree[i].y(), tree[i].z(), 0}; });
    shared::CloudConstants constants{};
    constants.points = static_cast<std::uint32_t>(count);
    constants.levels = static_cast<std::uint32_t>(tree.levels());
    run(program, constants);
    stream_out(program, nearest, near);
    stream_out<shared::CloudRound>(program, rounds, visit);
}

Untouched<float> CloudGpu::visibility(const CloudSurface& surface, const DirectionSet& directions, const Task& task) {
    const NeighbourTree& tree = surface.tree;
    const std::size_t count = tree.size(), direction_count = directions.runs() * directions.rays();
    const int normals = others, directions_at = others + 1, near = others + 2, values = others + 3;
    std::vector<BufferRow> buffers = tree_buffers(tree);
    buffers.push_back({"normals", count * sizeof(vec4), BufferRow::Host::streamed});
    buffers.push_back({"directions", direction_count * sizeof(vec4), BufferRow::Host::upload});
    buffers.push_back({"near", task.means > 0 ? count * sizeof(surface.near[0]) : sizeof(surface.near[0]),
                       BufferRow::Host::streamed});
    const int result = values + task.means % 2;
    for (int i = 0; i < (task.means > 0 ? 2 : 1); ++i)
        buffers.push_back({i == 0 ? "values" : "means", count * sizeof(float),
                           values + i == result ? BufferRow::Host::streamed : BufferRow::Host::none});
    std::vector<PassRow> passes = box_passes(tree, normals);
    passes.push_back(
        {"rays", "cloud/rays", {points, normals, boxes, begins, directions_at}, {values}, groups_for(count), {}});
    for (int i = 0; i < task.means; ++i)
        passes.push_back({"mean",
                          "cloud/mean",
                          {points, normals, near, values + i % 2},
                          {values + (i + 1) % 2},
                          groups_for(count),
                          {}});
    gpu::Program program(device_, std::move(buffers), std::move(passes), sizeof(shared::CloudConstants));

    using Box = Eigen::AlignedBox3f;
    const Box of_discs = tbb::parallel_reduce( // a far outlier has no disc, and must not coarsen the rounding
        tbb::blocked_range<std::size_t>(0, count), Box(),
        [&](const auto& range, Box box) {
            for (std::size_t i = range.begin(); i < range.end(); ++i)
                if (!surface.normals[i].isZero() && surface.disc_radius[i] > 0)
                    box.extend(tree[i]);
            return box;
        },
        [](const Box& a, const Box& b) { return a.merged(b); });
    const Eigen::Vector3f middle = of_discs.isEmpty() ? Eigen::Vector3f(Eigen::Vector3f::Zero()) : of_discs.center();
    const float farthest = of_discs.isEmpty() ? 0 : of_discs.sizes().maxCoeff() / 2;
    stream_in<vec4>(program, points, [&](std::size_t i) {
        const Eigen::Vector3f at = tree[i] - middle;
        return vec4{at.x(), at.y(), at.z(), surface.normals[i].isZero() ? 0 : surface.disc_radius[i]};
    });
    stream_in<vec4>(program, normals, [&](std::size_t i) {
        const Eigen::Vector3f& n = surface.normals[i];
        return vec4{n.x(), n.y(), n.z(), surface.roughness[i]};
    });
    if (task.means > 0)
        stream_in<CloudSurface::Near>(program, near, [&](std::size_t i) { return surface.near[i]; });
    const auto to_directions = program.host_as<vec4>(directions_at);
    for (std::size_t i = 0; i < directions.runs(); ++i)
        for (int ray = 0; ray < static_cast<int>(directions.rays()); ++ray) {
            const DirectionSet::Run run = directions.run(i);
            to_directions[i * directions.rays() + static_cast<std::size_t>(ray)] = {run.x[ray], run.y[ray], run.z[ray],
                                                                                    0};
        }
    const Eigen::Vector3f up = task.up.value_or(Eigen::Vector3f::UnitZ());
    run(program, {.points = static_cast<std::uint32_t>(count),
                  .levels = static_cast<std::uint32_t>(tree.levels()),
                  .rays = static_cast<std::uint32_t>(directions.rays()),
                  .runs = static_cast<std::uint32_t>(directions.runs()),
                  .radius = task.radius,
                  .rounding = static_cast<float>(rounding_at(farthest)),
                  .falloff = task.mean_falloff,
                  .only_up = task.up.has_value(),
                  .up = {up.x(), up.y(), up.z()}});
    Untouched<float> found(count);
    stream_out(program, result, std::span(found));
    return found;
}

} // namespace scanshade
