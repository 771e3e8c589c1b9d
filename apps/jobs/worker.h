// Work in a process of its own, so that what kills it, a driver or a full memory, takes nothing else along.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

namespace scanshade {

/// What a worker process knows of its start.
struct Shift {
    int worker = 0;         ///< 0 .. workers - 1
    bool carefully = false; ///< the process before this one was killed by a signal
    std::atomic<std::uint64_t>* finished =
        nullptr; ///< to be counted up with each frame settled: progress earns new processes
};

/// Runs work(shift) in `workers` child processes at once; the caller has no threads yet. A child that a signal killed
/// is started again, carefully, and one that ended with `unfinished` (a lost device needs a fresh process) as well,
/// until three in a row came to nothing. SIGINT and SIGTERM are passed on, and nothing is started after them; children
/// do not outlive the caller. Returns the exit code that tells most (see worse()).
[[nodiscard]] int supervise(int workers, const std::function<int(const Shift&)>& work);

/// The exit code of two parts of one job: what may be tried again goes first, then our own mistakes, then bad input.
[[nodiscard]] int worse(int a, int b);

} // namespace scanshade
