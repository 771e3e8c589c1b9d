// Fuzz target: LAZ clouds.
#include "tests/fuzz/cloud.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade::fuzz;
    take_cloud(text_of(data, size), "a.laz");
    return 0;
}
