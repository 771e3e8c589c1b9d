// CACAO for the metric depth of sensors: the passes of profile `scan`, in one form that is fast on CPUs and one that is
// fast on GPUs. shaders/cacao/scan/scan.glsl explains each pass.
#include "ao/cacao/plan.h"

#include <algorithm>
#include <fmt/format.h>

namespace scanshade {
namespace {

using shared::ivec2;

/// Adds blur steps, one pass each; the first reads ping. Returns the buffer that holds AO afterwards.
int add_blurs(CacaoPlan& plan, int steps) {
    int from = cacao_ping, to = cacao_pong;
    for (int step = 1; step <= steps; ++step, std::swap(from, to))
        plan.add(fmt::format("blur {}", step), "cacao/scan/blur", {from}, {to}, {plan.k.slice, plan.layers});
    return from;
}

CacaoTables in_buffers(CacaoPlan plan) {
    const shared::CacaoConstants& k = plan.k;
    plan.add("prepare", "cacao/scan/buffers/prepare", plan.given(), {cacao_depths, cacao_normals}, {k.slice},
             {{shared::spec_normals, plan.normals_supplied}});
    if (plan.mips)
        plan.add_mips("cacao/scan/buffers/mips");

    if (plan.highest) {
        plan.add_clear_counter();
        plan.add("base", "cacao/scan/buffers/generate", CacaoPlan::surfaces(), {cacao_pong}, {k.slice, 4},
                 {{shared::spec_base, 1}, {shared::spec_mips, 1}});
        plan.add("importance", "cacao/scan/buffers/importance", {cacao_pong}, {cacao_importance}, {k.importance});
        plan.add_importance_blurs();
    }
    plan.add("generate", "cacao/scan/buffers/generate",
             plan.highest ? CacaoPlan::surfaces_and_importance() : CacaoPlan::surfaces(), {cacao_ping},
             {k.slice, plan.layers}, {{shared::spec_mips, plan.mips}});

    const int blurred = plan.tables.blurred = add_blurs(plan, plan.options.blur_passes);

    if (!plan.options.downsampled) {
        plan.add("apply", "cacao/scan/buffers/apply", {blurred, cacao_depth_in}, {cacao_out}, {k.slice});
        return std::move(plan.tables);
    }
    plan.add("stage", "cacao/scan/buffers/stage", {blurred, cacao_depths}, {cacao_staged},
             {{groups_of(k.grid.x, 2), groups_of(k.grid.y, 2)}});
    plan.add("upsample", "cacao/scan/buffers/upsample", {cacao_staged, cacao_depth_in}, {cacao_out},
             {{groups_of(k.image.x, 2), groups_of(k.image.y, 2)}});
    return std::move(plan.tables);
}

/// Depth is in images, and shared memory joins passes. Prepare also makes the mips, one pass makes and smooths the
/// importance map, and `finish` does the last blur steps and the resolve.
CacaoTables in_images(CacaoPlan plan) {
    constexpr int most_fused = 4; // blur steps: each widens the rim that neighbouring work groups both compute
    constexpr ivec2 mip_tile{shared::cacao_mip_tile, shared::cacao_mip_tile};
    constexpr ivec2 taps_tile{shared::cacao_taps_wide, shared::cacao_taps_high};
    constexpr ivec2 tile{shared::cacao_tile, shared::cacao_tile};
    const shared::CacaoConstants& k = plan.k;
    const auto padded = [](int size) { return 8 * static_cast<std::uint32_t>(groups_of(size, 8)); };
    gpu::BufferRow& depths = plan.tables.buffers[cacao_depths];
    depths.image = {padded(k.slice.x), padded(k.slice.y), 4, 4};
    depths.bytes = gpu::image_bytes(depths.image);
    depths.texels = gpu::BufferRow::Texels::none;

    plan.add("prepare", "cacao/scan/images/prepare", plan.given(), {cacao_depths, cacao_normals, cacao_counter},
             {k.slice, 1, mip_tile}, {{shared::spec_normals, plan.normals_supplied}, {shared::spec_mips, plan.mips}});

    if (plan.highest) {
        plan.add("base", "cacao/scan/images/generate", CacaoPlan::surfaces(), {cacao_pong}, {k.slice, 4, taps_tile},
                 {{shared::spec_base, 1}, {shared::spec_mips, 1}});
        plan.add("importance", "cacao/scan/images/importance", {cacao_pong}, {cacao_importance, cacao_counter},
                 {k.importance, 1, tile});
    }
    plan.add("generate", "cacao/scan/images/generate",
             plan.highest ? CacaoPlan::surfaces_and_importance() : CacaoPlan::surfaces(), {cacao_ping},
             {k.slice, plan.layers, taps_tile}, {{shared::spec_mips, plan.mips}});

    const int fused = std::min(plan.options.blur_passes, most_fused), rim = fused + 1;
    const int blurred = plan.tables.blurred = add_blurs(plan, plan.options.blur_passes - fused);
    plan.add("finish", "cacao/scan/images/finish", {blurred, cacao_depth_in}, {cacao_out, cacao_staged},
             {k.slice, 1, {shared::cacao_wide - 2 * rim, shared::cacao_high - 2 * rim}}, {{shared::spec_steps, fused}});
    if (plan.options.downsampled)
        plan.add("upsample", "cacao/scan/images/upsample", {cacao_staged, cacao_depth_in}, {cacao_out},
                 {{groups_of(k.image.x, 2), groups_of(k.image.y, 2)}, 1, tile});
    return std::move(plan.tables);
}

} // namespace

CacaoStorage cacao_storage(const CacaoOptions& options, const gpu::Device& device) {
    const gpu::DeviceInfo& info = device.info();
    const bool finishes = info.most_threads >= shared::cacao_wide * shared::cacao_high; // a work group of `finish`
    if (options.storage == CacaoStorage::buffers || !options.scan() || !finishes)
        return CacaoStorage::buffers;
    return options.storage.value_or(gpu::is_cpu(info) ? CacaoStorage::buffers : CacaoStorage::images);
}

CacaoTables scan_tables(CacaoPlan plan, CacaoStorage storage) {
    // Not the importance map: it is small, and its blur is the reference's, too.
    for (const int written : {cacao_depths, cacao_normals, cacao_ping, cacao_pong, cacao_staged})
        plan.tables.buffers[written].plain_writes = true;
    return storage == CacaoStorage::images ? in_images(std::move(plan)) : in_buffers(std::move(plan));
}

} // namespace scanshade
