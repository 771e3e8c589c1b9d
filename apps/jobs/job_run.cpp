// The order of a shard's tasks, and the messages between them.
#include "apps/jobs/job_run.h"

#include "apps/command.h"
#include "apps/walk/overlap.h"
#include "apps/walk/progress.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/stopwatch.h"

#include <fmt/format.h>
#include <mutex>

namespace scanshade {
namespace {

/// Progress of the shard. Remaining time follows from the pace so far, without tasks that were done already.
class Pace {
  public:
    Pace(const Plan& plan, const std::vector<std::size_t>& tasks) : tasks_(tasks.size()) {
        for (const std::size_t task : tasks)
            left_ += plan.tasks[task].cost;
        whole_ = left_;
    }
    /// `finished`: no frame of the task is left.
    void ended(const Task& task, bool finished) {
        const std::lock_guard alone(mutex_);
        const double seconds = stopwatch_.lap_ms() / 1000;
        constexpr double found_done_s = 0.02;
        if (finished && seconds > found_done_s) {
            worked_s_ += seconds;
            worked_ += task.cost;
        }
        finished_ += finished;
        left_ -= finished ? task.cost : 0;
        const bool anything_left = finished_ < tasks_;
        const std::string time_left =
            worked_ == 0 ? ""
                         : fmt::format(", {} left",
                                       anything_left ? time_left_text(left_ / worked_ * worked_s_) : duration_text(0));
        say(fmt::format("task {} of {}{}, {} % of the work{}", ++count_, tasks_, finished ? "" : " is not finished",
                        percent_text(whole_ > 0 ? 1 - left_ / whole_ : 1, anything_left), time_left));
    }

  private:
    std::mutex mutex_;
    std::size_t tasks_, count_ = 0, finished_ = 0;
    double whole_ = 0, left_ = 0, worked_ = 0, worked_s_ = 0;
    Stopwatch stopwatch_; ///< since the last task was done
};

/// Runs tasks and collects their exit codes.
class Attempts {
  public:
    explicit Attempts(const std::function<int(const Task&, OrderedOutput&)>& run_task) : run_task_(run_task) {}

    enum class Result { finished, unfinished, held }; // held: by another run

    Result attempt(const Task& task, OrderedOutput& output) {
        try {
            const int code = run_task_(task, output);
            add(code);
            return code == unfinished ? Result::unfinished : Result::finished;
        } catch (const Misuse&) {
            throw;
        } catch (const DeviceLost&) { // this process cannot do any other task either
            throw;
        } catch (const Busy& busy) {
            say(fmt::format("another run works on it: {}", busy.what()));
            return Result::held;
        } catch (const Outage& failure) {
            warn(fmt::format("failed: {}", failure.what()));
            add(unfinished);
        } catch (const Error& failure) {
            warn(fmt::format("failed: {}", failure.what()));
            add(nothing_done);
        } catch (const std::exception& failure) {
            const auto no_memory = failed_allocation(failure);
            warn("failed: " + no_memory.value_or(fmt::format("internal error: {}", failure.what())));
            add(no_memory ? unfinished : internal_error);
        }
        return Result::unfinished;
    }
    void add(int code) {
        const std::lock_guard alone(mutex_);
        code_ = worse(code_, code);
    }
    [[nodiscard]] int code() const { return code_; }

  private:
    const std::function<int(const Task&, OrderedOutput&)>& run_task_;
    std::mutex mutex_;
    int code_ = all_well;
};

} // namespace

int work_through(const std::filesystem::path& job, const Plan& plan, const Shard& shard, const std::atomic<bool>& stop,
                 std::size_t at_once, bool takes_over, const std::function<int(const Task&, OrderedOutput&)>& run_task,
                 const std::function<void(const Task&)>& help) {
    const auto parts = cut(plan.tasks, shard.of);
    const auto& own = parts[static_cast<std::size_t>(shard.index - 1)];
    say(fmt::format("{}: shard {} of {}, {} of {} tasks", job.string(), shard.index, shard.of, own.size(),
                    plan.tasks.size()));
    Attempts attempts(run_task);
    Pace pace(plan, own);
    overlapped(own.size(), at_once, [&](std::size_t i, OrderedOutput& output) {
        if (stop)
            return attempts.add(unfinished);
        const Task& task = plan.tasks[own[i]];
        pace.ended(task, attempts.attempt(task, output) == Attempts::Result::finished);
    });
    // Other shards begin with their costliest tasks, so unfinished ones are at their ends. Our own shard comes first:
    // tasks that another run held may be free by now.
    const auto is_done = [&](const std::filesystem::path& journal) {
        return is_complete(journal, plan.hooks.any() ? "ended" : "complete");
    };
    std::vector<std::size_t> held;
    for (int next = 0; next < (takes_over ? shard.of : 1); ++next) {
        const auto& part = parts[static_cast<std::size_t>((shard.index - 1 + next) % shard.of)];
        for (auto index = part.rbegin(); index != part.rend(); ++index) {
            if (stop)
                return worse(attempts.code(), unfinished);
            const Task& task = plan.tasks[*index];
            const std::filesystem::path journal = journal_file(results_of(job, task), task.block());
            if (is_done(journal))
                continue;
            if (in_use(journal)) {
                if (task.clouds)
                    held.push_back(*index);
                continue;
            }
            OrderedOutput output;
            if (attempts.attempt(task, output) != Attempts::Result::held && next > 0)
                say(fmt::format("  taken over from shard {}: {}", (shard.index - 1 + next) % shard.of + 1, task.name));
        }
    }
    for (const std::size_t index : help ? held : std::vector<std::size_t>()) {
        const Task& task = plan.tasks[index];
        const std::filesystem::path journal = journal_file(results_of(job, task), task.block());
        try {
            if (!is_done(journal))
                help(task);
        } catch (const Error& failure) {
            say(fmt::format("no more help with {}: {}", task.name, failure.what()));
        }
        if (stop)
            return worse(attempts.code(), unfinished);
        OrderedOutput output;
        if (!is_done(journal) && !in_use(journal) && attempts.attempt(task, output) != Attempts::Result::held)
            say(fmt::format("  taken over: {}", task.name));
    }
    return attempts.code();
}

} // namespace scanshade
