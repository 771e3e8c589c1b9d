#include "apps/budget/trial.h"

#include "ao/gpu/device.h"
#include "apps/compare/map_set.h"
#include "apps/frame/first_look.h"
#include "io/images/image_file.h"
#include "projection/attach.h"
#include "projection/base/error.h"
#include "projection/base/spread.h"
#include "projection/base/stopwatch.h"
#include "projection/project.h"
#include "projection/sensor/expected_error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// The folder's own name, without slashes and dots.
std::string last_name(const fs::path& path) {
    const fs::path whole = fs::weakly_canonical(path);
    return (whole.has_filename() ? whole : whole.parent_path()).stem().string();
}

/// The class of a simulated sensor.
std::optional<SensorClass> class_of_simulated(std::string_view sensor) {
    if (sensor == "ideal")
        return SensorClass::clean;
    if (sensor == "kinect")
        return SensorClass::structured_light;
    if (sensor == "tof")
        return SensorClass::time_of_flight;
    return std::nullopt;
}

/// The exact maps of a generated capture.
struct Truth {
    std::optional<MapSet> ao;
    fs::path depth;
};

Truth truth_beside(const fs::path& capture) {
    if (!fs::is_directory(capture / "truth/ao"))
        return {};
    return {find_maps(capture), capture / "truth/depth"};
}

TrialFrame load_frame(const Capture& capture, std::size_t index, const Truth& truth) {
    const CaptureEntry& entry = capture.entries[index];
    if (!entry.problem.empty())
        throw Error(entry.problem);
    TrialFrame ready{entry.name, capture.load(index), {}, {}, {}};
    ready.frame.camera = camera_of(ready.frame);
    ready.depth = project(ready.frame);
    ready.exact_z_m = ready.frame.depth_m.empty() ? ready.depth.z_m : ready.frame.depth_m;
    if (truth.ao) {
        const auto file = truth.ao->files.find(entry.name);
        if (file == truth.ao->files.end())
            throw Error(fmt::format("{} has no map of this frame", (truth.ao->path / "truth/ao").string()));
        ready.truth = read_ao(file->second);
        if (const fs::path depth = truth.depth / (entry.name + ".tiff"); fs::exists(depth))
            ready.exact_z_m = depth_in_metres(read_stored_depth(depth), depth_encoding("m", "truth"));
        if (ready.truth.size() != ready.exact_z_m.size())
            throw Error(fmt::format("{}: {}x{} expected, as its depth, found {}x{}", file->second.string(),
                                    ready.exact_z_m.cols, ready.exact_z_m.rows, ready.truth.cols, ready.truth.rows));
    }
    return ready;
}

} // namespace

namespace {

std::vector<std::size_t> indices_in(const Capture& capture, const TrialRequest& request) {
    std::vector<std::size_t> indices = request.among;
    for (std::size_t i = 0; request.among.empty() && i < capture.entries.size(); ++i)
        indices.push_back(i);
    return indices;
}

} // namespace

TrialCapture load_trial(const fs::path& path, const TrialRequest& request) {
    const Capture capture = open_capture(path, request.capture);
    require_metres(capture, "a comparison of methods");
    const bool measured = request.depth_noise == "auto";
    const DepthNoise noise = measured ? measure_noise(first_look(capture, indices_in(capture, request)))
                                      : noise_from_text(request.depth_noise);
    return load_trial(capture, noise, measured ? "measured" : "--depth-noise", request);
}

TrialCapture load_trial(const Capture& capture, const DepthNoise& noise, const std::string& noise_origin,
                        const TrialRequest& request) {
    const fs::path& path = capture.path;
    const Truth truth = truth_beside(path);
    const std::vector<std::size_t> among = indices_in(capture, request);
    TrialCapture trial{last_name(path), path, noise, noise_origin, request.radius_m, {}, {}, {}};
    trial.sensor = class_of(trial.noise);
    trial.preparation = request.preparation;
    if (truth.ao) {
        trial.sensor = class_of_simulated(truth.ao->sensor).value_or(trial.sensor);
        trial.radius_m = truth.ao->radius_m.value_or(request.radius_m);
        trial.reference = "ray-traced truth of the generated scene";
    }
    for (const std::size_t index : spread(static_cast<std::size_t>(request.frames), among.size()))
        try {
            during(fmt::format("{}: frame {}", path.string(), capture.entries[among[index]].name),
                   [&] { trial.frames.push_back(load_frame(capture, among[index], truth)); });
        } catch (const Outage&) {
            throw;
        } catch (const Error&) {
            if (!request.leave_bad_out)
                throw;
        }
    if (trial.frames.empty())
        throw Error(fmt::format("{}: none of the frames tried could be loaded", path.string()));
    return trial;
}

std::unique_ptr<MethodSetup> set_up(const Configuration& configuration, double radius_m) {
    std::unique_ptr<MethodSetup> setup = method_named(configuration.method).setup();
    const std::vector<Parameter> rows = setup->parameters();
    if (const Parameter* radius = row_named(rows, "radius"))
        set(*radius, radius_m);
    apply(configuration, *setup);
    return setup;
}

Trial::Trial(gpu::Device& device, Configuration configuration, const DepthNoise& noise, double radius_m,
             FitPlaneOptions preparation)
    : configuration_(std::move(configuration)), setup_(set_up(configuration_, radius_m)),
      method_(device, method_named(configuration_.method), *setup_, preparation), noise_(noise), radius_m_(radius_m) {}

cv::Mat1f Trial::compute(const TrialFrame& frame) {
    const Stopwatch stopwatch;
    const AoMap ao = method_.compute(frame.depth, noise_);
    wall_ms_ = stopwatch.ms();
    device_ms_ = scanshade::device_ms(method_.timings());
    return attach(frame.frame, frame.depth, ao).visibility;
}

std::vector<cv::Mat1f> Trial::compute_together(const std::vector<TrialFrame>& frames, std::size_t first,
                                               std::size_t count) {
    std::vector<std::optional<Eigen::Isometry3d>> poses;
    for (const TrialFrame& each : frames)
        poses.push_back(each.frame.world_from_camera);
    SequenceAoOptions options;
    options.reach = reach_for(poses, radius_m_);
    SequenceAo sequence = method_.sequence(radius_m_, noise_, options);
    for (std::size_t i = 0; i < frames.size(); ++i)
        sequence.add(i, frames[i].depth, poses[i]);
    std::vector<cv::Mat1f> maps;
    for (std::size_t i = first; i < first + count; ++i)
        maps.push_back(attach(frames[i].frame, frames[i].depth, sequence.compute(i).ao).visibility);
    return maps;
}

double Trial::expected_rms(const TrialFrame& frame, const cv::Mat1f& visibility) const {
    const shared::ErrorTable table = method_.errors(noise_);
    const cv::Mat1f errors = visibility.size() == frame.depth.z_m.size()
                                 ? expected_error_of(frame.depth, visibility, radius_m_, noise_, table)
                                 : cv::Mat1f();
    double squares = 0, count = 0;
    for (const float error : errors)
        if (!std::isnan(error)) {
            squares += static_cast<double>(error * error);
            ++count;
        }
    return count > 0 ? std::sqrt(squares / count) : std::numeric_limits<double>::quiet_NaN();
}

double device_ms(const Timings& timings) {
    double sum = 0;
    for (const auto& [name, ms] : timings)
        if (name.find("upload") == std::string::npos && name.find("download") == std::string::npos)
            sum += ms;
    return sum;
}

} // namespace scanshade
