// The life of a task between stores. Every step leaves a mark that a later run finds: the input's final name, and lines
// in the journal.
#include "apps/jobs/stored_tasks.h"

#include "apps/command.h"
#include "apps/walk/progress.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <chrono>
#include <fmt/format.h>
#include <optional>
#include <thread>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// What the task's results follow from, as far as that is known before anything is fetched.
std::string key_for(const Plan& plan, const Task& task) {
    std::vector<std::string> parts{task.capture.string(), std::to_string(task.listed_bytes), task.block()};
    for (const auto& [name, value] : plan.settings)
        parts.push_back(fmt::format("{}={}", name, value));
    return key_of(parts);
}

/// The capture in a fetched folder: a single file stands for itself.
fs::path capture_in(const fs::path& in) {
    std::optional<fs::path> single;
    for (const auto& entry : fs::directory_iterator(in)) {
        if (single || !entry.is_regular_file())
            return in;
        single = entry.path();
    }
    return single.value_or(in);
}

} // namespace

struct StoredTasks::Work {
    const Task& task;
    std::string key;
    fs::path folder; ///< in scratch; `in` and maybe `out` are in it
    fs::path in, out;
    Journal& journal;
};

StoredTasks::StoredTasks(fs::path job, const Plan& plan, const std::map<fs::path, std::set<std::string>>& siblings,
                         const std::string& scratch, double limit_gb, bool retry, const std::atomic<bool>& stop)
    : job_(std::move(job)), plan_(plan), siblings_(siblings), retry_(retry), stop_(stop),
      scratch_(scratch, job_, static_cast<std::uint64_t>((limit_gb > 0 ? limit_gb : plan.hooks.scratch_limit) * 1e9)) {}

int StoredTasks::run(const Task& task, const std::function<int(const TaskFolders&, Journal&)>& compute) {
    const fs::path results = results_of(job_, task), file = journal_file(results, task.block());
    const std::string name = task.name + " " + task.block();
    // The folder in scratch belongs to whoever holds the journal, so the journal comes first; it only needs the path.
    fs::path out = results;
    if (!plan_.hooks.deliver.empty())
        out = scratch_.path_of(name) / "out";
    const auto siblings = siblings_.find(results);
    Journal journal(results, task.block(), out, siblings == siblings_.end() ? nullptr : &siblings->second);
    const std::string key = key_for(plan_, task);
    const StoredFacts before = journal.facts().stored;
    const int ended_with = before.refused.empty() ? before.code : int(nothing_done);
    if (before.ended == key && !(retry_ && ended_with != all_well)) {
        say(fmt::format("{}: done already", task.name));
        return ended_with;
    }
    const fs::path folder = scratch_.folder_of(name, file);
    Work work{task, key, folder, Scratch::input_in(folder), out, journal};
    int code = before.code;
    const bool computed =
        before.computed == key && !(retry_ && code != all_well) && fs::exists(out) && journal.all_files_are_there();
    if (!computed) {
        try {
            if (!plan_.hooks.fetch.empty())
                fetch(work);
            code = this->compute(work, compute);
        } catch (const Misuse&) {
            throw;
        } catch (const Outage&) {
            throw;
        } catch (const Error& refused) { // trying again cannot help
            warn(fmt::format("failed: {}: {}", task.name, refused.what()));
            journal.ended(key, refused.what());
            Scratch::remove(folder);
            return nothing_done;
        }
        if (code == unfinished)
            return code;
        journal.computed(key, code);
    }
    if (!plan_.hooks.deliver.empty())
        deliver(work);
    journal.ended(key);
    Scratch::remove(folder);
    return code;
}

int StoredTasks::compute(Work& work, const std::function<int(const TaskFolders&, Journal&)>& compute) {
    const bool fetched = !plan_.hooks.fetch.empty();
    fs::create_directories(work.out);
    return compute({fetched ? capture_in(work.in) : work.task.capture, work.out}, work.journal);
}

void StoredTasks::expect(std::uint64_t bytes) {
    std::uint64_t largest = largest_;
    while (bytes > largest && !largest_.compare_exchange_weak(largest, bytes)) {
    }
}

