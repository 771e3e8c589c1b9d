// Captures one after the other, the next begun while the one before is not quite done.
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

/// Calls work(0, turn) .. work(count - 1, turn), begun in this order, `at_once` of them at a time, each on one thread.
/// Where one throws, no further one is begun; the first exception is thrown once those begun have ended.
inline void overlapped(std::size_t count, std::size_t at_once, const std::function<void(std::size_t, Turn&)>& work) {
    std::mutex beginning;
    std::size_t next = 0;
    std::exception_ptr first;
    const auto lane = [&] {
        for (;;) {
            std::unique_lock begins(beginning);
            if (next == count || first)
                return;
            const std::size_t i = next++;
            Turn turn; // told in the order begun
            begins.unlock();
            try {
                work(i, turn);
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
