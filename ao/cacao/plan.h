// A configuration of CACAO while its table of passes is written: what the profiles' tables share. For the files of this
// room alone.
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
    /// Lists the buffers in the order of CacaoBuffer; a profile changes what it keeps otherwise.
    CacaoPlan(const CacaoOptions& options, const shared::CacaoConstants& constants, bool normals_supplied);

    const CacaoOptions& options;
    const shared::CacaoConstants& k;
    bool normals_supplied;
    bool two_slices; ///< LOWEST computes slices 0 and 3 only
    bool mips;       ///< HIGH and HIGHEST read coarser depth far from a texel
    bool highest;    ///< a base pass and an importance map decide how many taps follow
    int layers;      ///< slices computed
    CacaoTables tables;

    /// The texels a pass runs over, and those of a work group, as its shader declares.
    struct Area {
        shared::ivec2 texels;
        int layers = 1;
        shared::ivec2 tile = {shared::cacao_row, 1};
    };
    using Constants = std::vector<std::pair<int, int>>;
    void add(std::string name, std::string_view shader, std::vector<int> reads, std::vector<int> writes,
             const Area& area, const Constants& constants = {});

    // Passes both profiles have in buffers.
    void add_mips(std::string_view shader);
    void add_clear_counter();
    void add_importance_blurs();

    /// What prepare reads; with no normals given, the depth once more.
    [[nodiscard]] std::vector<int> given() const;
    /// What generate reads. Slots that are not read are filled with a buffer that is read anyway.
    [[nodiscard]] static std::vector<int> surfaces();
    /// What HIGHEST's last taps read.
    [[nodiscard]] static std::vector<int> surfaces_and_importance();
};

// The profiles: what they run, from prepare to apply.
[[nodiscard]] CacaoTables reference_tables(CacaoPlan plan);
[[nodiscard]] CacaoTables scan_tables(CacaoPlan plan, CacaoStorage storage);

} // namespace scanshade
