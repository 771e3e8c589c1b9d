// `scanshade run`: ambient occlusion for every frame of one or more captures.
#include "apps/jobs/folder_probe.h"
#include "apps/jobs/job_run.h"
#include "apps/jobs/stored_tasks.h"
#include "apps/results/captures_page.h"
#include "apps/run/capture_runs.h"
#include "apps/run/interruption.h"
#include "apps/run/openings.h"
#include "apps/run/tally.h"
#include "apps/walk/progress.h"
#include "io/captures/listing/layouts.h"
#include "io/files.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <fmt/format.h>
#include <functional>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <set>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

class Run final : public Command {
  public:
    Words words() override { return {"PATH", "captures: folders, depth images or clouds", &asked_.paths, 1, 1 << 20}; }

    std::vector<Stage> stages() override { return asked_.stages(); }
    void take_preset() override { asked_.take_preset(); }

    int run() override {
        if (asked_.log_json)
            log_as_json();
        if (asked_.quiet)
            be_quiet();
        if (std::ranges::any_of(asked_.paths, is_job))
            return run_planned();
        if (asked_.out.empty())
            throw Misuse("run needs -o FOLDER for its results");
        asked_.resolve(); // refuses before anything is opened
        int unopened = 0;
        Tally tally(asked_.strict);
        std::vector<CaptureJob> jobs = plan(unopened, tally);
        for (const CaptureJob& job : jobs) {
            require_folders(job.folder());
            if (!asked_.overwrite)
                asked_.resume ? refuse_another_captures_results(job) : refuse_to_overwrite(job);
        }
        if (jobs.empty())
            return tally.exit_code(unopened);
        if (!asked_.overwrite)
            refuse_foreign_page(asked_.out);

        cv::setNumThreads(1); // frames are the parallelism; threads inside a frame would only compete with them
        end_gracefully_on_signals();
        std::mutex counting;
        CapturesPage page(asked_.out);
        for (const CaptureJob& job : jobs)
            page.add(job.folder().filename().string(), job.folder(), job.batch.frames.size(),
                     {job.capture.path.string()});
        overlapped(jobs.size(), captures_.at_once(), [&](std::size_t i, OrderedOutput& output) {
            if (interrupted)
                return;
            std::vector<FrameRow> rows;
            Fault fault = Fault::none;
            try {
                rows = captures_.process(std::move(jobs[i]), output);
                page.take(i, rows);
            } catch (const DeviceLost&) { // the other captures need it, too
                throw;
            } catch (const Misuse&) {
                throw;
            } catch (const Outage& failure) {
                warn(fmt::format("failed: {}", failure.what()));
                fault = Fault::outage;
                const std::lock_guard alone(counting);
                failures_.push_back(fmt::format("ended early: {}; --resume continues", failure.what()));
            }
            const std::lock_guard alone(counting);
            tally.add(rows);
            tally.add(fault);
        });
        if (asked_.page && asked_.paths.size() > 1) {
            page.write(fmt::format("{} captures, {}", jobs.size(), asked_.method), std::move(failures_));
            say(fmt::format("page of all captures -> {}", (fs::path(asked_.out) / "index.html").string()));
        }
        for (const std::string& sentence : captures_.expectations())
            say(sentence);
        if (const std::string sentence = tally.doubt_sentence(); !sentence.empty())
            warn(sentence);
        return tally.exit_code(unopened);
    }

  private:
    /// Opens the captures. One that cannot be opened is reported and counted; it stops no other. A folder of several
    /// stands for all of them.
    std::vector<CaptureJob> plan(int& unopened, Tally& tally) {
        std::vector<std::shared_ptr<OpenedCapture>> opened; // none: not opened
        for (std::size_t i = 0; i < asked_.paths.size(); ++i) {
            try {
                opened.push_back(opened_or_told(asked_.paths[i], unopened, tally));
            } catch (const SeveralCaptures& found) {
                say(fmt::format("{}: {} captures", asked_.paths[i], found.captures.size()));
                const auto at = asked_.paths.erase(asked_.paths.begin() + static_cast<std::ptrdiff_t>(i));
                asked_.paths.insert(at, found.captures.begin(), found.captures.end());
                --i;
            }
        }
        std::vector<CaptureJob> jobs;
        std::set<std::string> taken;
        for (std::size_t i = 0; i < opened.size(); ++i) {
            const fs::path folder =
                opened.size() == 1 ? fs::path(asked_.out) : asked_.out / fs::path(folder_name(asked_.paths[i], taken));
            if (opened[i])
                jobs.push_back(openings_.job_from(std::move(opened[i]), folder));
        }
        return jobs;
    }

