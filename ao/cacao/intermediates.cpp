// The buffers between CACAO's passes, for people who study them.
#include "ao/cacao/cacao.h"

#include <algorithm>
#include <cstring>
#include <fmt/format.h>

namespace scanshade {

/// The four slices of one mip, without the padding of their buffer.
Intermediate Cacao::depth_slices(int mip) {
    const shared::CacaoConstants& k = constants_;
    const int width = std::max(1, k.slice.x >> mip), height = std::max(1, k.slice.y >> mip);
    Intermediate slices{fmt::format("depth_mip{}", mip),
                        "f4",
                        {4, height, width},
                        {},
                        "metres, 0 = hole; slice 2 (y mod 2) + (x mod 2)"};
    const auto bytes = program_->read_back(cacao_depths);
    const gpu::BufferRow::Image& image = tables_.buffers[cacao_depths].image;
    int before = 0; // texels of the mips before this one
    for (int m = 0; m < mip; ++m)
        before += 4 * static_cast<int>((image.width >> m) * (image.height >> m));
    const int wide = static_cast<int>(image.width) >> mip, high = static_cast<int>(image.height) >> mip;
    for (int a = 0; a < 4; ++a)
        for (int y = 0; y < height; ++y) {
            const int in_buffer =
                a * k.depth_pitch + k.depth_end - (k.depth_mips >> (2 * mip)) + y * (k.depth_stride >> mip);
            const int first = wide > 0 ? before + (a * high + y) * wide : in_buffer;
            slices.data.insert(slices.data.end(), bytes.begin() + 4L * first, bytes.begin() + 4L * (first + width));
        }
    return slices;
}

/// HIGHEST: how many pairs of taps each texel of the importance map asks for, as cacao/generate counts them.
Intermediate Cacao::tap_pairs(const Intermediate& importance, const Intermediate& load_counter) const {
    const auto word = [](const Intermediate& from, std::size_t i) {
        std::uint32_t value = 0;
        std::memcpy(&value, from.data.data() + 4 * i, 4);
        return static_cast<float>(value);
    };
    const float average = word(load_counter, 0) * constants_.load_counter_div;
    const float ration = std::clamp(constants_.adaptive_limit / average, 0.0F, 1.0F);
    Intermediate pairs{"tap_pairs", "u4", importance.shape, std::vector<std::byte>(importance.data.size()),
                       "pairs of taps, those of the base pass included"};
    for (std::size_t i = 0; i < pairs.data.size() / 4; ++i) {
        const float wanted = word(importance, i) / 255.0F * ration;
        const std::uint32_t count = std::min(31U, static_cast<std::uint32_t>(27.0F * wanted + 1.5F) + 5U);
        std::memcpy(pairs.data.data() + 4 * i, &count, 4);
    }
    return pairs;
}

std::vector<Intermediate> Cacao::intermediates() {
    std::vector<Intermediate> all;
    if (!program_)
        return all;
    const auto words = [&](int buffer, std::size_t count) {
        auto bytes = program_->read_back(buffer);
        bytes.resize(count * 4);
        return bytes;
    };
    const auto add = [&](std::string name, std::vector<int> shape, int buffer, std::string meaning) {
        std::size_t count = 1;
        for (int n : shape)
            count *= static_cast<std::size_t>(n);
        all.push_back({std::move(name), "u4", std::move(shape), words(buffer, count), std::move(meaning)});
    };
    const shared::CacaoConstants& k = constants_;
    for (int m = 0; m < (options_.quality >= Quality::high ? 4 : 1); ++m)
        all.push_back(depth_slices(m));
    const std::vector<int> slices{4, k.slice.y, k.slice.x};
    const bool scan = options_.scan();
    const std::string texel =
        scan ? "visibility / 65535 in bits 0-15, edges to left, right, above, below / 3 in bits 22, 20, 18, 16, filled "
               "hole in bit 30, hole in bit 31"
             : "visibility / 255 in bits 0-7, edges to left, right, above, below / 3 in bits 22, 20, 18, 16";
    add("normals", slices, cacao_normals,
        scan ? "x right, y up, z forward, each (n - 512) / 511 in 10 bits from bit 0"
             : "each n / 127 in 8 signed bits from bit 0");
    if (options_.quality == Quality::highest) {
        add("importance", {k.importance.y, k.importance.x}, cacao_importance, "255ths");
        add("load_counter", {1}, cacao_counter, "sum of every ninth importance");
        all.push_back(tap_pairs(all[all.size() - 2], all.back()));
    }
    add("ao", slices, cacao_ping, texel);
    const bool fused = tables_.buffers[cacao_depths].image.width > 0; // then blurred AO stays in shared memory
    if (options_.blur_passes > 0 && !fused)
        add("ao_blurred", slices, tables_.blurred, texel);
    return all;
}

} // namespace scanshade
