// Fuzz target: PCD clouds.
#include "tests/fuzz/cloud.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade::fuzz;
    take_cloud(text_of(data, size), "a.pcd");
    return 0;
}
