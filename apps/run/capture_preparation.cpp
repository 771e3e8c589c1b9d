// What a capture needs before its first frame: noise, method, budget, light, and the head of its report.
#include "apps/budget/budget.h"
#include "apps/budget/front.h"
#include "apps/budget/trial.h"
#include "apps/run/capture_runs.h"
#include "apps/run/messages.h"
#include "apps/walk/large_frames.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/scene_extent.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <set>
#include <span>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

gpu::DeviceInfo the_processor() {
    gpu::DeviceInfo info;
    info.name = "the processor";
    info.kind = "CPU";
    return info;
}

Workers* without_workers(std::string& why_none) {
    why_none = "no device was opened: no GPU, and only points to compute";
    return nullptr;
}

} // namespace

void CaptureRuns::look_at(CaptureJob& job) const {
    const bool colour = shows_colour(job.batch.outputs, !asked_.recording_cloud.empty() || job.batch.outputs.mcap);
    job.look = scanshade::look_at(job.capture, job.of, asked_, job.loaded, colour);
    const std::set<std::size_t> wanted(job.batch.frames.begin(), job.batch.frames.end());
    std::erase_if(job.loaded, [&](const auto& each) { return !wanted.contains(each.first); });
    job.batch.loaded = &job.loaded;
}

CaptureRuns::Prepared CaptureRuns::prepare(CaptureJob& job) {
    const std::lock_guard alone(alone_);
    const bool needs_no_view = asked_.chosen_setup().make_for_points() != nullptr;
    job.batch.cloud_tiles = asked_.cloud_tiles;
    job.batch.noise = job.look.noise;
    job.batch.cloud_walk = cloud_walk_for(asked_, job.look);
    const bool by_points = computes_points(job.capture, job.loaded, job.batch.cloud_walk);
    const bool no_device = by_points && !asked_.asks_for_device(job.capture);
    Workers* workers = no_device && !workers_ && !gpu::may_have_gpu() && all_by_points(job)
                           ? without_workers(job.batch.no_method)
                       : no_device ? workers_if_any(job.batch.no_method)
                                   : &this->workers();
    std::vector<std::string> budget;
    if (asked_.budget.any())
        budget = keep_to_budget(job, workers->device());
    job.batch.radius_m = by_points ? asked_.radius_m() : radius_for(asked_, job.look);
    std::unique_ptr<MethodSetup> setup = asked_.setup_with(job.batch.radius_m);
    std::shared_ptr<MethodPool> methods =
        workers ? workers->pool_of(asked_.method, *setup, asked_.preparation()) : nullptr;
    gpu::Device* gpu = workers && !gpu::is_cpu(workers->device().info()) ? &workers->device() : nullptr;
    auto points = point_method(*setup, asked_.cloud_ao(), gpu,
                               {[this]() -> gpu::Device& {
                                    const std::lock_guard while_opening(alone_);
                                    return this->workers().device();
                                },
                                asked_.preparation()});
    job.batch.points = points.get();
    for (std::string& warning : warnings_about(asked_, job.look, job.batch.radius_m))
        if (!std::ranges::count(job.capture.warnings, warning)) // once for all blocks
            job.capture.warnings.push_back(std::move(warning));
    RunReport report = begun_report(job, workers, *setup);
    report.budget = budget;
    const std::string light = take_light(job, report, by_points);
    std::string settings = settings_key(report, job.batch.outputs, job.batch.noise, light);
    std::string at_work;
    if (by_points) {
        if (!needs_no_view)
            report.method = "rays from every point";
        if (!gpu)
            report.device = the_processor();
        at_work = fmt::format("{} on {}", report.method, report.device.name);
    } else {
        at_work = fmt::format("{} on {}", asked_.method, workers->description(*methods));
    }
    return {std::move(setup),  std::move(methods), std::move(report), std::move(settings),
            std::move(points), by_points,          std::move(at_work)};
}

RunReport CaptureRuns::begun_report(const CaptureJob& job, Workers* workers, MethodSetup& setup) {
    const auto& said = job.batch.registration;
    const Registration registration = said.value_or(job.capture.registration);
    RunReport report{.started = std::chrono::system_clock::now(),
                     .device = workers ? workers->device().info() : the_processor(),
                     .method = asked_.method,
                     .settings = asked_.stages_in_use(setup),
                     .capture = job.capture,
                     .registration = registration,
                     .registration_reason = said ? "--registered" : job.capture.registration_reason,
                     .radius = radius_sentence(asked_, job),
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
    const Choice choice = choose(device, shipped_front(), trial, radius_for(asked_, job.look), asked_.budget);
    asked_.choose(choice.configuration);
    return choice.sentences;
}

std::string CaptureRuns::take_light(CaptureJob& job, RunReport& report, bool by_points) const {
    if (!needs_light(job.batch.outputs))
        return "";
    if (by_points) {
        job.capture.warnings.emplace_back(
            "--shade ambient and --write light need images: clouds computed from their points are multiplied.");
        return "";
    }
    Light light = light_from_text(asked_.light);
    light.in_world = std::ranges::any_of(job.capture.entries,
                                         [](const CaptureEntry& entry) { return entry.world_from_camera.has_value(); });
    job.batch.light = light;
    report.light = light.sentence();
    const Eigen::Vector3d& d = light.direct;
    return light.has_direct() ? fmt::format("light {},{},{} {}", d.x(), d.y(), d.z(), light.in_world) : "";
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
