// The walk for many frames: load, project, compute, attach, write, with a bounded number of frames in memory.
#include "apps/walk/batch.h"

#include "apps/frame/frame_steps.h"
#include "apps/walk/frame_files.h"
#include "apps/walk/frame_messages.h"
#include "apps/walk/large_frames.h"
#include "apps/walk/sequence_order.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <exception>
#include <fmt/format.h>
#include <mutex>
#include <optional>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

namespace scanshade {
namespace {

void fail(FrameRow& row, FrameStatus status, Fault fault, const std::exception& failure) {
    row.status = status;
    row.fault = fault;
    row.why = failure.what();
}

/// Runs and times one step of a frame. A frame's failure is caught only here.
template <class Step>
void take(Work& work, double StageTimes::*stage, Step&& step) {
    if (!work.row.why.empty())
        return;
    const Stopwatch stopwatch;
    try {
        step();
    } catch (const DeviceLost& failure) { // not the frame's fault: another device may compute it
        fail(work.row, FrameStatus::skipped, Fault::outage, failure);
    } catch (const Outage& failure) {
        fail(work.row, FrameStatus::failed, Fault::outage, failure);
    } catch (const Error& failure) {
        fail(work.row, FrameStatus::failed, Fault::input, failure);
    } catch (const std::exception& failure) {
        if (const auto no_memory = failed_allocation(failure))
            fail(work.row, FrameStatus::failed, Fault::outage, OutOfMemory(*no_memory));
        else
            fail(work.row, FrameStatus::failed, Fault::internal, failure);
    }
    work.row.ms.*stage = stopwatch.ms();
}

Frame load(const Capture& capture, std::size_t index, const BatchOptions& options) {
    if (const std::string& problem = capture.entries[index].problem; !problem.empty())
        throw Error(problem);
    return capture.load(index, shows_colour(options.outputs, options.cloud || options.recording));
}

/// Computes a value for every point, without a camera's view.
void compute_points(Work& work, const BatchOptions& options) {
    if (work.large)
        return compute_large(work, *options.points);
    compute_points(work, *options.points);
    const std::vector<Intermediate> intermediates = options.points->intermediates();
    if (!options.dump.empty() && !intermediates.empty())
        write_intermediates(options.dump / work.entry.name, intermediates);
}

void attach_and_write(Work& work, const BatchOptions& options) {
    const bool by_points = work.by_points;
    Outputs outputs = by_points ? of_points(options.outputs) : options.outputs;
    FrameImages images;
    double written_ms = 0;
    if (work.large) {
        take(work, &StageTimes::write, [&] { write_large(work, outputs); });
        written_ms = work.row.ms.write;
        outputs.cloud = outputs.tiles3d = false; // what follows shows a part of it
    }
    take(work, &StageTimes::attach, [&] {
        images = attach_values(work, options, options.recording && !by_points ? with_messages(outputs) : outputs,
                               options.cloud != nullptr);
    });
    take(work, &StageTimes::write, [&] {
        if (by_points) {
            std::vector<std::filesystem::path> picture, chunks;
            // Isolated: while it waits it must not begin another frame, whose time would count as this one's.
            tbb::this_task_arena::isolate([&] {
                tbb::parallel_invoke([&] { write_all(work, images, outputs); },
                                     [&] {
                                         if (options.outputs.shaded || options.outputs.panel)
                                             picture = {write_cloud_picture(work, options.outputs)};
                                     },
                                     [&] {
                                         if (options.outputs.preview)
                                             chunks = write_page_points(work, options.outputs);
                                     });
            });
            std::ranges::move(picture, std::back_inserter(work.row.files));
            std::ranges::move(chunks, std::back_inserter(work.row.files));
        } else {
            write_all(work, images, outputs);
        }
        if (options.recording)
            work.messages = frame_messages(work, images, outputs, *options.recording);
    });
    work.row.ms.write += written_ms;
    work.large.reset();
    if (!work.row.why.empty())
        remove_files(work, options.outputs);
    else
        work.row.status = any_doubt(work.row.findings) ? FrameStatus::doubtful : FrameStatus::ok;
}

std::vector<FrameRow> planned_rows(const Capture& capture, const std::vector<std::size_t>& frames) {
    std::vector<FrameRow> rows;
    rows.reserve(frames.size());
    for (const std::size_t index : frames)
        rows.push_back(skipped_row(capture, index));
    return rows;
}

/// The walk as one pipeline, which fills in the frames' rows.
class Pipeline {
  public:
    Pipeline(const Capture& capture, MethodPool& pool, const BatchOptions& options,
             const std::function<void(const FrameRow&)>& on_frame)
        : capture_(capture), pool_(pool), at_once_(options.sequence ? 1 : std::max(1, static_cast<int>(pool.size()))),
          options_(options), on_frame_(on_frame), rows_(planned_rows(capture, options.frames)),
          order_(capture, rows_, options.sequence ? options.sequence->reach() : 0), sequence_buffer_(options.sequence),
          large_(capture, options) {}

