// fork, wait, fork again.
#include "apps/jobs/worker.h"

#include "apps/command.h"
#include "apps/walk/progress.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <fmt/format.h>
#include <map>
#include <new>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace scanshade {
namespace {

using Count = std::atomic<std::uint64_t>;
static_assert(Count::is_always_lock_free, "processes share its memory");

/// A count per worker, in memory that parent and children share.
class SharedCounts {
  public:
    explicit SharedCounts(int count) : bytes_(sizeof(Count) * static_cast<std::size_t>(count)) {
        memory_ = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
        if (memory_ == MAP_FAILED)
            throw Outage(fmt::format("no shared memory: {}", std::strerror(errno)));
        for (int i = 0; i < count; ++i)
            new (&at(i)) Count(0);
    }
    ~SharedCounts() { ::munmap(memory_, bytes_); }
    SharedCounts(const SharedCounts&) = delete;
    SharedCounts& operator=(const SharedCounts&) = delete;
    [[nodiscard]] Count& at(int i) const { return static_cast<Count*>(memory_)[i]; }

  private:
    std::size_t bytes_;
    void* memory_;
};

/// Whether the process shall outlive its terminal, as nohup asks.
bool ignores_hangup() {
    struct sigaction action = {};
    sigaction(SIGHUP, nullptr, &action);
    return action.sa_handler == SIG_IGN;
}

/// Blocks signals so that wait() receives them; children restore the earlier mask.
class Signals {
  public:
    Signals() {
        sigset_t set;
        sigemptyset(&set);
        for (const int signal : {SIGINT, SIGTERM, SIGCHLD})
            sigaddset(&set, signal);
        if (!ignores_hangup()) // a blocked signal arrives even if it is ignored
            sigaddset(&set, SIGHUP);
        sigprocmask(SIG_BLOCK, &set, &before_);
        waited_for_ = set;
    }
    ~Signals() { restore(); }
    Signals(const Signals&) = delete;
    Signals& operator=(const Signals&) = delete;
    void restore() const { sigprocmask(SIG_SETMASK, &before_, nullptr); }
    [[nodiscard]] int wait() const {
        int signal = 0;
        sigwait(&waited_for_, &signal);
        return signal;
    }

  private:
    sigset_t before_ = {}, waited_for_ = {};
};

/// One worker: the current process and the record of the earlier ones.
struct Worker {
    WorkerProcess process;
    std::uint64_t finished_before = 0;
    int in_vain = 0; ///< processes in a row that finished no frame
};

constexpr int patience = 3;

pid_t start(const Worker& worker, const Signals& signals, const std::function<int(const WorkerProcess&)>& work) {
    std::fflush(nullptr); // or the child would print the buffered text again
    const pid_t parent = ::getpid(), child = ::fork();
    if (child < 0)
        throw Outage(fmt::format("no worker process: {}", std::strerror(errno)));
    if (child > 0)
        return child;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent)
        ::_exit(unfinished);
    signals.restore();
    int code = internal_error;
    try {
        code = work(worker.process);
    } catch (const Misuse& failure) {
        fmt::print(stderr, "scanshade: {}\n", failure.what());
        code = misuse;
    } catch (const Outage& failure) {
        fmt::print(stderr, "scanshade: {}\n", failure.what());
        code = unfinished;
    } catch (const Error& failure) {
        fmt::print(stderr, "scanshade: {}\n", failure.what());
        code = nothing_done;
    } catch (const std::exception& failure) {
        const auto no_memory = failed_allocation(failure);
        fmt::print(stderr, "scanshade: {}\n", no_memory.value_or(fmt::format("internal error: {}", failure.what())));
        code = no_memory ? unfinished : internal_error;
    }
    std::fflush(nullptr);
    ::_exit(code); // without destructors: the objects belong to the parent
}

/// Whether the worker gets another process; if so, sets `carefully` for it.
bool restarts(Worker& worker, int status) {
    const std::uint64_t finished = *worker.process.finished;
    worker.in_vain = finished > std::exchange(worker.finished_before, finished) ? 0 : worker.in_vain + 1;
    const bool killed = WIFSIGNALED(status);
    if ((!killed && WEXITSTATUS(status) != unfinished) || worker.in_vain >= patience)
        return false;
    worker.process.carefully = killed;
    return true;
}

} // namespace

int worse(int a, int b) {
    constexpr std::array mildest_first = {int(all_well),       int(nothing_done), int(some_failed),
                                          int(internal_error), int(unfinished),   int(misuse)};
    if (a != b && std::min(a, b) == all_well && std::max(a, b) == nothing_done)
        return some_failed;
    const auto rank = [&](int code) { return std::ranges::find(mildest_first, code) - mildest_first.begin(); };
    return rank(a) > rank(b) ? a : b;
}

int supervise(int workers, const std::function<int(const WorkerProcess&)>& work) {
    const SharedCounts counts(workers);
    const Signals signals;
    std::map<pid_t, Worker> running;
    for (int index = 0; index < workers; ++index) {
        const Worker worker{{index, false, &counts.at(index)}};
        running.emplace(start(worker, signals, work), worker);
    }
    bool interrupted = false;
    int code = -1;
    while (!running.empty()) {
        const int signal = signals.wait();
        if (signal != SIGCHLD) {
            // A terminal and Slurm signal the children as well. A second signal of the same kind would kill them, so
            // they get the other one.
            interrupted = true;
            for (const auto& [child, worker] : running)
                ::kill(child, signal == SIGINT ? SIGTERM : SIGINT);
            continue;
        }
        int status = 0;
        for (pid_t child; (child = ::waitpid(-1, &status, WNOHANG)) > 0;) {
            auto found = running.extract(child);
            if (found.empty())
                continue;
            Worker& worker = found.mapped();
            const bool killed = WIFSIGNALED(status);
            if (killed)
                warn(fmt::format("worker {} was killed: {}", worker.process.index + 1, strsignal(WTERMSIG(status))));
            if (!interrupted && restarts(worker, status)) {
                running.emplace(start(worker, signals, work), worker);
                continue;
            }
            const int its_code = !killed ? WEXITSTATUS(status) : interrupted ? unfinished : internal_error;
            code = code < 0 ? its_code : worse(code, its_code);
        }
    }
    return code;
}

} // namespace scanshade
