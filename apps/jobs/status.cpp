// `scanshade status`: a job's progress. `scanshade merge`: one report of all its tasks.
#include "apps/command.h"
#include "apps/jobs/job.h"
#include "apps/json.h"
#include "apps/page/run_page.h"
#include "apps/results/captures_page.h"
#include "apps/results/report.h"
#include "apps/walk/progress.h"
#include "io/output_file.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

// ---------------------------------------------------------------------------------------------------- reading a job

enum class Standing { waiting, running, begun, done };

/// One task, as its journal records it.
struct Reading {
    Standing standing = Standing::waiting;
    std::vector<FrameRow> rows; ///< in recording order; empty where only sums were asked for
    TaskSums sums;
    std::string host, device, since;
    std::size_t frames = 0; ///< planned, or found in what was fetched
    StoredFacts stored;     ///< of a job with hooks
};

/// Whether rows are wanted as well: a complete task's sums are at its journal's end, while a million rows take a
/// minute.
enum class Wanted { sums, rows };

Reading read_task(const fs::path& job, const Task& task, bool hooks, Wanted wanted) {
    const fs::path file = journal_file(results_of(job, task), task.block());
    Reading reading;
    reading.frames = task.frames;
    if (std::error_code ignored; !fs::exists(file, ignored))
        return reading;
    if (wanted == Wanted::sums)
        if (auto end = read_journal_end(file); end && end->sums.rows() >= task.frames && !in_use(file)) {
            reading.sums = std::move(end->sums);
            reading.host = std::move(end->host);
            reading.device = std::move(end->device);
            reading.stored = std::move(end->stored);
            if (task.frames == 0)
                reading.frames = reading.sums.rows();
            reading.standing = hooks && reading.stored.ended.empty() ? Standing::begun : Standing::done;
            return reading;
        }
    JournalFacts facts = read_journal(file);
    for (auto& [name, record] : facts.records)
        reading.rows.push_back(std::move(record.row));
    std::ranges::sort(reading.rows, {}, &FrameRow::index);
    reading.host = facts.host;
    reading.device = facts.device;
    reading.since = facts.started;
    reading.stored = std::move(facts.stored);
    for (const FrameRow& row : reading.rows)
        reading.sums.add(row, {task.capture.string(), reading.stored.in});
    if (task.frames == 0)
        reading.frames = std::max(reading.stored.frames, reading.rows.size());
    const bool done = hooks ? !reading.stored.ended.empty() : !facts.complete.empty();
    const bool begun = !reading.rows.empty() || !reading.stored.in.empty();
    reading.standing = in_use(file) ? Standing::running
                       : done       ? Standing::done
                       : begun      ? Standing::begun
                                    : Standing::waiting;
    return reading;
}

/// Sums over a job, task by task, so that memory does not grow with their number.
struct Totals {
    std::size_t tasks = 0, frames = 0, ok = 0, doubtful = 0, failed = 0;
    std::map<Standing, std::size_t> standing;
    double cost = 0, done_cost = 0;
    StageTimes ms{};
    using Group = ReasonGroup;
    using Groups = ReasonGroups;
    Groups reasons, doubts; ///< of failed frames, of doubtful ones
    std::map<std::string, std::size_t> frames_by_host;
    std::size_t refused = 0, delivered = 0; ///< tasks: input that cannot be computed; results where they belong
    Groups troubles;                        ///< of hooks, by reason; `frames` counts tasks

    [[nodiscard]] std::size_t in(Standing which) const {
        const auto found = standing.find(which);
        return found == standing.end() ? 0 : found->second;
    }

    void add(const Task& task, const Reading& reading) {
        ++tasks;
        ++standing[reading.standing];
        frames += reading.frames;
        cost += task.cost;
        const TaskSums& sums = reading.sums;
        ok += sums.ok;
        doubtful += sums.doubtful;
        failed += sums.failed;
        ms = ms + sums.ms;
        done_cost += task.cost * static_cast<double>(sums.settled()) /
                     static_cast<double>(std::max<std::size_t>(reading.frames, 1));
        join(reasons, sums.reasons, task);
        join(doubts, sums.doubts, task);
        const bool ended = !reading.stored.ended.empty();
        if (ended && !reading.stored.refused.empty()) {
            ++refused;
            done_cost += task.cost;
            add(troubles, "refused: " + without_numbers(reading.stored.refused), task.name);
        } else {
            delivered += ended;
        }
        if (!reading.stored.trouble.empty())
            add(troubles, without_numbers(reading.stored.trouble), task.name);
        if (sums.rows() > 0)
            frames_by_host[reading.host + ", " + reading.device] += sums.rows();
    }

  private:
    static void join(Groups& groups, const Groups& more, const Task& task) {
        for (const auto& [reason, group] : more) {
            Group& one = groups[reason];
            if (one.frames == 0)
                one.example = task.name + " " + group.example;
            one.frames += group.frames;
        }
    }
    static void add(Groups& groups, const std::string& reason, const std::string& example) {
        Group& group = groups[reason];
        if (group.frames++ == 0)
            group.example = example;
    }
};

