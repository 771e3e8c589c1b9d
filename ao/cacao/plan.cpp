#include "ao/cacao/plan.h"

#include "shaders/cacao/pattern.glsl"

namespace scanshade {
namespace {

/// The sampling pattern as the adaptive taps of HIGHEST read it.
#define ROW(i, x, y, weight, mip_bias) x##F, y##F, weight##F, mip_bias##F,
const std::vector<float> taps{CACAO_PATTERN_0_3(ROW) CACAO_PATTERN_3_5(ROW) CACAO_PATTERN_5_12(ROW)
                                  CACAO_PATTERN_12_31(ROW)};
#undef ROW

/// What the buffer `pattern` holds: the taps, then the rotations of each slice.
std::vector<float> pattern() {
    std::vector<float> rows = taps;
    for (int a = 0; a < 4; ++a)
        for (int phase = 0; phase < 5; ++phase) {
            const shared::vec2 r = cacao_rotation(a, phase);
            rows.insert(rows.end(), {r.x, r.y, 0.0F, 0.0F});
        }
    return rows;
}

} // namespace

CacaoPlan::CacaoPlan(const CacaoOptions& options_, const shared::CacaoConstants& constants, bool normals_supplied_)
    : options(options_), k(constants), normals_supplied(normals_supplied_),
      two_slices(options.quality == Quality::lowest), mips(options.quality >= Quality::high),
      highest(options.quality == Quality::highest), layers(two_slices ? 2 : 4) {
    using Host = gpu::BufferRow::Host;
    constexpr auto floats = gpu::BufferRow::Texels::r32f, pairs = gpu::BufferRow::Texels::rg32f,
                   words = gpu::BufferRow::Texels::r32ui;
    const std::size_t slices = 4 * texels_of(k.slice);
    const std::vector<float> rows = pattern();
    tables.buffers = {
        {"depth in", texels_of(k.image) * 4, Host::upload, floats},
        {"normals in", normals_supplied ? texels_of(k.image) * 12 : 4, normals_supplied ? Host::upload : Host::none,
         floats},
        {"depths", static_cast<std::size_t>(k.depth_pitch) * 16, Host::none, floats},
        {"normals", slices * 4, Host::none, words},
        {"ping", slices * 4, Host::none, words},
        {"pong", slices * 4, Host::none, words},
        {"importance", highest ? texels_of(k.importance) * 4 : 4, Host::none, words},
        {"importance pong", highest ? texels_of(k.importance) * 4 : 4, Host::none, words},
        {"load counter", 4, Host::none, words},
        {"blur a", 4, Host::none, words},
        {"blur b", 4, Host::none, words},
        {"staged", options.downsampled ? texels_of(k.grid) * 8 : 8, Host::none, pairs},
        {"pattern", rows.size() * 4, Host::none, gpu::BufferRow::Texels::rgba32f, rows},
        {"visibility", texels_of(k.image) * 4, Host::download},
    };
}

void CacaoPlan::add(std::string name, std::string_view shader, std::vector<int> reads, std::vector<int> writes,
                    const Area& area, const Constants& constants) {
    Constants all{{shared::spec_spacing, options.downsampled ? 2 : 1},
                  {shared::spec_kernel, two_slices ? 0 : static_cast<int>(options.quality) - 1},
                  {shared::spec_two_slices, two_slices},
                  {shared::spec_device_depth, options.depth_input != CacaoDepthInput::metric}};
    all.insert(all.end(), constants.begin(), constants.end());
    tables.passes.push_back(
        {std::move(name),
         shader,
         std::move(reads),
         std::move(writes),
         {static_cast<std::uint32_t>(groups_of(area.texels.x, area.tile.x)),
          static_cast<std::uint32_t>(groups_of(area.texels.y, area.tile.y)), static_cast<std::uint32_t>(area.layers)},
         std::move(all)});
}

void CacaoPlan::add_mips(std::string_view shader) {
    const int threads = 4 * groups_of(k.slice.x, 8) * groups_of(k.slice.y, 8); // one per 8x8 texels of a slice
    add("mips", shader, {cacao_depth_in}, {cacao_depths}, {{threads, 1}});
}

void CacaoPlan::add_clear_counter() {
    tables.passes.push_back({"clear counter", "", {}, {cacao_counter}, {1, 1, 1}, {}});
}

void CacaoPlan::add_importance_blurs() {
    const shared::ivec2 beyond{k.importance.x, 8 * groups_of(k.importance.y, 8)}; // as the shader's counts() needs
    add("importance blur a", "cacao/importance_blur", {cacao_importance}, {cacao_importance_pong, cacao_counter},
        {k.importance});
    add("importance blur b", "cacao/importance_blur", {cacao_importance_pong}, {cacao_importance, cacao_counter},
        {beyond}, {{shared::spec_last, 1}});
}

std::vector<int> CacaoPlan::given() const {
    return {cacao_depth_in, normals_supplied ? cacao_normals_in : cacao_depth_in};
}

std::vector<int> CacaoPlan::surfaces() {
    return {cacao_depths, cacao_normals, cacao_normals, cacao_normals, cacao_normals, cacao_pattern};
}

std::vector<int> CacaoPlan::surfaces_and_importance() {
    return {cacao_depths, cacao_normals, cacao_pong, cacao_importance, cacao_counter, cacao_pattern};
}

CacaoTables cacao_tables(const CacaoOptions& options, const shared::CacaoConstants& constants, bool normals_supplied,
                         CacaoStorage storage) {
    CacaoPlan plan(options, constants, normals_supplied);
    return options.scan() ? scan_tables(std::move(plan), storage) : reference_tables(std::move(plan));
}

} // namespace scanshade