    [[nodiscard]] std::vector<FrameRow> run() {
        using tbb::filter_mode;
        using Flow = tbb::flow_control;
        const auto computing = at_once_ > 1 ? filter_mode::parallel : filter_mode::serial_in_order;
        const auto filters =
            tbb::make_filter<void, WorkPtr>(filter_mode::serial_in_order, [&](Flow& flow) { return begin(flow); }) &
            tbb::make_filter<WorkPtr, WorkPtr>(filter_mode::parallel,
                                               [&](const WorkPtr& work) { return prepared(work); }) &
            tbb::make_filter<WorkPtr, WorkPtr>(computing, [&](const WorkPtr& work) { return computed(work); }) &
            tbb::make_filter<WorkPtr, WorkPtr>(filter_mode::parallel,
                                               [&](const WorkPtr& work) { return finished(work); }) &
            tbb::make_filter<WorkPtr, void>(filter_mode::serial_in_order, [&](const WorkPtr& work) { report(work); });
        // A thread that waits for a device leaves its core free, so there is one more for each.
        const int threads = cores() + (at_once_ > 1 ? at_once_ : 0);
        const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism,
                                          static_cast<std::size_t>(threads));
        tbb::task_arena(threads).execute([&] { tbb::parallel_pipeline(frames_in_memory(), filters); });
        for (const WorkPtr& unfinished : sequence_buffer_.rest()) // interrupted before their neighbours arrived
            unfinished->row = skipped_row(capture_, unfinished->row.index);
        if (failure_)
            std::rethrow_exception(failure_);
        return std::move(rows_);
    }

  private:
    [[nodiscard]] static int cores() { return tbb::info::default_concurrency(); }
    [[nodiscard]] std::size_t frames_in_memory() const {
        return static_cast<std::size_t>(options_.frames_in_memory > 0 ? options_.frames_in_memory
                                                                      : cores() + 2 * at_once_);
    }

    WorkPtr begin(tbb::flow_control& flow) {
        if (order_.has_next() && !(options_.stop && *options_.stop) && !given_up_)
            return with_frame_if_loaded(order_.next());
        flow.stop();
        if (options_.all_begun)
            options_.all_begun();
        return {};
    }

    [[nodiscard]] WorkPtr with_frame_if_loaded(WorkPtr work) const {
        const auto known =
            work && options_.loaded ? options_.loaded->extract(work->row.index) : LoadedFrames::node_type();
        if (!known.empty()) {
            work->frame = std::move(known.mapped().frame);
            work->loaded_in_ms = known.mapped().took_ms;
        }
        return work;
    }

    WorkPtr prepared(WorkPtr work) {
        if (!work)
            return work;
        take(*work, &StageTimes::load, [&] {
            if (work->loaded_in_ms == 0 && capture_.entries[work->row.index].problem.empty())
                begin_large(*work);
            if (work->large)
                return;
            if (work->loaded_in_ms == 0)
                work->frame = load(capture_, work->row.index, options_);
            if (options_.registration)
                work->frame.registration = *options_.registration;
            describe_frame(*work);
        });
        if (work->large)
            return work;
        work->row.ms.load += work->loaded_in_ms;
        if (work->row.status != FrameStatus::failed && options_.points)
            choose_points_or_view(*work, options_.cloud_walk);
        if (work->by_points) {
            work->row.ms.project = 0;
            return work;
        }
        take(*work, &StageTimes::project, [&] { prepare_view(*work, options_.range); });
        return work;
    }

