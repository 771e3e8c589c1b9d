// Processes captures in order, and starts the next ones before the first has ended.
#pragma once

#include "apps/walk/progress.h"

#include <algorithm>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace scanshade {

/// Calls work(0, output) .. work(count - 1, output), started in this order, `at_once` at a time, each on one thread.
/// After an exception no further call starts. The first exception is rethrown once the running calls have ended.
inline void overlapped(std::size_t count, std::size_t at_once,
                       const std::function<void(std::size_t, OrderedOutput&)>& work) {
    std::mutex beginning;
    std::size_t next = 0;
    std::exception_ptr first;
    const auto lane = [&] {
        for (;;) {
            std::unique_lock begins(beginning);
            if (next == count || first)
                return;
            const std::size_t i = next++;
            OrderedOutput output; // messages appear in starting order
            begins.unlock();
            try {
                work(i, output);
            } catch (...) {
                const std::lock_guard alone(beginning);
                if (!first)
                    first = std::current_exception();
            }
        }
    };
    std::vector<std::jthread> others;
    for (std::size_t i = 1; i < std::min(at_once, count); ++i)
        others.emplace_back(lane);
    lane();
    others.clear();
    if (first)
        std::rethrow_exception(first);
}

} // namespace scanshade
