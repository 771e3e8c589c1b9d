// Overlapping captures start in order, report in order, and end after the first failure.
#include "apps/walk/overlap.h"

#include "projection/base/error.h"

#include <atomic>
#include <gtest/gtest.h>
#include <latch>
#include <set>

namespace scanshade {
namespace {

TEST(OverlapTest, the_next_is_begun_while_one_is_at_work_and_what_they_tell_keeps_its_order) {
    std::latch second_spoke(1);
    testing::internal::CaptureStderr();
    overlapped(3, 2, [&](std::size_t i, OrderedOutput&) {
        say("begin " + std::to_string(i));
        if (i == 1)
            second_spoke.count_down();
        else if (i == 0)
            second_spoke.wait(); // for ever, were it not at work at the same time
        Progress progress(1);
        FrameRow row;
        row.name = "frame " + std::to_string(i);
        row.why = "bad";
        std::jthread([&] { progress.add(row); }).join(); // the walk reports from any thread
        say("end " + std::to_string(i));
    });
    say("all");
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "begin 0\n  frame 0: skipped: bad\nend 0\n"
                                                      "begin 1\n  frame 1: skipped: bad\nend 1\n"
                                                      "begin 2\n  frame 2: skipped: bad\nend 2\nall\n");
}

TEST(OverlapTest, each_is_done_once_by_as_many_threads_as_asked) {
    std::mutex counting;
    std::multiset<std::size_t> done;
    std::set<std::thread::id> threads;
    std::atomic<int> now = 0, most = 0;
    overlapped(50, 3, [&](std::size_t i, OrderedOutput&) {
        most = std::max(most.load(), ++now);
        std::this_thread::yield();
        --now;
        const std::lock_guard alone(counting);
        done.insert(i);
        threads.insert(std::this_thread::get_id());
    });
    EXPECT_EQ(done.size(), 50u);
    EXPECT_EQ(std::set<std::size_t>(done.begin(), done.end()).size(), 50u);
    EXPECT_LE(threads.size(), 3u);
    EXPECT_LE(most, 3);
    overlapped(0, 3, [](std::size_t, OrderedOutput&) { FAIL(); });
}

TEST(OverlapTest, after_a_failure_nothing_is_begun_and_those_begun_end) {
    std::atomic<int> begun = 0, ended = 0;
    std::latch both(2);
    const auto work = [&](std::size_t i, OrderedOutput&) {
        ++begun;
        if (i < 2)
            both.arrive_and_wait();
        if (i == 0)
            throw Error("the first fails");
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        ++ended;
    };
    try {
        overlapped(20, 2, work);
        FAIL() << "nothing thrown";
    } catch (const Error& failure) {
        EXPECT_STREQ(failure.what(), "the first fails");
    }
    EXPECT_EQ(begun, ended + 1);
    EXPECT_LT(begun, 4);
}

} // namespace
} // namespace scanshade
