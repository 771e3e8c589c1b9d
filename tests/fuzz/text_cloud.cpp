// Fuzz target: clouds that nothing but their name tells apart; the first byte chooses it.
#include "tests/fuzz/cloud.h"

#include <array>

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade::fuzz;
    static constexpr std::array names{"a.xyz", "a.pts", "a.ptx", "a.bin", "a.pcd.bin"};
    if (size > 0)
        take_cloud(text_of(data + 1, size - 1), names[data[0] % names.size()]);
    return 0;
}
