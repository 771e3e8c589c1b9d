// What a capture needs before its first frame: noise, method, budget, light, and the head of its report.
#include "apps/measure/front.h"
#include "apps/measure/trial.h"
#include "apps/run/capture_runs.h"
#include "apps/run/messages.h"
#include "apps/walk/capture_light.h"
#include "apps/walk/large_frames.h"
#include "io/output_file.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <set>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

gpu::DeviceInfo the_processor() {
    gpu::DeviceInfo info;
    info.name = "the processor";
    info.kind = "CPU";
    return info;
}

/// Whether the capture holds clouds that are computed from their points. Judged by the clouds in memory; those that
/// were not kept have no grid, or the noise was not measured.
bool computes_points(const CaptureJob& job) {
    const Capture& capture = job.capture;
    if (capture.camera && job.batch.cloud_walk != CloudWalk::points)
        return false;
    std::vector<std::string> unused;
    return std::ranges::none_of(capture.entries, [](const auto& entry) { return entry.cloud.empty(); }) &&
           job.batch.cloud_walk != CloudWalk::view && std::ranges::all_of(job.loaded, [&](const auto& each) {
               return takes_points(each.second.frame, job.batch.cloud_walk, unused);
           });
}

Workers* without_workers(std::string& why_none) {
    why_none = "no device was opened: no GPU, and only points to compute";
    return nullptr;
}

} // namespace

void CaptureRuns::measure_noise_of(CaptureJob& job) const {
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

CaptureRuns::Prepared CaptureRuns::prepare(CaptureJob& job) {
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

RunReport CaptureRuns::begun_report(const CaptureJob& job, Workers* workers) {
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
    report.colour_encoding = colour_encoding(job.batch.outputs);
    return report;
}

std::vector<std::string> CaptureRuns::keep_to_budget(const CaptureJob& job, gpu::Device& device) {
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

std::string CaptureRuns::take_light(CaptureJob& job, RunReport& report, bool by_points) {
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

bool CaptureRuns::all_by_points(const CaptureJob& job) const {
    const std::size_t most = CloudAo(asked_.cloud_ao()).most_at_once();
    return std::ranges::all_of(job.batch.frames, [&](std::size_t frame) {
        return job.loaded.contains(frame) || is_large_cloud(job.capture.entries[frame].cloud, most);
    });
}

Workers* CaptureRuns::workers_if_any(std::string& why_none) {
    try {
        return &workers();
    } catch (const Outage&) {
        throw;
    } catch (const Error& failure) {
        why_none = failure.what();
        return nullptr;
    }
}

} // namespace scanshade