std::size_t settled(const Totals& totals) { return totals.ok + totals.doubtful + totals.failed; }

/// `strict`: doubtful results count like failed frames.
int code_of(const Totals& totals, bool hooks, bool strict) {
    if (settled(totals) < totals.frames || (hooks && totals.delivered + totals.refused < totals.tasks))
        return unfinished;
    if (totals.failed + (strict ? totals.doubtful : 0) + totals.refused == 0)
        return all_well;
    return totals.ok + totals.doubtful == 0 ? nothing_done : some_failed;
}

std::vector<std::pair<std::string, Totals::Group>> most_frequent_first(const Totals::Groups& reasons) {
    std::vector<std::pair<std::string, Totals::Group>> groups(reasons.begin(), reasons.end());
    std::ranges::stable_sort(groups, [](const auto& a, const auto& b) { return a.second.frames > b.second.frames; });
    return groups;
}

std::size_t left_of(const Totals& totals) { return totals.frames - std::min(totals.frames, settled(totals)); }
double work_done(const Totals& totals) { return totals.cost > 0 ? std::min(1.0, totals.done_cost / totals.cost) : 1; }

json reasons_json(const Totals::Groups& reasons) {
    json all = json::array();
    for (const auto& [reason, group] : most_frequent_first(reasons))
        all.push_back({{"reason", reason}, {"frames", group.frames}, {"first", group.example}});
    return all;
}

void print(const Totals& totals, const Plan& plan) {
    fmt::print("tasks   {} done, {} running, {} begun, {} waiting, of {}\n", totals.in(Standing::done),
               totals.in(Standing::running), totals.in(Standing::begun), totals.in(Standing::waiting), totals.tasks);
    fmt::print("frames  {} ok, {} doubtful, {} failed, {} left, of {}\n", totals.ok, totals.doubtful, totals.failed,
               left_of(totals), totals.frames);
    fmt::print("work    {} %\n", percent_text(work_done(totals), left_of(totals) > 0, 1));
    if (!plan.hooks.deliver.empty())
        fmt::print("results {} of {} tasks delivered\n", totals.delivered, totals.tasks);
    if (!plan.refused.empty())
        fmt::print("refused {} captures, when the job was planned\n", plan.refused.size());
    for (const auto& [reason, group] : most_frequent_first(totals.troubles))
        fmt::print("  {:>8} tasks: {} (first: {})\n", group.frames, reason, group.example);
    for (const auto& [host, frames] : totals.frames_by_host)
        fmt::print("  {:>8} frames by {}\n", frames, host);
    for (const auto& [reason, group] : most_frequent_first(totals.doubts))
        fmt::print("  {:>8} doubtful: {} (first: {})\n", group.frames, reason, group.example);
    for (const auto& [reason, group] : most_frequent_first(totals.reasons))
        fmt::print("  {:>8} failed: {} (first: {})\n", group.frames, reason, group.example);
}

Plan plan_of(const std::vector<std::string>& words) {
    if (!is_job(words.front()))
        throw Misuse(words.front() + " is not a job: `scanshade plan DATASET -o JOB` makes one");
    return read_plan(words.front());
}

// ---------------------------------------------------------------------------------------------------- pages

/// The list of a job's captures, and the pages of those that were computed in blocks.
class Pages {
  public:
    explicit Pages(const fs::path& job) : job_(job), captures_(job) {}

    /// Tasks in their order: the blocks of a capture follow each other.
    void add(const Task& task, const Reading& reading) {
        const fs::path folder = results_of(job_, task);
        captures_.take(captures_.add(task.name, folder, reading.frames, {task.capture.string(), reading.stored.in}),
                       reading.rows);
        const std::string block = task.block();
        if (block.empty()) // a whole capture, whose run has written its page
            return;
        if (const fs::path manifest = folder / ("manifest." + block + ".json"); fs::exists(manifest))
            manifests_[folder].push_back(manifest);
    }

    void write(const Plan& plan, const Totals& totals) const {
        for (const auto& [folder, manifests] : manifests_)
            page::write_from_manifests(folder, manifests);
        std::vector<std::string> notes;
        for (const std::string& refused : plan.refused)
            notes.push_back("refused when the job was planned: " + refused);
        captures_.write(fmt::format("{} tasks, {} of {} frames done", totals.tasks, settled(totals), totals.frames),
                        std::move(notes));
    }

  private:
    fs::path job_;
    CapturesPage captures_;
    std::map<fs::path, std::vector<fs::path>> manifests_; ///< of blocks, by the capture's folder
};

// ---------------------------------------------------------------------------------------------------- the commands

constexpr const char* strict_help = "doubtful results make the exit code 2, as failed frames do";

class Status final : public Command {
  public:
    Words words() override { return {"JOB", "the job's folder", &job_, 1, 1}; }

