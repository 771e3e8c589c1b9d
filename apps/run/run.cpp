// `scanshade run`: ambient occlusion for every frame of one or more captures.
#include "apps/jobs/folder_probe.h"
#include "apps/jobs/job_run.h"
#include "apps/jobs/stored_tasks.h"
#include "apps/measure/front.h"
#include "apps/measure/trial.h"
#include "apps/page/run_page.h"
#include "apps/results/captures_page.h"
#include "apps/results/mcap_recording.h"
#include "apps/run/capture_job.h"
#include "apps/run/messages.h"
#include "apps/run/outlook.h"
#include "apps/run/settings.h"
#include "apps/run/workers.h"
#include "apps/slice.h"
#include "apps/walk/batch.h"
#include "apps/walk/capture_light.h"
#include "apps/walk/large_frames.h"
#include "apps/walk/overlap.h"
#include "apps/walk/point_clouds.h"
#include "apps/walk/pose_check.h"
#include "apps/walk/progress.h"
#include "apps/walk/resume.h"
#include "apps/walk/sequence_order.h"
#include "io/files.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <semaphore>
#include <set>
#include <span>
#include <thread>
#include <utility>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

// ---------------------------------------------------------------------------------------------------- interruption

std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch nothing else");

/// The first Ctrl-C, or the end of the terminal, ends the run after the frames in flight; the second one kills it, as
/// always.
void end_gracefully_on_signals() {
    struct sigaction action = {};
    action.sa_handler = [](int) { interrupted = true; };
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    struct sigaction hangup = {};
    sigaction(SIGHUP, nullptr, &hangup);
    if (hangup.sa_handler != SIG_IGN) // nohup keeps a run alive without its terminal
        sigaction(SIGHUP, &action, nullptr);
}

/// Computes a capture's frames together, with one method leased for all of them.
struct Together {
    Together(Workers& workers, const CaptureJob& job, const RunSettings& asked)
        : lease(workers.pool()), pool(*lease),
          sequence(lease->sequence(job.batch.radius_m, job.batch.noise,
                                   asked.in_sequence(job.capture)
                                       ? sequence_options(asked.sequences, job.capture, job.batch.radius_m)
                                       : alone())) {
        if (workers.pool().size() > workers.devices())
            say("  frames of a sequence are computed one at a time, in their order");
        if (sequence.reach() > 0)
            say(fmt::format("  frames within {} of each other are computed together", sequence.reach()));
    }
    MethodPool::Lease lease;
    MethodPool pool; ///< of that one method
    SequenceAo sequence;
};

/// Counts results of frames for the exit code.
class Tally {
  public:
    void add(const std::vector<FrameRow>& rows) {
        all_ += rows.size();
        ok_ += count(rows, FrameStatus::ok);
        doubtful_ += count(rows, FrameStatus::doubtful);
        for (const FrameRow& row : rows)
            faults_.insert(row.fault);
    }
    /// Of a whole capture.
    void add(Fault fault) { faults_.insert(fault); }
    /// The last line of a run; empty if no frame is doubtful.
    [[nodiscard]] std::string doubt_sentence() const {
        return doubtful_ == 0 ? ""
                              : fmt::format("doubtful: {} of {} frames; their results may be wrong", doubtful_, all_);
    }
    [[nodiscard]] int exit_code(int unopened) const {
        if (interrupted || faults_.contains(Fault::outage))
            return unfinished;
        if (faults_.contains(Fault::internal) || faults_.contains(Fault::crash))
            return internal_error;
        if (ok_ == all_ && unopened == 0)
            return all_well;
        return ok_ + doubtful_ == 0 ? nothing_done : some_failed;
    }

  private:
    std::size_t all_ = 0, ok_ = 0, doubtful_ = 0;
    std::set<Fault> faults_;
};

