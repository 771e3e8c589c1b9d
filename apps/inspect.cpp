// `scanshade inspect`: the content of a capture, and its problems, before anything is computed.
#include "apps/cloud_facts.h"
#include "apps/command.h"
#include "apps/doubts/doubts.h"
#include "apps/doubts/pose_check.h"
#include "apps/json.h"
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "io/images/format.h"
#include "projection/base/error.h"
#include "projection/project.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <tbb/parallel_for.h>
#include <utility>

namespace scanshade {
namespace {

constexpr std::size_t most_samples = 10, most_images = 3;

// ---------------------------------------------------------------------------------------------------- measuring

/// The smallest step between two different depths from `from_m` to `to_m`.
struct DepthStep {
    double from_m, to_m, step_m;
};

/// Sums over the sampled frames.
struct Samples {
    std::vector<float> depths_m;         ///< that were seen, but for those in levels
    std::map<float, std::size_t> levels; ///< depths of integers, and how often each was seen
    std::size_t recorded = 0;            ///< pixels or points, seen or not
    std::size_t seen = 0;
    Eigen::AlignedBox3d extent; ///< of the points of clouds
    std::size_t frames = 0;
    std::map<std::pair<int, int>, int> colour_sizes, depth_sizes; ///< width x height -> how many frames
    std::map<std::string, int> clouds;                            ///< description -> how many
    std::optional<Camera> camera;                                 ///< of the first frame that has one
    std::vector<std::string> warnings;
    std::vector<std::string> without_camera; ///< clouds that none could have taken, each with the reason
    CloudFacts surveyed;                     ///< of clouds without a camera
};

/// One frame's findings; for a bad frame, the reason.
struct Problem {
    std::string frame, why;
};

struct Findings {
    Capture capture;
    Samples samples;
    std::vector<Problem> problems;
    std::size_t poses = 0;
    double path_length_m = 0;
    std::vector<DepthStep> steps;
    double nearest_m = 0, median_m = 0, farthest_m = 0; ///< of the sampled depths
};

void add_depths(const ExaminedFrame& examined, Samples& samples) {
    const auto add = [&](double z) {
        samples.depths_m.push_back(static_cast<float>(z));
        ++samples.seen;
    };
    const Frame& frame = examined.frame;
    samples.recorded += frame.cloud ? frame.cloud->points.size() : static_cast<std::size_t>(examined.depth_size.area());
    for (const DepthLevel& level : examined.levels) {
        samples.levels[level.z_m] += level.count;
        samples.seen += level.count;
    }
    if (frame.cloud)
        for (const Eigen::Vector3d& point : frame.cloud->points) {
            const bool hole = frame.cloud->organised() && point.z() == 0; // as sensors mark it; elsewhere it is a place
            if (!point.allFinite() || hole)
                continue;
            add(point.z());
            samples.extent.extend(point);
        }
    for (const float z : frame.depth_m)
        if (std::isfinite(z) && z != 0)
            add(z);
}

void add_frame(const ExaminedFrame& examined, const CaptureEntry& entry, Samples& samples) {
    const Frame& frame = examined.frame;
    ++samples.frames;
    add_depths(examined, samples);
    if (!frame.colour.empty())
        ++samples.colour_sizes[{frame.colour.cols, frame.colour.rows}];
    if (frame.cloud)
        ++samples.clouds[describe(*frame.cloud->records)];
    else
        ++samples.depth_sizes[{examined.depth_size.width, examined.depth_size.height}];
    for (const auto& sentences : {frame.warnings, doubts_in(frame.findings)})
        for (const std::string& sentence : sentences)
            if (const std::string whole = frame.name + ": " + sentence; // those of the listing are there already
                std::ranges::find(samples.warnings, whole) == samples.warnings.end())
                samples.warnings.push_back(whole);
    // The capture's own warning says so; and points in no order are seen from everywhere.
    const bool without_camera = frame.camera.pinhole.fx == 0 && (!frame.cloud || !frame.cloud->organised());
    if (frame.cloud && without_camera)
        samples.surveyed.add(*frame.cloud, entry.cloud, samples.warnings);
    if (samples.camera || without_camera)
        return;
    try {
        if (!frame.cloud)
            check(frame.camera);
        samples.camera = frame.cloud ? camera_of(frame) : frame.camera;
    } catch (const Error& none) {
        (frame.cloud ? samples.without_camera : samples.warnings).push_back(frame.name + ": " + none.what());
        if (frame.cloud)
            samples.surveyed.add(*frame.cloud, entry.cloud, samples.warnings);
    }
}

/// Up to `most` indices, evenly spread, first and last included.
std::vector<std::size_t> first_to_last(std::size_t count, std::size_t most) {
    std::vector<std::size_t> chosen;
    const std::size_t samples = std::min(count, most);
    for (std::size_t i = 0; i < samples; ++i)
        chosen.push_back(samples == 1 ? 0 : i * (count - 1) / (samples - 1));
    return chosen;
}

/// Steps in bands of half a metre to 6 m. Bands with fewer than 1000 depths or 3 different ones are left
/// out. Steps below a hundredth of a millimetre come from the number format, not from the sensor.
std::vector<DepthStep> depth_steps(const std::vector<DepthLevel>& levels) {
    constexpr float width_m = 0.5f, noise_m = 1e-5f;
    std::vector<DepthStep> steps;
    for (float from = 0; from < 6; from += width_m) {
        const auto begin = std::ranges::lower_bound(levels, from, {}, &DepthLevel::z_m);
        const auto end = std::ranges::lower_bound(begin, levels.end(), from + width_m, {}, &DepthLevel::z_m);
        std::size_t depths = 0;
        float smallest = width_m;
        for (auto level = begin; level != end; ++level) {
            depths += level->count;
            if (level != begin)
                smallest = std::min(smallest, level->z_m - std::prev(level)->z_m);
        }
        if (depths >= 1000 && end - begin >= 3 && smallest > noise_m)
            steps.push_back({from, from + width_m, smallest});
    }
    return steps;
}

void measure_poses(Findings& findings) {
    std::optional<Eigen::Vector3d> before;
    for (const CaptureEntry& entry : findings.capture.entries) {
        if (!entry.world_from_camera)
            continue;
        const Eigen::Vector3d here = entry.world_from_camera->translation();
        findings.path_length_m += before ? (here - *before).norm() : 0;
        before = here;
        ++findings.poses;
    }
}

/// What a run would doubt in a few of the images, and in the poses.
void doubt_images(Findings& findings, const std::vector<std::size_t>& loadable) {
    const Capture& capture = findings.capture;
    std::vector<std::string>& warnings = findings.samples.warnings;
    constexpr int largest_px = 20'000'000; // of several gigabytes, several would be in memory
    if (std::ranges::any_of(findings.samples.depth_sizes, [](const auto& size) {
            return std::int64_t{size.first.first} * size.first.second > largest_px;
        }))
        return;
    for (const std::size_t place : first_to_last(loadable.size(), most_images)) {
        try {
            const Frame frame = capture.load(loadable[place], false);
            if (frame.cloud || frame.camera.pinhole.fx == 0)
                continue;
            const Camera camera = camera_of(frame);
            for (const std::string& doubt : doubts_in(findings_about(camera, project(frame), capture.unit)))
                warnings.push_back(frame.name + ": " + doubt);
        } catch (const OutOfMemory&) {
            throw;
        } catch (const Error&) { // examining the frame has told it
        }
    }
    if (PoseCheck poses = check_poses(capture, loadable); !poses.warning.empty())
        warnings.push_back(std::move(poses.warning));
}

void measure_samples(Findings& findings) {
    std::vector<std::size_t> loadable;
    for (std::size_t i = 0; i < findings.capture.entries.size(); ++i) {
        const CaptureEntry& entry = findings.capture.entries[i];
        if (entry.problem.empty())
            loadable.push_back(i);
        else
            findings.problems.push_back({entry.name, entry.problem});
        for (const std::string& warning : entry.warnings)
            findings.samples.warnings.push_back(entry.name + ": " + warning);
    }
    for (const std::size_t place : first_to_last(loadable.size(), most_samples)) {
        try {
            add_frame(findings.capture.examine(loadable[place]), findings.capture.entries[loadable[place]],
                      findings.samples);
        } catch (const OutOfMemory&) {
            throw;
        } catch (const Error& failure) {
            findings.problems.push_back({findings.capture.entries[loadable[place]].name, failure.what()});
        }
    }
    doubt_images(findings, loadable);
    if (auto& all = findings.samples.without_camera; all.size() > 1) // sweeps of a scanner: all of them
        all = {fmt::format("{} of {} examined clouds have no single camera. The first of them: {}", all.size(),
                           findings.samples.frames, all.front())};
    std::ranges::copy(findings.samples.without_camera, std::back_inserter(findings.samples.warnings));
}

/// All sampled depths, rising.
std::vector<DepthLevel> all_levels(Samples& samples) {
    for (const float z : samples.levels.empty() ? std::vector<float>() : std::exchange(samples.depths_m, {}))
        ++samples.levels[z];
    std::vector<DepthLevel> levels;
    for (const auto& [z_m, count] : samples.levels)
        levels.push_back({z_m, static_cast<std::uint32_t>(count)});
    std::ranges::sort(samples.depths_m);
    for (const float z : samples.depths_m)
        if (levels.empty() || levels.back().z_m != z)
            levels.push_back({z, 1});
        else
            ++levels.back().count;
    return levels;
}

Findings look_at(Capture capture) {
    Findings findings{.capture = std::move(capture), .samples = {}, .problems = {}, .steps = {}};
    measure_poses(findings);
    measure_samples(findings);
    const std::vector<DepthLevel> levels = all_levels(findings.samples);
    if (levels.empty())
        return findings;
    findings.nearest_m = levels.front().z_m;
    std::size_t below = 0;
    const auto middle = std::ranges::find_if(
        levels, [&](const DepthLevel& level) { return (below += level.count) > findings.samples.seen / 2; });
    findings.median_m = middle->z_m;
    findings.farthest_m = levels.back().z_m;
    if (!findings.capture.unit.arbitrary()) // its numbers are computed, not sensed
        findings.steps = depth_steps(levels);
    return findings;
}

double hole_share(const Samples& samples) {
    return samples.recorded == 0 ? 0 : 1 - static_cast<double>(samples.seen) / static_cast<double>(samples.recorded);
}

// ---------------------------------------------------------------------------------------------------- printing

void line(const std::string& name, const std::string& text) { fmt::print("  {:<14} {}\n", name, text); }

std::string sizes_text(const std::map<std::pair<int, int>, int>& sizes) {
    std::string text;
    for (const auto& [size, count] : sizes)
        text += fmt::format("{}{}x{}{}", text.empty() ? "" : ", ", size.first, size.second,
                            sizes.size() > 1 ? fmt::format(" ({} frames)", count) : "");
    return text;
}

void print_depth(const Findings& found) {
    const DepthEncoding& depth = found.capture.depth;
    if (!found.samples.clouds.empty()) { // without a camera z is not a depth, and its unit may be feet
        if (const Eigen::AlignedBox3d& extent = found.samples.extent; !extent.isEmpty())
            for (const int axis : {0, 1})
                line(axis == 0 ? "x" : "y", fmt::format("{:.3f} .. {:.3f}", extent.min()[axis], extent.max()[axis]));
        line("z", fmt::format("{:.3f} .. {:.3f}, median {:.3f}", found.nearest_m, found.farthest_m, found.median_m));
        line("holes", fmt::format("{:.1f} %", 100 * hole_share(found.samples)));
        return;
    }
    line("depth unit", fmt::format("{} ({})", depth.name, depth.origin));
    if (const LengthUnit& unit = found.capture.unit; unit.arbitrary()) {
        line("depth range", fmt::format("{} .. {}, median {}", unit.text(found.nearest_m, 4),
                                        unit.text(found.farthest_m, 4), unit.text(found.median_m, 4)));
        line("holes", fmt::format("{:.1f} %", 100 * hole_share(found.samples)));
        return;
    }
    line("depth range",
         fmt::format("{:.3f} .. {:.3f} m, median {:.3f} m", found.nearest_m, found.farthest_m, found.median_m));
    line("holes", fmt::format("{:.1f} %", 100 * hole_share(found.samples)));
    std::string steps;
    for (const DepthStep& step : std::span(found.steps).first(std::min<std::size_t>(found.steps.size(), 6)))
        steps += fmt::format("{}{:.2g} mm at {:.1f} m", steps.empty() ? "" : ", ", 1000 * step.step_m, step.from_m);
    line("depth step", steps.empty() ? "none seen" : steps);
}

/// Many frames often have the same problem, so only the first few are listed.
void print_some(const std::string& name, const std::vector<std::string>& texts) {
    constexpr std::size_t most = 8;
    for (const std::string& text : std::span(texts).first(std::min(texts.size(), most)))
        line(name, text);
    if (texts.size() > most)
        line(name, fmt::format("... and {} more; --json lists them all", texts.size() - most));
}

void print(const Findings& found) {
    const Capture& capture = found.capture;
    const Samples& samples = found.samples;
    fmt::print("{}\n", capture.path.string());
    line("kind", capture.kind);
    line("frames",
         fmt::format("{}{}; {} examined", capture.entries.size(),
                     found.problems.empty() ? "" : fmt::format(", {} of them unusable", found.problems.size()),
                     samples.frames));
    if (!samples.depth_sizes.empty())
        line("depth size", sizes_text(samples.depth_sizes));
    if (!samples.colour_sizes.empty())
        line("colour size", sizes_text(samples.colour_sizes));
    for (const auto& [description, count] : samples.clouds)
        line("cloud", description);
    if (samples.frames > 0)
        print_depth(found);
    if (!samples.surveyed.empty())
        for (const auto& [name, text] : samples.surveyed.lines())
            line(name, text);
    if (const auto& camera = samples.camera ? samples.camera : capture.camera)
        line("camera", fmt::format("{} ({})", describe(*camera), camera->origin));
    else
        line("camera", samples.clouds.empty() ? "none: --camera gives one" : "none: run casts rays from every point");
    const std::string path = capture.unit.arbitrary() ? capture.unit.text(found.path_length_m)
                                                      : fmt::format("{:.2f} m", found.path_length_m);
    line("poses", found.poses == 0 ? "none" : fmt::format("{}, path {}", found.poses, path));
    const std::string registered(samples.clouds.empty() ? name_of(capture.registration) : "by its nature");
    line("registered",
         registered + (capture.registration_reason.empty() ? "" : " (" + capture.registration_reason + ")"));
    std::vector<std::string> unusable;
    for (const Problem& problem : found.problems)
        unusable.push_back(problem.frame + ": " + problem.why);
    print_some("warning", capture.warnings);
    print_some("warning", samples.warnings);
    print_some("unusable", unusable);
}

json sizes_json(const std::map<std::pair<int, int>, int>& sizes) {
    json text = json::array();
    for (const auto& [size, count] : sizes)
        text.push_back({{"width", size.first}, {"height", size.second}, {"frames", count}});
    return text;
}

json depth_json(const Findings& found) {
    const DepthEncoding& depth = found.capture.depth;
    if (const LengthUnit& unit = found.capture.unit; unit.arbitrary())
        return {{"encoding", depth.name},
                {"origin", depth.origin},
                {"unit", unit.name()},
                {"near", unit.told(found.nearest_m)},
                {"median", unit.told(found.median_m)},
                {"far", unit.told(found.farthest_m)},
                {"holes", hole_share(found.samples)}};
    json text{{"encoding", depth.name},     {"origin", depth.origin},    {"near_m", found.nearest_m},
              {"median_m", found.median_m}, {"far_m", found.farthest_m}, {"holes", hole_share(found.samples)},
              {"steps", json::array()}};
    for (const DepthStep& step : found.steps)
        text["steps"].push_back({{"from_m", step.from_m}, {"to_m", step.to_m}, {"step_m", step.step_m}});
    return text;
}

json to_json(const Findings& found) {
    const Capture& capture = found.capture;
    const auto& camera = found.samples.camera ? found.samples.camera : capture.camera;
    std::vector<std::string> warnings = capture.warnings;
    std::ranges::copy(found.samples.warnings, std::back_inserter(warnings));
    json text{
        {"path", capture.path.string()},
        {"kind", capture.kind},
        {"frames", capture.entries.size()},
        {"frames_looked_into", found.samples.frames},
        {"depth_sizes", sizes_json(found.samples.depth_sizes)},
        {"colour_sizes", sizes_json(found.samples.colour_sizes)},
        {"clouds", json::array()},
        {"depth", depth_json(found)},
        {"camera", camera ? to_json(*camera) : json()},
        {"poses",
         {{"count", found.poses},
          {capture.unit.arbitrary() ? "path_units" : "path_m", capture.unit.told(found.path_length_m)}}},
        {"registration", {{"registered", name_of(capture.registration)}, {"reason", capture.registration_reason}}},
        {"warnings", warnings},
        {"unusable", json::array()}};
    for (const auto& [description, count] : found.samples.clouds)
        text["clouds"].push_back(description);
    if (!found.samples.surveyed.empty())
        text["survey"] = found.samples.surveyed.to_json();
    for (const Problem& problem : found.problems)
        text["unusable"].push_back({{"frame", problem.frame}, {"why", problem.why}});
    return text;
}

// ---------------------------------------------------------------------------------------------------- every frame

/// In the recording's unit.
json pose_json(const std::optional<Eigen::Isometry3d>& pose, const LengthUnit& unit) {
    if (!pose)
        return {};
    json rows = json::array();
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column)
            rows[static_cast<std::size_t>(row)].push_back(
                column == 3 && row < 3 ? unit.told(pose->matrix()(row, column)) : pose->matrix()(row, column));
    return rows;
}

json size_json(cv::Size size) { return {size.width, size.height}; }

std::size_t holes_in(const Frame& frame) {
    if (!frame.cloud)
        return static_cast<std::size_t>(cv::countNonZero(frame.depth_m <= 0));
    return static_cast<std::size_t>(
        std::ranges::count_if(frame.cloud->points, [](const Eigen::Vector3d& point) { return !point.allFinite(); }));
}

/// The facts of one frame, whose depth is decoded for its holes. What is not known is null; "why" says what failed.
json frame_json(const Capture& capture, std::size_t index) {
    const CaptureEntry& entry = capture.entries[index];
    json text{{"name", entry.name},
              {"stamp_s", entry.stamp_s ? json(*entry.stamp_s) : json()},
              {"world_from_camera", pose_json(entry.world_from_camera, capture.unit)},
              {"confidence", json()},
              {"depth_encoding", json()},
              {"warnings", entry.warnings}};
    for (const char* of_content : {"width", "height", "camera", "holes", "colour_size", "colour_camera", "why"})
        text[of_content] = json();
    if (!entry.confidence.empty())
        text["confidence"] = {{"image", entry.confidence}, {"levels", capture.confidence_levels}, {"holes", 0}};
    if (!entry.depth.empty())
        text["depth_encoding"] =
            entry.depth_units_per_metre > 0 ? fmt::format("{}", entry.depth_units_per_metre) : capture.depth.name;
    try {
        const Frame frame = capture.load(index);
        const cv::Size size = frame.cloud ? frame.cloud->grid : frame.depth_m.size();
        text["width"] = size.width;
        text["height"] = size.height;
        if (frame.camera.pinhole.fx > 0)
            text["camera"] = to_json(frame.camera);
        if (frame.colour_camera)
            text["colour_camera"] = to_json(*frame.colour_camera);
        text["world_from_camera"] = pose_json(frame.world_from_camera, capture.unit); // a cloud's file may have it
        text["holes"] = holes_in(frame);
        text["warnings"] = frame.warnings;
        if (!frame.colour.empty())
            text["colour_size"] = size_json(colour_size_of(entry)); // as recorded
    } catch (const OutOfMemory&) {
        throw;
    } catch (const Error& failure) {
        text["why"] = failure.what();
    }
    return text;
}

/// In recording order, decoded on all cores.
json frames_json(const Capture& capture) {
    std::vector<json> frames(capture.entries.size());
    tbb::parallel_for(std::size_t(0), frames.size(), [&](std::size_t i) { frames[i] = frame_json(capture, i); });
    return frames;
}

// ---------------------------------------------------------------------------------------------------- the command

class Inspect final : public Command {
  public:
    Words words() override { return {"PATH", "captures: folders, depth images or clouds", &paths_, 1, 1 << 20}; }

