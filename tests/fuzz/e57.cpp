// Fuzz target: E57 clouds.
#include "tests/fuzz/cloud.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade::fuzz;
    take_cloud(text_of(data, size), "a.e57");
    return 0;
}