// ---------------------------------------------------------------------------------------------------- the command

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
        Tally tally;
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
        CapturesPage captures(asked_.out);
        for (const CaptureJob& job : jobs)
            captures.add(job.folder().filename().string(), job.folder(), job.batch.frames.size());
        overlapped(jobs.size(), at_once(), [&](std::size_t i, OrderedOutput& output) {
            if (interrupted)
                return;
            std::vector<FrameRow> rows;
            Fault fault = Fault::none;
            try {
                rows = process(std::move(jobs[i]), output);
                captures.take(i, rows);
            } catch (const DeviceLost&) { // the other captures need it, too
                throw;
            } catch (const Misuse&) {
                throw;
            } catch (const NoLight& failure) {
                warn(fmt::format("failed: {}", failure.what()));
                const std::lock_guard alone(counting);
                failures_.push_back(failure.what());
                ++unopened;
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
            captures.write(fmt::format("{} captures, {}", jobs.size(), asked_.method), std::move(failures_));
            say(fmt::format("page of all captures -> {}", (fs::path(asked_.out) / "index.html").string()));
        }
        for (const std::string& sentence : outlook_)
            say(sentence);
        if (const std::string sentence = tally.doubt_sentence(); !sentence.empty())
            warn(sentence);
        return tally.exit_code(unopened);
    }

  private:
    [[nodiscard]] std::shared_ptr<OpenedCapture> opened(const fs::path& path) {
        Capture capture =
            open_capture_at_or_below(path, {asked_.camera, asked_.depth_scale, asked_.association_limit_s, asked_.poses,
                                            asked_.colour, asked_.topic, asked_.median_depth(), asked_.confidence_min});
        refuse_metres(capture);
        refuse_absent_view(capture);
        std::vector<std::size_t> frames = slice(asked_.frames, capture.entries.size());
        auto opened = std::make_shared<OpenedCapture>();
        opened->capture = std::move(capture);
        opened->of = std::move(frames);
        return opened;
    }

    /// The capture of a block that another block is at work on, or has been last, stays open. Others wait meanwhile.
    std::shared_ptr<OpenedCapture> opened_for_blocks(const fs::path& path) {
        const std::lock_guard alone(opening_);
        if (last_opened_path_ != path || !last_opened_) {
            last_opened_.reset(); // before the next one takes its memory
            last_opened_ = opened(path);
            last_opened_path_ = path;
        }
        return last_opened_;
    }

    CaptureJob job_from(std::shared_ptr<OpenedCapture> capture, const fs::path& folder) const {
        CaptureJob job(std::move(capture));
        job.batch.frames = job.of;
        job.batch.outputs = asked_.outputs();
        job.batch.outputs.folder = folder;
        job.batch.outputs.unit = job.capture.unit;
        if (!asked_.dump.empty())
            job.batch.dump = fs::path(asked_.dump) / folder.lexically_relative(asked_.out);
        job.batch.registration = asked_.registration();
        job.batch.range = asked_.range();
        job.batch.stop = &interrupted;
        job.batch.say = [](const std::string& sentence) { say("  " + sentence); };
        return job;
    }

    /// Opens the captures. One that cannot be opened is reported and counted; it stops no other.
    std::vector<CaptureJob> plan(int& unopened, Tally& tally) {
        std::vector<CaptureJob> jobs;
        std::set<std::string> taken;
        for (const std::string& path : asked_.paths) {
            const fs::path folder =
                asked_.paths.size() == 1 ? fs::path(asked_.out) : asked_.out / fs::path(folder_name(path, taken));
            try {
                jobs.push_back(job_from(opened(path), folder));
            } catch (const Misuse&) {
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
        }
        return jobs;
    }

    void refuse_absent_view(const Capture& capture) const {
        if (asked_.outputs().colour_view && !capture.colour_camera)
            throw Error(capture.path.string() +
                        ": --view colour needs the pose of a secondary camera for colour; refine finds it");
    }

    /// Settings in metres mean nothing in a capture whose unit is arbitrary.
    void refuse_metres(Capture& capture) {
        if (!capture.unit.arbitrary()) {
            if (asked_.relative_radius != RunSettings().relative_radius)
                capture.warnings.emplace_back("--relative-radius is not used: lengths are not in an arbitrary unit, so "
                                              "--radius sets the radius.");
            return;
        }
        if (const std::vector<std::string> given = asked_.given_in_metres(); !given.empty())
            throw Error(
                fmt::format("{}: {} {} in metres, and its unit is arbitrary ({}): leave {} out (--relative-radius "
                            "sets the radius), or give the unit as --depth-scale UNITS_PER_METRE",
                            capture.path.string(), fmt::join(given, ", "), given.size() > 1 ? "are" : "is",
                            capture.depth.origin, given.size() > 1 ? "them" : "it"));
    }

    /// `workers`: null without a Vulkan device.
    RunReport begun_report(const CaptureJob& job, Workers* workers) {
        const auto& said = job.batch.registration;
        const Registration registration = said.value_or(job.capture.registration);
        RunReport report{.started = std::chrono::system_clock::now(),
                         .device = workers ? workers->device().info() : the_processor(),
                         .method = asked_.method,
                         .settings = asked_.stages_in_use(),
                         .capture = job.capture,
                         .registration = registration,
                         .registration_reason = said ? "--registered" : job.capture.registration_reason,
                         .radius = radius_sentence(asked_, job.capture),
                         .depth_noise = noise_sentence(job.batch.noise, asked_, job.capture.unit),
                         .budget = {},
                         .shading = shading_sentence(job.capture, registration, job.batch.outputs.shade),
                         .frames = {}};
        report.devices = workers ? workers->devices() : 1;
        report.alone = job.block.empty();
        return report;
    }

    static gpu::DeviceInfo the_processor() {
        gpu::DeviceInfo info;
        info.name = "the processor";
        info.kind = "CPU";
        return info;
    }

    /// Picks method and settings for the capture, starting from the command line. Returns sentences about the choice.
    std::vector<std::string> keep_to_budget(const CaptureJob& job, gpu::Device& device) {
        TrialRequest request;
        request.among = job.of;
        request.leave_bad_out = true;
        request.preparation = asked_.preparation();
        const TrialCapture trial = load_trial(job.capture, job.batch.noise, noise_origin(asked_), request);
        const double radius_m = asked_.radius.value_or(request.radius_m);
        const Choice choice = choose(device, shipped_front(), trial, radius_m, asked_.budget);
        asked_.choose(choice.configuration);
        return choice.sentences;
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
                siblings_[results_of(job, task)].insert(journal_file("", block).string());
        return supervise(1, [&](const WorkerProcess& worker) {
            cv::setNumThreads(1);
            end_gracefully_on_signals();
            std::optional<StoredTasks> stored;
            if (plan.hooks.any())
                stored.emplace(job, plan, siblings_, asked_.scratch, asked_.scratch_limit_gb, asked_.retry,
                               interrupted);
            const auto tally_of = [](const std::vector<FrameRow>& rows) {
                Tally tally;
                tally.add(rows);
                return tally.exit_code(0);
            };
            return work_through(
                job, plan, shard, interrupted, worker.carefully ? 1 : at_once(stored.has_value()), !asked_.no_locks,
                [&](const Task& task, OrderedOutput& output) {
                    if (!stored)
                        return tally_of(process(job_of(task, {task.capture, results_of(job, task)}), output, worker));
                    return stored->run(task, [&](const TaskFolders& folders, Journal& journal) {
                        return tally_of(process_stored(task, folders, journal, output, worker));
                    });
                },
                stored ? std::function<void(const Task&)>() : [&](const Task& task) { help(job, task); });
        });
    }

    /// Computes tiles of a task's large clouds for the process that holds it, until that one has ended.
    void help(const fs::path& job_folder, const Task& task) {
        CaptureJob job = job_of(task, {task.capture, results_of(job_folder, task)});
        const std::size_t most = CloudAo(asked_.cloud_ao()).most_at_once();
        if (job.batch.frames.size() == 1 && // else they may be a survey's
            !is_large_cloud(job.capture.entries[job.batch.frames.front()].cloud, most))
            return;
        const Prepared ready = prepare(job);
        const fs::path journal = journal_file(job.folder(), job.block);
        if (ready.by_points)
            help_with_large_clouds(job.capture, job.batch, [&] { return in_use(journal); });
    }

    std::vector<FrameRow> process_stored(const Task& task, const TaskFolders& folders, Journal& journal,
                                         OrderedOutput& output, const WorkerProcess& worker) {
        CaptureJob job = job_of(task, folders);
        journal.fetched(folders.capture, job.batch.frames.size());
        job.capture.path = task.capture; // for people: where it was fetched to tells them nothing
        return process(std::move(job), output, worker, &journal);
    }

    CaptureJob job_of(const Task& task, const TaskFolders& folders) {
        // The plan could open it, so the problem may be temporary.
        if (!is_there(folders.capture))
            throw Outage(folders.capture.string() + ": not there any more");
        const bool whole = task.frames == task.of;
        CaptureJob job =
            job_from(whole ? opened(folders.capture) : opened_for_blocks(folders.capture), folders.results);
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

    /// How many captures are open at once: those whose frames enter the walk (one per sixteen cores), two being opened
    /// before them, and two being finished after them. On a GPU, 40 frames take no longer than opening their capture.
    /// With a budget it is one: nothing may disturb its measurements, and each capture gets other settings.
    /// `stored`: input is fetched for one task and results are delivered for another, both in bounded space.
    [[nodiscard]] std::size_t at_once(bool stored = false) {
        if (asked_.budget.any())
            return 1;
        std::size_t entering = std::max(1U, std::thread::hardware_concurrency() / 16);
        if (asked_.sequence != SequenceUse::off) // keeps one device busy
            entering = asked_.device == "all" ? workers().devices() : 1;
        entrance_.release(static_cast<std::ptrdiff_t>(entering - 1));
        return entering + (stored ? 2 : 4);
    }

    /// Opens the devices when the first frame needs them, so a run with nothing left to do opens none.
    Workers& workers() {
        if (!workers_)
            workers_ = std::make_unique<Workers>(asked_.device, asked_.in_flight);
        return *workers_;
    }

    /// The right to send frames into the walk.
    class Entrance {
      public:
        explicit Entrance(std::counting_semaphore<>& free) : free_(free) { free_.acquire(); }
        ~Entrance() { leave(); }
        Entrance(const Entrance&) = delete;
        Entrance& operator=(const Entrance&) = delete;
        void leave() {
            if (!left_.exchange(true))
                free_.release();
        }

      private:
        std::counting_semaphore<>& free_;
        std::atomic<bool> left_ = false;
    };

    /// One capture, from its journal to its report.
    /// `held`: its journal, where that is not in the folder of its results.
    std::vector<FrameRow> process(CaptureJob job, OrderedOutput& output, const WorkerProcess& worker = {},
                                  Journal* held = nullptr) {
        return_freed_memory();
        output.set_capture(job.capture.path.string());
        std::optional<Journal> own;
        const auto siblings = siblings_.find(job.folder());
        Journal& journal = held ? *held
                                : own.emplace(job.folder(), job.block, fs::path(),
                                              siblings == siblings_.end() ? nullptr : &siblings->second);
        journal.set_capture(job.capture);
        if (asked_.overwrite || !asked_.resume)
            journal.clear();
        const ReportFiles files(job.folder(), job.block);
        const std::string task = task_of(job);
        if (auto rows = rows_if_done(job, journal, task, files))
            return *std::move(rows);
        measure_noise_of(job);
        std::call_once(job.opened->check_poses, [&] {
            if (std::string warning = pose_warning(job.capture, job.of); !warning.empty())
                job.capture.warnings.push_back(std::move(warning));
        });

        Prepared ready = prepare(job);
        std::optional<RecordingCloud> cloud;
        if (!asked_.recording_cloud.empty())
            job.batch.cloud = &cloud.emplace(asked_.cloud_resolution_m, job.capture.unit);
        if (!ready.by_points)
            fit_into_memory(job, ready.report.device.kind == "CPU");
        say(ready.at_work);
        introduce(ready.report, job.batch.frames.size(), ready.by_points);
        prepare_folder(job, files, journal.is_first());
        std::optional<McapRecording> mcap;
        if (job.batch.outputs.mcap)
            job.batch.recording = &mcap.emplace(mcap_file(job.folder(), job.block), job.capture, asked_.resume);
        std::optional<ResultTars> tars;
        if (job.batch.outputs.frames_in_tar > 0) {
            Outputs& outputs = job.batch.outputs;
            outputs.waiting = job.folder() / tar_folder / (job.block.empty() ? ".frames" : ".frames-" + job.block);
            tars.emplace(job.capture, outputs, job.batch.frames, job.block);
        }
        const Recording recording{.journal = journal,
                                  .settings = ready.settings,
                                  .task = task,
                                  .device = ready.report.device.name,
                                  .retry = asked_.retry,
                                  .carefully = worker.carefully,
                                  .finished = worker.finished,
                                  .tars = tars ? &*tars : nullptr};
        walk(job, ready.report, recording);
        if (mcap) {
            finish_mcap(*mcap, job.capture);
            ready.report.recording = mcap->path().filename().string();
        }
        if (tars)
            tars->clean_up();
        const bool recorded = cloud && !interrupted && write_recording(*cloud, job);
        report_on(job, ready.report, journal, files, recorded);
        return std::move(ready.report.frames);
    }

    [[nodiscard]] std::string task_of(const CaptureJob& job) {
        std::call_once(job.opened->make_key, [&] {
            const std::lock_guard alone(alone_);
            job.opened->task_key =
                task_key(asked_.stages_in_use(), job.capture, job.of, asked_.in_sequence(job.capture));
        });
        return job.opened->task_key;
    }

    /// The rows of a capture that an earlier run has finished.
    [[nodiscard]] std::optional<std::vector<FrameRow>> rows_if_done(const CaptureJob& job, const Journal& journal,
                                                                    const std::string& task, const ReportFiles& files) {
        auto rows = rows_if_complete(journal, task, job.capture, job.batch.frames, asked_.retry);
        if (!rows || !fs::exists(files.manifest) ||
            (job.batch.outputs.mcap && !fs::exists(mcap_file(job.folder(), job.block))) ||
            (writes_page(job) && !page::has_page(job.folder())))
            return std::nullopt;
        say(fmt::format("{}: done already, {} frames -> {}", job.capture.path.string(), rows->size(),
                        job.folder().string()));
        return rows;
    }

    /// Measures frames spread over the whole capture, so that its blocks agree. Frames of this block stay in memory.
    void measure_noise_of(CaptureJob& job) const {
        if (asked_.depth_noise != "auto") {
            job.batch.noise = noise_from_text(asked_.depth_noise);
            return;
        }
        const bool colour = shows_colour(job.batch.outputs, !asked_.recording_cloud.empty() || job.batch.outputs.mcap);
        const bool by_points = asked_.clouds != CloudWalk::view && !job.capture.camera;
        job.batch.noise =
            noise_of(job.capture, job.of, &job.loaded, colour,
                     by_points ? CloudAo(asked_.cloud_ao()).most_at_once() : std::numeric_limits<std::size_t>::max());
        const std::set<std::size_t> wanted(job.batch.frames.begin(), job.batch.frames.end());
        std::erase_if(job.loaded, [&](const auto& each) { return !wanted.contains(each.first); });
        job.batch.loaded = &job.loaded;
    }

    /// A capture's method, and its report before any frame is computed.
    struct Prepared {
        RunReport report;
        std::string settings; ///< settings_key()
        std::unique_ptr<PointMethod> points;
        bool by_points;      ///< the capture's clouds are computed from their points, as far as can be told
        std::string at_work; ///< which method on which device, for people
    };

    /// Makes the methods, or keeps those of the last capture. Without a Vulkan device, clouds are computed from their
    /// points on the processor.
    [[nodiscard]] Prepared prepare(CaptureJob& job) {
        const std::lock_guard alone(alone_);
        MethodSetup& own = asked_.chosen_setup();
        job.batch.cloud_tiles = asked_.cloud_tiles;
        job.batch.cloud_walk = own.make_for_points() ? CloudWalk::points : asked_.clouds;
        const bool by_points = computes_points(job);
        const bool no_device = by_points && !asked_.asks_for_device(job.capture);
        Workers* workers = no_device && !workers_ && !gpu::may_have_gpu() && all_by_points(job)
                               ? without_workers(job.batch.no_method)
                           : no_device ? workers_if_any(job.batch.no_method)
                                       : &this->workers();
        std::vector<std::string> budget;
        if (asked_.budget.any())
            budget = keep_to_budget(job, workers->device());
        MethodSetup& setup = asked_.chosen_setup();
        if (workers)
            workers->make(asked_.method, setup, asked_.preparation());
        job.batch.radius_m = asked_.radius_m();
        gpu::Device* gpu = workers && !gpu::is_cpu(workers->device().info()) ? &workers->device() : nullptr;
        auto points = point_method(setup, asked_.cloud_ao(), gpu);
        job.batch.points = points.get();
        RunReport report = begun_report(job, workers);
        report.budget = budget;
        const std::string light = take_light(job, report, by_points);
        std::string settings = settings_key(report, job.batch.outputs, job.batch.noise, light);
        std::string at_work;
        if (by_points) {
            if (!own.make_for_points())
                report.method = "rays from every point";
            if (!gpu)
                report.device = the_processor();
            at_work = fmt::format("{} on {}", report.method, report.device.name);
        } else {
            at_work = fmt::format("{} on {}", asked_.method, workers->description());
        }
        return {std::move(report), std::move(settings), std::move(points), by_points, std::move(at_work)};
    }

    /// The light of the colours, where outputs need it: what an earlier run of the same task has found, else estimated
    /// anew and written beside the results. Returns its text, which belongs to what results were made from.
    std::string take_light(CaptureJob& job, RunReport& report, bool by_points) {
        if (!needs_light(job.batch.outputs))
            return "";
        if (by_points) {
            job.capture.warnings.emplace_back(
                "--shade ambient and --write light need images: clouds computed from their points are multiplied.");
            return "";
        }
        const fs::path file = job.folder() / "light.json";
        const std::string task = task_of(job);
        LightEstimate& light = job.opened->light;
        std::call_once(job.opened->find_light, [&] {
            if (!asked_.resume || !light_in(file, task)) {
                const MethodPool::Lease method = workers().pool().lease();
                light = light_of(job.capture, job.of, *method, job.batch, light_request(asked_.light));
                write_atomically(file, text_of(light, task));
            }
            light = light_in(file, task).value(); // as a later run reads it
        });
        job.batch.light = light.light;
        report.light = light.sentence;
        return text_of(light, "");
    }

    /// Whether the capture holds clouds that are computed from their points. Judged by the clouds in memory; those that
    /// were not kept have no grid, or the noise was not measured.
    [[nodiscard]] static bool computes_points(const CaptureJob& job) {
        const Capture& capture = job.capture;
        if (capture.camera && job.batch.cloud_walk != CloudWalk::points)
            return false;
        std::vector<std::string> unused;
        return std::ranges::none_of(capture.entries, [](const auto& entry) { return entry.cloud.empty(); }) &&
               job.batch.cloud_walk != CloudWalk::view && std::ranges::all_of(job.loaded, [&](const auto& each) {
                   return takes_points(each.second.frame, job.batch.cloud_walk, unused);
               });
    }

    /// Whether nothing but clouds' points remains to be computed. Clouds that are neither in memory nor large may turn
    /// out to be images.
    [[nodiscard]] bool all_by_points(const CaptureJob& job) const {
        const std::size_t most = CloudAo(asked_.cloud_ao()).most_at_once();
        return std::ranges::all_of(job.batch.frames, [&](std::size_t frame) {
            return job.loaded.contains(frame) || is_large_cloud(job.capture.entries[frame].cloud, most);
        });
    }
    static Workers* without_workers(std::string& why_none) {
        why_none = "no device was opened: no GPU, and only points to compute";
        return nullptr;
    }

    /// The devices; null where there are none, and why.
    [[nodiscard]] Workers* workers_if_any(std::string& why_none) {
        try {
            return &workers();
        } catch (const Outage&) {
            throw;
        } catch (const Error& failure) {
            why_none = failure.what();
            return nullptr;
        }
    }

    /// Computes the frames that the journal does not have.
    void walk(CaptureJob& job, RunReport& report, const Recording& recording) {
        Entrance entrance(entrance_);
        job.batch.all_begun = [&] { entrance.leave(); };
        std::optional<Together> together;
        if (asked_.in_sequence(job.capture) || job.batch.cloud)
            job.batch.sequence = &together.emplace(workers(), job, asked_).sequence;
        MethodPool none;
        MethodPool& pool = together ? together->pool : job.batch.no_method.empty() ? workers().pool() : none;
        report.at_once = std::max<std::size_t>(pool.size(), 1);
        Progress progress(job.batch.frames.size());
        const Stopwatch stopwatch;
        report.frames = run_recorded(job.capture, pool, job.batch, recording, [&](const FrameRow& row) {
            progress.add(row);
            report.done_now += is_done(row.status);
            report.ms_now = report.ms_now + row.ms;
        });
        report.took_ms = stopwatch.ms();
        progress.end();
    }

    /// A capture's blocks are joined by `merge`, which writes their page.
    [[nodiscard]] bool writes_page(const CaptureJob& job) const { return asked_.page && job.block.empty(); }

    /// `recorded`: a cloud of all frames is there for the page.
    void report_on(const CaptureJob& job, RunReport& report, const Journal& journal, const ReportFiles& files,
                   bool recorded) {
        {
            const std::lock_guard alone(alone_); // the report names settings
            if (count(report.frames, FrameStatus::ok) > 0)
                report.outlook = outlook(asked_, job.batch.noise, job.capture, report.frames, shipped_front());
            for (const std::string& sentence : report.outlook)
                if (!std::ranges::count(outlook_, sentence))
                    outlook_.push_back(sentence);
            if (job.batch.outputs.frames_in_tar > 0)
                report.outlook.push_back(
                    fmt::format("The results are in {}/: the page has numbers, no images.", tar_folder));
            report.peak_mib = peak_memory_mib();
            write_frames_csv(files.table, report.frames);
            page::RunPage page;
            say_left_alone(write_manifest(files.manifest, report, [&](const FrameRow& row) {
                FrameRow whole = journal.whole(row);
                if (writes_page(job))
                    page.add(page_row(whole, job.capture.entries.at(row.index), job.capture.unit));
                return whole;
            }));
            if (writes_page(job)) {
                json head = manifest_head(report);
                if (recorded)
                    head["recording_points"] = page::recording_stem;
                page.write(job.folder(), page::run_head(head));
            }
        }
        conclude(report, files.table);
        if (writes_page(job))
            say(fmt::format("  page -> {}", (job.folder() / "index.html").string()));
    }

    static void say_left_alone(const std::vector<std::string>& files) {
        if (files.empty())
            return;
        constexpr std::size_t most = 3;
        const auto some = std::span(files).first(std::min(files.size(), most));
        say(fmt::format("  {} of earlier runs left alone ({}{}): `not_of_this_run` in manifest.json lists them",
                        counted(files.size(), "file"), fmt::join(some, ", "), files.size() > most ? " ..." : ""));
    }

    /// Returns whether the page has the cloud, too.
    bool write_recording(const RecordingCloud& cloud, const CaptureJob& job) const {
        if (cloud.points() == 0) {
            say("  no frame had a pose: " + asked_.recording_cloud + " is not written");
            return false;
        }
        if (writes_page(job))
            cloud.write_for_page(job.folder(), page::recording_stem, job.batch.outputs.page_points);
        cloud.write(asked_.recording_cloud);
        say(fmt::format("  {} points, merged within {} -> {}", cloud.points(), cloud.merged_within(),
                        asked_.recording_cloud));
        return writes_page(job);
    }

    static void finish_mcap(McapRecording& recording, const Capture& capture) {
        recording.finish();
        const bool apart = !recording.has_own_stamps() && capture.entries.size() > 1;
        say(fmt::format("  {} -> {}{}", recording.summary(), recording.path().string(),
                        apart ? " (frames are put 1/30 s apart: not all have a time stamp)" : ""));
        if (capture.unit.arbitrary())
            say(fmt::format("  {} is in the recording's arbitrary unit, which players and readers take for metres.",
                            recording.path().filename().string()));
    }

    RunSettings asked_;
    std::mutex opening_; ///< of captures that are computed in blocks
    std::shared_ptr<OpenedCapture> last_opened_;
    fs::path last_opened_path_;
    std::map<fs::path, std::set<std::string>> siblings_; ///< names of the journals of a capture's blocks, by folder
    std::mutex alone_; ///< held while a capture uses settings and devices, but not while its frames are computed
    std::counting_semaphore<> entrance_{1};
    std::unique_ptr<Workers> workers_;
    std::vector<std::string> outlook_;  ///< of all captures, each sentence once
    std::vector<std::string> failures_; ///< of whole captures, for the page of all
};

} // namespace

std::unique_ptr<Command> run_command() { return std::make_unique<Run>(); }

} // namespace scanshade