    std::vector<Stage> stages() override {
        return {
            {"input",
             {{.name = "camera",
               .help = "a camera file, or fx,fy,cx,cy; replaces the capture's own",
               .value = &options_.camera},
              {.name = "depth-scale",
               .help = "mm, tum, sun, nyu, m, or units per metre; replaces the capture's own",
               .value = &options_.depth_scale},
              {.name = "topic",
               .help = "the topic of depth images in a recording of ROS; empty = found by name and type",
               .value = &options_.topic},
              {.name = "confidence-min",
               .help = "depth of a lower confidence is a hole, where phones recorded one: 0 low, 1 medium, 2 high",
               .value = &options_.confidence_min,
               .low = 0,
               .high = 2},
              {.name = "copc",
               .help = "COPC whose octree is damaged is refused; no: COPC is read as LAZ is",
               .value = &options_.copc},
              {.name = "association-limit",
               .help = "colour, depth and poses that are farther apart in time are not paired",
               .value = &options_.association_limit_s,
               .unit = "s",
               .low = 0,
               .high = 1e6}}},
            {"output",
             {{.name = "json",
               .help = "prints the same as JSON: an array with an object for each capture",
               .value = &as_json_},
              {.name = "all",
               .help = "adds every frame to the JSON: time, camera, lens, pose, depth unit, sizes, holes, confidence",
               .value = &every_frame_}}}};
    }