void StoredTasks::back_off(int attempt) const {
    constexpr double longest_s = 60;
    const double wait_s =
        std::min(longest_s, plan_.hooks.wait_s * static_cast<double>(1U << std::min(attempt - 1, 16)));
    const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(wait_s);
    while (!stop_ && std::chrono::steady_clock::now() < until)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    if (stop_)
        throw Outage("interrupted");
}

void StoredTasks::fetch(Work& work) {
    std::error_code trouble;
    if (fs::exists(work.in, trouble)) // by a run that was killed afterwards
        return;
    const Hooks& hooks = plan_.hooks;
    const fs::path part = work.folder / "in.part";
    // The same space again for the results, until some have shown how much it takes.
    const std::uint64_t expected =
        std::max<std::uint64_t>(2 * std::min(work.task.listed_bytes, UINT64_MAX / 4), largest_);
    const Scratch::Turn turn(scratch_, stop_);
    for (int attempt = 1;;) {
        fs::remove_all(part, trouble);
        scratch_.make_room(expected, work.folder, stop_);
        fs::create_directories(part);
        bool over = false;
        const HookWatch watch{.limit_s = static_cast<double>(hooks.limit_s),
                              .ends_because = [&]() -> std::string {
                                  if (stop_)
                                      return "interrupted";
                                  over = scratch_.used() > scratch_.limit();
                                  return over ? "no space" : "";
                              },
                              .lock = work.journal.lock()};
        HookEnd end = run_hook(hooks.fetch, {{"source", work.task.capture.string()}, {"dir", part.string()}}, watch);
        over = over || scratch_.used() > scratch_.limit();
        if (end.well() && !over && fs::is_empty(part)) {
            end.exit_code = -1;
            end.ended_because = "it left the folder empty";
        }
        if (end.well() && !over) {
            fs::rename(part, work.in);
            expect(Scratch::used_by(work.folder));
            return;
        }
        fs::remove_all(part, trouble);
        if (stop_)
            throw Outage(fmt::format("{}: interrupted while its input was fetched", work.task.name));
        if (over && scratch_.others_at_work(work.folder)) // their space will be free
            continue;
        if (over)
            throw Outage(fmt::format("{}: its input does not fit into --scratch-limit, {:.3f} GB, of {}",
                                     work.task.name, static_cast<double>(scratch_.limit()) / 1e9,
                                     scratch_.folder().string()));
        work.journal.hook_failed("fetch", attempt, end.reason(), end.stderr_tail);
        constexpr int not_there = 3;
        if (end.exit_code == not_there && end.ended_because.empty())
            throw Error("fetch: " + end.reason());
        warn(fmt::format("  {}: fetch, try {} of {}: {}", work.task.name, attempt, hooks.tries, end.reason()));
        if (attempt++ == hooks.tries)
            throw Outage(fmt::format("{}: fetch failed {} times: {}", work.task.name, hooks.tries, end.reason()));
        back_off(attempt - 1);
    }
}

void StoredTasks::deliver(Work& work) {
    const Hooks& hooks = plan_.hooks;
    // A delivery goes on when the run is stopped: what is computed would be kept for the next run, but not on another
    // machine.
    for (int attempt = 1;; ++attempt) {
        const HookEnd end = run_hook(hooks.deliver, {{"out", work.out.string()}, {"task", work.task.name}},
                                     {.limit_s = static_cast<double>(hooks.limit_s), .lock = work.journal.lock()});
        if (end.well()) {
            expect(Scratch::used_by(work.folder));
            return;
        }
        work.journal.hook_failed("deliver", attempt, end.reason(), end.stderr_tail);
        warn(fmt::format("  {}: delivery, try {} of {}: {}", work.task.name, attempt, hooks.tries, end.reason()));
        if (attempt == hooks.tries)
            throw Outage(fmt::format("{}: delivery failed {} times: {}", work.task.name, hooks.tries, end.reason()));
        back_off(attempt);
    }
}

} // namespace scanshade
