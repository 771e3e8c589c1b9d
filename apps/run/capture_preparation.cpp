// What a capture needs before its first frame: noise, method, budget, light, and the head of its report.
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

/// The middle one of the views' extents; 0 where none shows anything.
double typical_extent(std::span<const DepthImage> views) {
    std::vector<double> extents;
    for (const DepthImage& view : views)
        if (const SceneExtent scene = scene_extent(view); scene.diagonal_m > 0)
            extents.push_back(scene.diagonal_m);
    return median(std::move(extents), 0);
}

/// A radius of half the scene looks mostly at what no view shows (doubts/of_view.cpp). Near that, since views differ,
/// it is the longest of 0.2, 0.1, 0.05, 0.02 ... m that is no more than a quarter of the scene: few values, so that
/// captures of one thing share theirs.
double suited_radius(double usual, double extent) {
    constexpr double least_radii = 2.5, least_scene_m = 0.02; // smaller ones are in a wrong unit
    if (extent >= least_radii * usual || extent < least_scene_m)
        return usual;
    const double most = extent / 4, decade = std::pow(10, std::floor(std::log10(most)));
    const double step = most >= 5 * decade ? 5 : most >= 2 * decade ? 2 : 1;
    return std::min(usual, step * decade);
}

/// Clouds without a grid that one camera took each, and noisy: rays from such points read far walls as closed.
void settle_views(CaptureJob& job, std::span<const DepthImage> seen) {
    const bool no_grid = std::ranges::none_of(job.loaded, [](const auto& each) {
        return !each.second.frame.cloud || each.second.frame.cloud->organised() ||
               each.second.frame.camera.pinhole.fx != 0;
    });
    if (!no_grid || std::ranges::any_of(seen, [](const DepthImage& view) { return view.z_m.empty(); }))
        return;
    job.as_views = job.batch.noise.any();
    if (!job.as_views)
        job.batch.noise = {};
}

Workers* without_workers(std::string& why_none) {
    why_none = "no device was opened: no GPU, and only points to compute";
    return nullptr;
}

} // namespace

void CaptureRuns::look_at(CaptureJob& job) const {
    const bool measures_noise = asked_.depth_noise == "auto";
    if (!measures_noise)
        job.batch.noise = noise_from_text(asked_.depth_noise);
    const bool images = std::ranges::all_of(job.capture.entries, [](const auto& entry) { return entry.cloud.empty(); });
    if (!measures_noise && (!images || asked_.gives_radius()))
        return;
    const bool colour = shows_colour(job.batch.outputs, !asked_.recording_cloud.empty() || job.batch.outputs.mcap);
    const bool by_points = asked_.clouds != CloudWalk::view && !job.capture.camera;
    const std::vector<DepthImage> seen =
        first_look(job.capture, job.of, &job.loaded, colour,
                   by_points ? CloudAo(asked_.cloud_ao()).most_at_once() : std::numeric_limits<std::size_t>::max(),
                   measures_noise && asked_.clouds != CloudWalk::points);
    if (measures_noise)
        job.batch.noise = measure_noise(seen);
    if (by_points && measures_noise && !images && asked_.clouds == CloudWalk::automatic)
        settle_views(job, seen);
    if (!job.capture.unit.arbitrary())
        job.extent_m = typical_extent(seen);
    const std::set<std::size_t> wanted(job.batch.frames.begin(), job.batch.frames.end());
    std::erase_if(job.loaded, [&](const auto& each) { return !wanted.contains(each.first); });
    job.batch.loaded = &job.loaded;
}

double CaptureRuns::radius_for(const CaptureJob& job) const {
    const double usual = asked_.radius_m();
    return asked_.gives_radius() || !(job.extent_m > 0) ? usual : suited_radius(usual, job.extent_m);
}

CaptureRuns::Prepared CaptureRuns::prepare(CaptureJob& job) {
    const std::lock_guard alone(alone_);
    const bool needs_no_view = asked_.chosen_setup().make_for_points() != nullptr;
    job.batch.cloud_tiles = asked_.cloud_tiles;
    job.as_views = job.as_views && !needs_no_view;
    job.batch.cloud_walk = needs_no_view ? CloudWalk::points : job.as_views ? CloudWalk::view : asked_.clouds;
    const bool by_points = computes_points(job);
    const bool no_device = by_points && !asked_.asks_for_device(job.capture);
    Workers* workers = no_device && !workers_ && !gpu::may_have_gpu() && all_by_points(job)
                           ? without_workers(job.batch.no_method)
                       : no_device ? workers_if_any(job.batch.no_method)
                                   : &this->workers();
    std::vector<std::string> budget;
    if (asked_.budget.any())
        budget = keep_to_budget(job, workers->device());
    job.batch.radius_m = by_points ? asked_.radius_m() : radius_for(job);
    std::unique_ptr<MethodSetup> setup = asked_.setup_with(job.batch.radius_m);
    std::shared_ptr<MethodPool> methods =
        workers ? workers->pool_of(asked_.method, *setup, asked_.preparation()) : nullptr;
    gpu::Device* gpu = workers && !gpu::is_cpu(workers->device().info()) ? &workers->device() : nullptr;
    auto points = point_method(*setup, asked_.cloud_ao(), gpu);
    job.batch.points = points.get();
    const auto warn_once = [&](std::string warning) { // for all blocks
        if (!std::ranges::count(job.capture.warnings, warning))
            job.capture.warnings.push_back(std::move(warning));
    };
    if (job.batch.radius_m != asked_.radius_m())
        warn_once(small_scene_warning(job));
    if (job.as_views)
        warn_once(
            "points seen by one camera at the origin, with a depth sensor's noise: they are computed as its image. "
            "--clouds points casts rays from every point.");
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
    const Choice choice = choose(device, shipped_front(), trial, radius_for(job), asked_.budget);
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
