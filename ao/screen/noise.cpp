#include "ao/screen/noise.h"

#include "shaders/shared/screen.h"

#include <utility>

namespace scanshade {

std::uint32_t hilbert_index(std::uint32_t x, std::uint32_t y) {
    std::uint32_t index = 0;
    for (std::uint32_t half = shared::noise_side / 2; half > 0; half /= 2) {
        const bool right = (x & half) != 0, low = (y & half) != 0;
        index += half * half * ((right ? 3U : 0U) ^ (low ? 1U : 0U));
        if (low)
            continue;
        if (right) {
            x = shared::noise_side - 1 - x;
            y = shared::noise_side - 1 - y;
        }
        std::swap(x, y);
    }
    return index;
}

std::vector<float> noise_table(int seed) {
    // In integers: h times a constant loses bits as float. The 24 highest are what a float in [0, 1) keeps.
    const auto fraction = [](std::uint32_t h, std::uint32_t step) {
        return static_cast<float>(((1U << 31) + h * step) >> 8) * 0x1p-24F;
    };
    std::vector<float> table;
    for (std::uint32_t y = 0; y < shared::noise_side; ++y)
        for (std::uint32_t x = 0; x < shared::noise_side; ++x) {
            const std::uint32_t h = hilbert_index(x, y) + 288U * static_cast<std::uint32_t>(seed);
            table.push_back(fraction(h, 3242174889U));
            table.push_back(fraction(h, 2447445414U));
        }
    return table;
}

} // namespace scanshade
