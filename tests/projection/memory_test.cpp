// What a process holds of memory that nothing uses.
#include "projection/base/memory.h"

#include <fstream>
#include <gtest/gtest.h>
#include <unistd.h>
#include <vector>

namespace scanshade {
namespace {

double resident_mib() {
    std::ifstream stream("/proc/self/statm");
    double pages = 0, resident = 0;
    stream >> pages >> resident;
    return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

TEST(MemoryTest, freed_memory_between_what_is_in_use_goes_back_to_the_system) {
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "sanitizers have allocators of their own";
#endif
    return_freed_memory(); // from here on, growth counts
    std::vector<std::vector<char>> images;
    for (int i = 0; i < 1600; ++i)
        images.emplace_back(64 * 1024, 'x');
    const double all = resident_mib();
    for (std::size_t i = 0; i < images.size(); ++i)
        if (i % 16 != 0) // the others keep the allocator from giving the rest back by itself
            std::vector<char>().swap(images[i]);
    return_freed_memory();
    EXPECT_LT(resident_mib(), all - 80);
    EXPECT_EQ(images[16], std::vector<char>(64 * 1024, 'x'));
}

} // namespace
} // namespace scanshade
