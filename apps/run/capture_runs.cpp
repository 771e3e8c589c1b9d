#include "apps/run/capture_runs.h"

#include "apps/budget/front.h"
#include "apps/doubts/pose_check.h"
#include "apps/frame/sequence_steps.h"
#include "apps/page/run_page.h"
#include "apps/results/mcap_recording.h"
#include "apps/run/interruption.h"
#include "apps/run/messages.h"
#include "apps/run/outlook.h"
#include "apps/walk/batch.h"
#include "apps/walk/large_frames.h"
#include "apps/walk/progress.h"
#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>
#include <span>
#include <thread>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// Computes a capture's frames together, with one method leased for all of them.
struct Together {
    Together(MethodPool& methods, const Workers& workers, const CaptureJob& job, const RunSettings& asked)
        : lease(methods), pool(*lease),
          sequence(lease->sequence(job.batch.radius_m, job.batch.noise,
                                   asked.in_sequence(job.capture)
                                       ? sequence_options(asked.sequences, job.capture, job.batch.radius_m)
                                       : alone())) {
        if (methods.size() > workers.devices())
            say("  frames of a sequence are computed one at a time, in their order");
        if (sequence.reach() > 0)
            say(fmt::format("  frames within {} of each other are computed together", sequence.reach()));
    }
    MethodPool::Lease lease;
    MethodPool pool; ///< of that one method
    SequenceAo sequence;
};

void say_left_alone(const std::vector<std::string>& files) {
    if (files.empty())
        return;
    constexpr std::size_t most = 3;
    const auto some = std::span(files).first(std::min(files.size(), most));
    say(fmt::format("  {} of earlier runs left alone ({}{}): `not_of_this_run` in manifest.json lists them",
                    counted(files.size(), "file"), fmt::join(some, ", "), files.size() > most ? " ..." : ""));
}

/// Returns whether the page has the cloud, too.
bool write_recording(const RecordingCloud& cloud, const CaptureJob& job, const std::string& file, bool for_page) {
    if (cloud.points() == 0) {
        say("  no frame had a pose: " + file + " is not written");
        return false;
    }
    if (for_page)
        cloud.write_for_page(job.folder(), page::recording_stem, job.batch.outputs.page_points);
    cloud.write(file);
    say(fmt::format("  {} points, merged within {} -> {}", cloud.points(), cloud.merged_within(), file));
    return for_page;
}

void finish_mcap(McapRecording& recording, const Capture& capture) {
    recording.finish();
    const bool apart = !recording.has_own_stamps() && capture.entries.size() > 1;
    say(fmt::format("  {} -> {}{}", recording.summary(), recording.path().string(),
                    apart ? " (frames are put 1/30 s apart: not all have a time stamp)" : ""));
    if (capture.unit.arbitrary())
        say(fmt::format("  {} is in the recording's arbitrary unit, which players and readers take for metres.",
                        recording.path().filename().string()));
}

} // namespace

std::size_t CaptureRuns::at_once(bool stored) {
    if (asked_.budget.any())
        return 1;
    const std::size_t sixteens = std::max(1U, std::thread::hardware_concurrency() / 16);
    std::size_t entering = sixteens;
    if (asked_.sequence != SequenceUse::off) // keeps one device busy
        entering = asked_.device == "all" ? workers().devices() : 1;
    entrance_.release(static_cast<std::ptrdiff_t>(entering - 1));
    return entering + sixteens * (stored ? 2 : 4);
}

Workers& CaptureRuns::workers() {
    if (!workers_)
        workers_ = std::make_unique<Workers>(asked_.device, asked_.in_flight);
    return *workers_;
}

std::vector<FrameRow> CaptureRuns::process(CaptureJob job, OrderedOutput& output, const WorkerProcess& worker,
                                           Journal* held) {
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
    look_at(job);
    std::call_once(job.opened->check, [&] {
        job.opened->findings = findings_about(job.capture, job.of, asked_);
        std::ranges::copy(job.opened->findings.warnings, std::back_inserter(job.capture.warnings));
    });
    job.batch.findings = job.opened->findings.findings;

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
    walk(job, ready, recording);
    if (mcap) {
        finish_mcap(*mcap, job.capture);
        ready.report.recording = mcap->path().filename().string();
    }
    if (tars)
        tars->clean_up();
    const bool recorded =
        cloud && !interrupted && write_recording(*cloud, job, asked_.recording_cloud, writes_page(job));
    report_on(job, ready, journal, files, recorded);
    return std::move(ready.report.frames);
}

void CaptureRuns::help(CaptureJob job) {
    const std::size_t most = CloudAo(asked_.cloud_ao()).most_at_once();
    if (job.batch.frames.size() == 1 && // else they may be a survey's
        !is_large_cloud(job.capture.entries[job.batch.frames.front()].cloud, most))
        return;
    const Prepared ready = prepare(job);
    const fs::path journal = journal_file(job.folder(), job.block);
    if (ready.by_points)
        help_with_large_clouds(job.capture, job.batch, [&] { return in_use(journal); });
}

std::string CaptureRuns::task_of(const CaptureJob& job) {
    std::call_once(job.opened->make_key, [&] {
        const std::lock_guard alone(alone_);
        job.opened->task_key = task_key(asked_.stages_in_use(), job.capture, job.of, asked_.in_sequence(job.capture));
    });
    return job.opened->task_key;
}

std::optional<std::vector<FrameRow>> CaptureRuns::rows_if_done(const CaptureJob& job, const Journal& journal,
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

void CaptureRuns::walk(CaptureJob& job, Prepared& ready, const Recording& recording) {
    RunReport& report = ready.report;
    Entrance entrance(entrance_);
    job.batch.all_begun = [&] { entrance.leave(); };
    std::optional<Together> together;
    if (asked_.in_sequence(job.capture) || job.batch.cloud)
        job.batch.sequence = &together.emplace(*ready.methods, workers(), job, asked_).sequence;
    MethodPool none;
    MethodPool& pool = together ? together->pool : ready.methods ? *ready.methods : none;
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

void CaptureRuns::report_on(const CaptureJob& job, Prepared& ready, const Journal& journal, const ReportFiles& files,
                            bool recorded) {
    RunReport& report = ready.report;
    {
        const std::lock_guard alone(alone_); // the report names settings
        if (count(report.frames, FrameStatus::ok) > 0)
            report.outlook =
                outlook(asked_, *ready.setup, job.batch.noise, job.capture, report.frames, shipped_front());
        for (const std::string& sentence : report.outlook)
            if (!std::ranges::count(outlook_, sentence))
                outlook_.push_back(sentence);
        if (job.batch.outputs.frames_in_tar > 0)
            report.outlook.push_back(
                fmt::format("The results are in {}/: the page has numbers, no images.", tar_folder));
        report.peak_mib = peak_memory_mib();
        write_frames_csv(files.table, report.frames);
        page::RunPage page;
        write_checks(files.checks,
                     [&](const AddChecks& add_checks) { // one pass: each row is read back from the journal
                         say_left_alone(write_manifest(files.manifest, report, [&](const FrameRow& row) {
                             FrameRow whole = journal.whole(row);
                             add_checks(whole);
                             if (writes_page(job))
                                 page.add(page_row(whole, job.capture.entries.at(row.index), job.capture.unit));
                             return whole;
                         }));
                     });
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

} // namespace scanshade
