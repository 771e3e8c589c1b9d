// What the tables of passes of both profiles share. Only the files of this folder include it.
#pragma once

#include "ao/cacao/cacao.h"

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace scanshade {

[[nodiscard]] inline int groups_of(int threads, int tile) { return (threads + tile - 1) / tile; }
[[nodiscard]] inline std::size_t texels_of(shared::ivec2 size) {
    return static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y);
}

struct CacaoPlan {
    /// Lists the buffers in the order of CacaoBuffer. A profile then changes those it keeps in another form.
    CacaoPlan(const CacaoOptions& options, const shared::CacaoConstants& constants, bool normals_supplied);

    const CacaoOptions& options;
    const shared::CacaoConstants& k;
    bool normals_supplied;
    bool two_slices; ///< LOWEST computes slices 0 and 3 only
    bool mips;       ///< HIGH and HIGHEST read coarser depth far from a texel
    bool highest;    ///< HIGHEST decides the number of taps by a base pass and an importance map
    int layers;      ///< number of slices computed
    CacaoTables tables;

    /// The texels that a pass covers, and those of one work group, as its shader declares them.
    struct Area {
        shared::ivec2 texels;
        int layers = 1;
        shared::ivec2 tile = {shared::cacao_row, 1};
    };
    using Constants = std::vector<std::pair<int, int>>;
    void add(std::string name, std::string_view shader, std::vector<int> reads, std::vector<int> writes,
             const Area& area, const Constants& constants = {});

    // Passes that both profiles run on buffers.
    void add_mips(std::string_view shader);
    void add_clear_counter();
    void add_importance_blurs();

    /// The buffers that prepare reads. Without supplied normals, depth fills their slot.
    [[nodiscard]] std::vector<int> given() const;
    /// The buffers that generate reads. A buffer that is read anyway fills the unused slots.
    [[nodiscard]] static std::vector<int> surfaces();
    /// The buffers that generate reads at HIGHEST, after the base pass.
    [[nodiscard]] static std::vector<int> surfaces_and_importance();
};

// All passes of a profile, from prepare to apply.
[[nodiscard]] CacaoTables reference_tables(CacaoPlan plan);
[[nodiscard]] CacaoTables scan_tables(CacaoPlan plan, CacaoStorage storage);

} // namespace scanshade