    int run() override {
        if (every_frame_ && !as_json_)
            throw Misuse("all: it belongs to --json");
        for (const std::string& path : paths_)
            inspect(path);
        if (as_json_)
            fmt::print("{}\n", text_of(all_));
        return usable_ == 0 ? nothing_done : problems_ > 0 ? some_failed : all_well;
    }

  private:
    /// A folder that is no capture and has several stands for all of them.
    void inspect(const std::filesystem::path& path) {
        tell_of(path, [&] {
            std::vector<std::filesystem::path> below;
            try {
                tell(open_capture(path, options_));
                return;
            } catch (const NoFrames&) {
                below = captures_below(path, options_);
            }
            if (below.size() < 2)
                tell(open_capture_at_or_below(path, options_));
            else
                for (const std::filesystem::path& each : below)
                    tell_of(each, [&] { tell(open_capture(each, options_)); });
        });
    }

    /// What cannot be inspected is told, and the others go on.
    template <class Inspect>
    void tell_of(const std::filesystem::path& path, const Inspect& inspect_it) {
        try {
            inspect_it();
        } catch (const Misuse&) {
            throw;
        } catch (const OutOfMemory&) {
            throw;
        } catch (const Error& failure) {
            fmt::print(stderr, "scanshade: {}\n", failure.what());
            if (as_json_)
                all_.push_back({{"path", path.string()}, {"why", failure.what()}});
            ++problems_;
        }
    }

    void tell(Capture capture) {
        const Findings found = look_at(std::move(capture));
        usable_ += found.samples.frames;
        problems_ += found.problems.size();
        if (!as_json_) {
            print(found);
            return;
        }
        all_.push_back(to_json(found));
        if (every_frame_)
            all_.back()["every_frame"] = frames_json(found.capture);
    }

    std::vector<std::string> paths_;
    CaptureOptions options_;
    bool as_json_ = false, every_frame_ = false;
    json all_ = json::array();
    std::size_t usable_ = 0, problems_ = 0;
};

} // namespace

std::unique_ptr<Command> inspect_command() { return std::make_unique<Inspect>(); }

} // namespace scanshade
