// The stopwatch against a sleep, which never returns early.
#include "projection/base/stopwatch.h"

#include <gtest/gtest.h>
#include <thread>

namespace scanshade {
namespace {

constexpr std::chrono::milliseconds nap(20);

TEST(Stopwatch, counts_from_its_construction_in_either_unit) {
    const Stopwatch stopwatch;
    std::this_thread::sleep_for(nap);
    const double ms = stopwatch.ms(), seconds = stopwatch.seconds();
    EXPECT_GE(ms, 20);
    EXPECT_GE(seconds * 1000, ms) << "it was read later";
}

TEST(Stopwatch, laps_add_up_to_no_more_than_the_whole) {
    const Stopwatch whole;
    Stopwatch laps;
    std::this_thread::sleep_for(nap);
    const double first = laps.lap_ms();
    EXPECT_GE(first, 20);
    const double second = laps.lap_ms();
    EXPECT_GE(second, 0);
    EXPECT_LE(first + second, whole.ms());
}

} // namespace
} // namespace scanshade
