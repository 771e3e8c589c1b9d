// Work in a process of its own: if a driver or full memory kills it, the parent survives.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

namespace scanshade {

/// What a worker process knows about its start.
struct WorkerProcess {
    int index = 0;          ///< 0 .. workers - 1
    bool carefully = false; ///< the process before this one was killed by a signal
    std::atomic<std::uint64_t>* finished =
        nullptr; ///< the worker adds 1 per settled frame; a process that settles none counts as a failure
};

/// Runs work(worker) in `workers` child processes at once. The caller must have no threads yet. A child that a signal
/// killed is restarted with `carefully`. A child that ended with `unfinished` is restarted, too, since a lost device
/// needs a fresh process. After three processes in a row without a settled frame the worker is given up. SIGINT,
/// SIGTERM and SIGHUP are passed on, and nothing starts after them. Children do not outlive the caller. Returns the
/// worst exit code (see worse()).
[[nodiscard]] int supervise(int workers, const std::function<int(const WorkerProcess&)>& work);

/// The worse of two exit codes of one job: misuse first, then unfinished, internal error, and bad input.
[[nodiscard]] int worse(int a, int b);

} // namespace scanshade