    WorkPtr computed(WorkPtr arrived) {
        WorkPtr work = sequence_buffer_.pass(std::move(arrived));
        if (!work || !work->row.why.empty())
            return work;
        if (work->by_points) { // takes all cores and much memory: one at a time, and no other starts while it waits
            const std::lock_guard alone(pool_.alone());
            tbb::this_task_arena::isolate(
                [&] { take(*work, &StageTimes::compute, [&] { compute_points_of(*work); }); });
            if (work->large && work->row.fault == Fault::outage && options_.stop && *options_.stop) {
                work->large.reset();
                work->row = skipped_row(capture_, work->row.index);
                work->row.why = "interrupted";
            }
        } else if (pool_.size() == 0) {
            take(*work, &StageTimes::compute, [&] { throw Outage(options_.no_method); });
        } else {
            const MethodPool::Lease method = pool_.lease();
            // Isolated: some methods use all cores. A frame begun while this one waits for them would wait for a
            // method.
            tbb::this_task_arena::isolate([&] {
                take(*work, &StageTimes::compute, [&] {
                    compute_view(*work, *method, options_.noise, capture_, options_.sequence);
                    dump(*work, *method);
                });
            });
        }
        if (work->row.status == FrameStatus::skipped && work->row.fault == Fault::outage)
            given_up_ = true;
        return work;
    }

    /// A damaged file of a survey must not lose the others.
    void compute_points_of(Work& work) const {
        if (work.large && work.large->files() > 1) {
            try {
                return compute_large(work, *options_.points);
            } catch (const Outage&) {
                throw;
            } catch (const Error& failure) {
                work.large.reset();
                work.row.warnings.push_back(fmt::format(
                    "the survey could not be computed together, so this file is by itself: {}.", failure.what()));
                std::vector<std::string> warnings = std::move(work.row.warnings);
                work.frame = load(capture_, work.row.index, options_);
                describe_frame(work);
                std::ranges::move(warnings, std::back_inserter(work.row.warnings));
            }
        }
        compute_points(work, options_);
    }

    /// A cloud that is computed from disk is not loaded.
    void begin_large(Work& work) {
        std::vector<std::string> warnings = work.entry.warnings, notes;
        const auto [run, file] = large_.part_of(work.row.index, warnings, notes);
        work.large = run;
        work.large_file = file;
        std::ranges::move(notes, std::back_inserter(work.row.notes));
        if (!work.large)
            return;
        work.by_points = true;
        work.row.ms.project = 0;
        work.row.size = work.large->file(work.large_file).records().grid;
        work.row.warnings = std::move(warnings);
    }

    void dump(const Work& work, FrameAo& method) const {
        if (options_.dump.empty())
            return;
        std::vector<Intermediate> all = method.intermediates();
        if (options_.sequence)
            std::ranges::move(options_.sequence->intermediates(), std::back_inserter(all));
        write_intermediates(options_.dump / work.entry.name, all);
    }

    WorkPtr finished(WorkPtr work) const {
        if (work)
            attach_and_write(*work, options_);
        return work;
    }

    /// Frees the images. A failure in here is rethrown after the frames in flight have ended: TBB does not free frames
    /// of a pipeline that throws.
    void report(const WorkPtr& work) {
        if (!work || failure_)
            return;
        try {
            add_to_report(*work);
        } catch (...) {
            failure_ = std::current_exception();
            given_up_ = true;
        }
    }

    void add_to_report(Work& work) {
        if (options_.cloud && is_done(work.row.status))
            add_to(*options_.cloud, work);
        if (options_.recording && is_done(work.row.status))
            options_.recording->add(work.row.index, work.messages);
        outages_ = work.row.fault == Fault::outage ? outages_ + 1 : 0;
        given_up_ = given_up_ || outages_ >= 4;
        if (on_frame_)
            on_frame_(work.row);
        if (options_.short_rows)
            shorten(work.row);
    }

    const Capture& capture_;
    MethodPool& pool_;
    int at_once_;
    const BatchOptions& options_;
    const std::function<void(const FrameRow&)>& on_frame_;
    std::vector<FrameRow> rows_;
    FrameOrder order_;
    SequenceBuffer sequence_buffer_;
    LargeFrames large_;
    std::atomic<bool> given_up_ = false;
    std::exception_ptr failure_; ///< the first while reporting
    int outages_ = 0;            ///< in a row: a full disk stays full, so the run ends
};

} // namespace

std::vector<FrameRow> run_batch(const Capture& capture, MethodPool& pool, const BatchOptions& options,
                                const std::function<void(const FrameRow&)>& on_frame) {
    return Pipeline(capture, pool, options, on_frame).run();
}

} // namespace scanshade