    std::vector<Stage> stages() override {
        return {{"output",
                 {{.name = "json", .help = "prints JSON instead of lines", .value = &as_json_},
                  {.name = "strict", .help = strict_help, .value = &strict_}}}};
    }

    int run() override {
        const Plan plan = plan_of(job_);
        Totals totals;
        std::vector<Running> running;
        for (const Task& task : plan.tasks) {
            const Reading reading = read_task(job_.front(), task, plan.hooks.any(), Wanted::sums);
            totals.add(task, reading);
            if (reading.standing == Standing::running)
                running.push_back({&task, reading.sums.rows(), reading.frames, reading.host, reading.since});
        }
        if (as_json_)
            fmt::print("{}\n", text_of(status_json(totals, running, plan)));
        else
            print_all(totals, running, plan);
        return code_of(totals, plan.hooks.any(), strict_);
    }

  private:
    /// A task that a process works on now.
    struct Running {
        const Task* task;
        std::size_t frames; ///< done
        std::size_t of;
        std::string host, since;
    };

    static void print_all(const Totals& totals, const std::vector<Running>& running, const Plan& plan) {
        print(totals, plan);
        for (const Running& each : running)
            fmt::print("  running {} {}: {} of {} frames, {} since {}\n", each.task->name, each.task->block(),
                       each.frames, each.of, each.host, each.since);
    }

    static json status_json(const Totals& totals, const std::vector<Running>& running, const Plan& plan) {
        json tasks = json::array();
        for (const Running& each : running)
            tasks.push_back({{"task", each.task->name},
                             {"block", each.task->block()},
                             {"frames", each.frames},
                             {"of", each.of},
                             {"host", each.host},
                             {"since", each.since}});
        return {{"tasks",
                 {{"done", totals.in(Standing::done)},
                  {"running", totals.in(Standing::running)},
                  {"begun", totals.in(Standing::begun)},
                  {"waiting", totals.in(Standing::waiting)},
                  {"of", totals.tasks}}},
                {"frames",
                 {{"ok", totals.ok},
                  {"doubtful", totals.doubtful},
                  {"failed", totals.failed},
                  {"left", left_of(totals)},
                  {"of", totals.frames}}},
                {"work_done", work_done(totals)},
                {"frames_by_host", totals.frames_by_host},
                {"doubts", reasons_json(totals.doubts)},
                {"failures", reasons_json(totals.reasons)},
                {"delivered", totals.delivered},
                {"hooks", reasons_json(totals.troubles)},
                {"running", tasks},
                {"refused", plan.refused}};
    }

    std::vector<std::string> job_;
    bool as_json_ = false, strict_ = false;
};

class Merge final : public Command {
  public:
    Words words() override { return {"JOB", "the job's folder", &job_, 1, 1}; }

    std::vector<Stage> stages() override {
        return {{"output",
                 {{.name = "page", .help = "index.html, a list of the captures, and a page for each", .value = &page_},
                  {.name = "strict", .help = strict_help, .value = &strict_}}}};
    }

    int run() override {
        const fs::path job = job_.front();
        const Plan plan = plan_of(job_);
        require_folder(job);
        Totals totals;
        Pages pages(job);
        write_atomically(job / "frames.csv", [&](const fs::path& file) {
            std::ofstream stream(file, std::ios::binary);
            stream.exceptions(std::ios::failbit | std::ios::badbit);
            stream << "capture," << csv_head();
            for (const Task& task : plan.tasks) {
                const Reading reading = read_task(job, task, plan.hooks.any(), Wanted::rows);
                totals.add(task, reading);
                pages.add(task, reading);
                for (const FrameRow& row : reading.rows)
                    stream << csv_line(task.name, row);
            }
            stream.flush();
        });
        write_manifest(job, plan, totals);
        if (page_)
            pages.write(plan, totals);
        print(totals, plan);
        return code_of(totals, plan.hooks.any(), strict_);
    }

  private:
    static void write_manifest(const fs::path& job, const Plan& plan, const Totals& totals) {
        json settings = json::object();
        for (const auto& [name, value] : plan.settings)
            settings[name] = value;
        const json text{{"program", "scanshade"},
                        {"version", SCANSHADE_VERSION},
                        {"settings", settings},
                        {"totals",
                         {{"tasks", totals.tasks},
                          {"frames", totals.frames},
                          {"ok", totals.ok},
                          {"doubtful", totals.doubtful},
                          {"failed", totals.failed},
                          {"stage_ms", stage_json(totals.ms)}}},
                        {"frames_by_host", totals.frames_by_host},
                        {"doubts", reasons_json(totals.doubts)},
                        {"failures", reasons_json(totals.reasons)},
                        {"refused", plan.refused}};
        write_atomically(job / "manifest.json", text_of(text) + "\n");
    }

    std::vector<std::string> job_;
    bool page_ = true, strict_ = false;
};

} // namespace

std::unique_ptr<Command> status_command() { return std::make_unique<Status>(); }
std::unique_ptr<Command> merge_command() { return std::make_unique<Merge>(); }

} // namespace scanshade
