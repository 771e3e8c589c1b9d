// CACAO as AMD's shaders run it (section 9 of the specification): the passes of profile `reference`.
#include "ao/cacao/plan.h"

#include <fmt/format.h>

namespace scanshade {
namespace {

/// Which resolve a quality uses: smart, plain or half (section 9.2).
int resolve_of(const CacaoOptions& options) {
    if (options.quality == Quality::lowest)
        return shared::resolve_half;
    const Quality smart = options.downsampled ? Quality::high : Quality::medium;
    return options.quality >= smart ? shared::resolve_smart : shared::resolve_plain;
}

/// Adds the blur steps. A mirrored halo, as many texels wide as there are steps, surrounds each slice. Returns the
/// buffer that holds AO afterwards.
int add_haloed_blurs(CacaoPlan& plan) {
    const shared::ivec2 slice = plan.k.slice;
    const int steps = plan.options.blur_passes;
    const shared::ivec2 haloed{slice.x + 2 * steps, slice.y + 2 * steps};
    for (int step = 1; step < steps; ++step)
        plan.tables.buffers[step % 2 == 1 ? cacao_blur_a : cacao_blur_b].bytes = 4 * texels_of(haloed) * 4;
    int from = cacao_ping;
    for (int step = 1; step <= steps; ++step) {
        const int to = step == steps ? cacao_pong : (step % 2 == 1 ? cacao_blur_a : cacao_blur_b);
        plan.add(fmt::format("blur {}", step), "cacao/reference/blur", {from}, {to}, {haloed, plan.layers},
                 {{shared::spec_first, step == 1}, {shared::spec_last, step == steps}, {shared::spec_halo, steps}});
        from = to;
    }
    return from;
}

} // namespace

CacaoTables reference_tables(CacaoPlan plan) {
    const shared::CacaoConstants& k = plan.k;
    plan.add("prepare", "cacao/reference/prepare", plan.given(), {cacao_depths, cacao_normals}, {k.slice},
             {{shared::spec_normals, plan.normals_supplied}});
    if (plan.mips)
        plan.add_mips("cacao/reference/mips");

    if (plan.highest) {
        plan.add_clear_counter();
        plan.add("base", "cacao/reference/generate", CacaoPlan::surfaces(), {cacao_pong}, {k.slice, 4},
                 {{shared::spec_base, 1}, {shared::spec_mips, 1}});
        plan.add("importance", "cacao/reference/importance", {cacao_pong}, {cacao_importance}, {k.importance});
        plan.add_importance_blurs();
    }
    plan.add("generate", "cacao/reference/generate",
             plan.highest ? CacaoPlan::surfaces_and_importance() : CacaoPlan::surfaces(), {cacao_ping},
             {k.slice, plan.layers}, {{shared::spec_mips, plan.mips}});

    const int blurred = plan.tables.blurred = add_haloed_blurs(plan);

    // AMD raises some outputs to a power and some not (section 8.8).
    const int resolve = resolve_of(plan.options);
    const bool power = plan.options.downsampled ? !plan.two_slices : resolve == shared::resolve_smart;
    const CacaoPlan::Constants how{{shared::spec_resolve, resolve}, {shared::spec_power, power}};
    if (!plan.options.downsampled) {
        plan.add("apply", "cacao/reference/apply", {blurred, cacao_depth_in}, {cacao_out}, {k.slice}, how);
        return std::move(plan.tables);
    }
    plan.add("stage", "cacao/reference/stage", {blurred, cacao_depths}, {cacao_staged},
             {{(k.grid.x + 1) / 2, (k.grid.y + 1) / 2}}, how);
    plan.add("upsample", "cacao/reference/upsample", {cacao_staged, cacao_depth_in}, {cacao_out},
             {{(k.image.x + 1) / 2, (k.image.y + 1) / 2}}, how);
    return std::move(plan.tables);
}

} // namespace scanshade