    /// None where it cannot be opened, for a reason that is told. Throws SeveralCaptures for a folder of them.
    std::shared_ptr<OpenedCapture> opened_or_told(const std::string& path, int& unopened, Tally& tally) {
        try {
            return openings_.opened(path);
        } catch (const Misuse&) {
            throw;
        } catch (const SeveralCaptures&) {
            throw;
        } catch (const Outage& failure) {
            warn(fmt::format("failed: {}", failure.what()));
            failures_.push_back(fmt::format("not opened: {}", failure.what()));
            tally.add(Fault::outage);
        } catch (const Error& failure) {
            warn(fmt::format("failed: {}", failure.what()));
            failures_.push_back(fmt::format("not opened: {}", failure.what()));
            ++unopened;
        } catch (const std::exception& failure) {
            const auto no_memory = failed_allocation(failure);
            warn("failed: " + no_memory.value_or(fmt::format("internal error: {}", failure.what())));
            tally.add(no_memory ? Fault::outage : Fault::internal);
        }
        return nullptr;
    }

    /// A job made by `plan`: in worker processes, task by task.
    int run_planned() {
        if (asked_.paths.size() != 1 || !asked_.out.empty() || asked_.overwrite)
            throw Misuse("run JOB continues that job in its own folder; it takes neither other captures, nor -o, nor "
                         "--overwrite");
        const fs::path job = asked_.paths.front();
        require_folder(job / "results");
        require_job_folder(job, !asked_.no_locks);
        const Plan plan = read_plan(job);
        const Shard shard = shard_from(asked_.shard);
        for (const Stage& stage : stages())
            for (const auto& [name, value] : plan.settings)
                if (const Parameter* row = row_named(stage.rows, name))
                    set(*row, value);
        asked_.out = (job / "results").string();
        asked_.resume = true;
        asked_.resolve();
        for (const Task& task : plan.tasks)
            if (const std::string block = task.block(); !block.empty())
                captures_.add_block(results_of(job, task), block);
        return supervise(1, [&](const WorkerProcess& worker) {
            cv::setNumThreads(1);
            end_gracefully_on_signals();
            std::optional<StoredTasks> stored;
            if (plan.hooks.any())
                stored.emplace(job, plan, captures_.blocks(), asked_.scratch, asked_.scratch_limit_gb, asked_.retry,
                               interrupted);
            const auto tally_of = [&](const std::vector<FrameRow>& rows) {
                Tally tally(asked_.strict);
                tally.add(rows);
                return tally.exit_code(0);
            };
            std::function<void(const Task&)> help;
            if (!stored)
                help = [&](const Task& task) { captures_.help(job_of(task, {task.capture, results_of(job, task)})); };
            return work_through(
                job, plan, shard, interrupted, worker.carefully ? 1 : captures_.at_once(stored.has_value()),
                !asked_.no_locks,
                [&](const Task& task, OrderedOutput& output) {
                    if (!stored)
                        return tally_of(
                            captures_.process(job_of(task, {task.capture, results_of(job, task)}), output, worker));
                    return stored->run(task, [&](const TaskFolders& folders, Journal& journal) {
                        return tally_of(process_stored(task, folders, journal, output, worker));
                    });
                },
                help);
        });
    }

    std::vector<FrameRow> process_stored(const Task& task, const TaskFolders& folders, Journal& journal,
                                         OrderedOutput& output, const WorkerProcess& worker) {
        CaptureJob job = job_of(task, folders);
        journal.fetched(folders.capture, job.batch.frames.size());
        job.capture.path = task.capture; // for people: where it was fetched to tells them nothing
        return captures_.process(std::move(job), output, worker, &journal);
    }

    CaptureJob job_of(const Task& task, const TaskFolders& folders) {
        // The plan could open it, so the problem may be temporary.
        if (!is_there(folders.capture))
            throw Outage(folders.capture.string() + ": not there any more");
        const bool whole = task.frames == task.of;
        CaptureJob job = openings_.job_from(
            whole ? openings_.opened(folders.capture) : openings_.opened_for_blocks(folders.capture), folders.results);
        if (task.of == 0) // a source, of which nothing was known
            return job;
        if (job.of.size() != task.of)
            throw Error(fmt::format("{}: planned with {} frames, has {} now: plan anew", task.capture.string(), task.of,
                                    job.of.size()));
        job.block = task.block();
        job.batch.frames = {job.of.begin() + static_cast<std::ptrdiff_t>(task.first),
                            job.of.begin() + static_cast<std::ptrdiff_t>(task.first + task.frames)};
        return job;
    }

    RunSettings asked_;
    Openings openings_{asked_};
    CaptureRuns captures_{asked_};
    std::vector<std::string> failures_; ///< of whole captures, for the page of all
};

} // namespace

std::unique_ptr<Command> run_command() { return std::make_unique<Run>(); }

} // namespace scanshade
