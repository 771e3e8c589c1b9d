// Everything that `scanshade run` can be told, and what that means to the walk.
#include "apps/run/settings.h"

#include "ao/cloud/cloud_ao.h"
#include "apps/method_settings.h"
#include "apps/settings_file.h"
#include "projection/error.h"

#include <algorithm>
#include <cstdio>
#include <fmt/format.h>
#include <set>
#include <sstream>

namespace scanshade {
namespace {

std::set<std::string> words_of(const std::string& list) {
    std::set<std::string> words;
    std::istringstream stream(list);
    for (std::string word; std::getline(stream, word, ',');) {
        if (word != "ao" && word != "confidence" && word != "shaded" && word != "cloud" && word != "panel")
            throw Misuse("write: '" + word + "' given, expected any of ao,confidence,shaded,cloud,panel");
        words.insert(word);
    }
    return words;
}

/// --cloud.rays and so on.
Stage prefixed(std::string title, const std::string& prefix, std::vector<Parameter> rows) {
    for (Parameter& row : rows)
        row.name = prefix + row.name;
    return {std::move(title), std::move(rows)};
}

std::vector<std::string> method_names() {
    std::vector<std::string> names;
    for (const MethodRow& row : methods())
        names.emplace_back(row.name);
    return names;
}

} // namespace

RunSettings::RunSettings() {
    for (const MethodRow& row : methods())
        setups_.emplace_back(row.name, row.setup());
}

std::vector<Stage> RunSettings::stages() {
    std::vector<Stage> all = common_stages();
    for (const auto& [name, setup] : setups_)
        all.push_back(method_stage(name, *setup));
    all.push_back(cloud_stage());
    all.push_back(sequence_stage());
    return all;
}

std::vector<Stage> RunSettings::stages_in_use() {
    std::vector<Stage> all = common_stages();
    all.push_back(method_stage(method, chosen_setup()));
    all.push_back(cloud_stage());
    all.push_back(sequence_stage());
    return all;
}

std::vector<Stage> RunSettings::common_stages() {
    RunSettings& s = *this;
    const auto [radii, qualities] = method_defaults();
    return {
        {"input",
         {{"frames", "which frames, by index: first:end:step, end not included; negative counts from the end",
           &s.frames},
          {"camera", "a camera file, or fx,fy,cx,cy; replaces the capture's own", &s.camera},
          {"poses", "a trajectory in TUM's rows, as refine --trajectory writes it; replaces the capture's own poses",
           &s.poses},
          {"depth-scale", "mm, tum, sun, nyu, m, or units per metre; replaces the capture's own", &s.depth_scale},
          {.name = "registered",
           .help = "whether colour pixels lie on depth pixels",
           .value = &s.registered,
           .choices = {"auto", "yes", "no"}},
          {"association-limit", "colour, depth and poses farther apart in time are not paired", &s.association_limit_s,
           "s", 0, 1e6}}},
        {"depth preparation",
         {{"depth-range", "NEAR,FAR in metres: depth outside is taken as not recorded; empty = all of it",
           &s.depth_range},
          {"depth-noise",
           "sigma of one depth value, FLOOR,PER_Z2[,GRAIN] for FLOOR + PER_Z2 z^2 metres that err alike over GRAIN "
           "pixels, or auto (measured), none, kinect, tof; what follows is done only where there is any",
           &s.depth_noise},
          {.name = "flying-pixels",
           .help = "where a sensor saw two surfaces at once: drop leaves them unknown",
           .value = &s.flying_pixels,
           .choices = {"drop", "keep"}},
          {"depth-smoothing",
           "radius of the plane fits that depth and normals come from, in those that the noise and the method ask "
           "for; 0 = depth as recorded",
           &s.depth_smoothing, "", 0, 10}}},
        {"method",
         {{.name = "method",
           .help = "which method computes the visibility",
           .value = &s.method,
           .choices = method_names()},
          {.name = "clouds",
           .help = "clouds by rays from every point, or as one camera's view; auto = points, unless a grid or --camera "
                   "tells the camera",
           .value = &s.clouds,
           .choices = {"auto", "points", "view"}},
          {.name = "sequence",
           .help =
               "on: frames of a recording with poses are looked at together with those around them (sequences, below)",
           .value = &s.sequence,
           .choices = {"off", "on"}},
          {"radius", "how far away a surface may still occlude, in metres" + radii, &s.radius},
          {"quality", "the method's quality level" + qualities, &s.quality},
          {"max-error",
           "picks method and quality: the cheapest within this RMSE to truth; 0 = no limit",
           &s.budget.max_error,
           "",
           0,
           1,
           {}},
          {"max-ms",
           "picks method and quality: the most accurate within these device milliseconds per frame; 0 = no limit",
           &s.budget.max_ms,
           "ms",
           0,
           1e6,
           {}},
          {std::string(settings_flag),
           "file of settings, from calibrate-look or an earlier run's manifest.json; flags given "
           "here win",
           &s.settings},
          {"device",
           "index or part of the name of a Vulkan device; empty = the fastest kind; all = every GPU like the fastest",
           &s.device},
          {"in-flight", "frames computed at once on each device; 0 = 3 on a GPU, 1 on a processor", &s.in_flight, "", 0,
           64}}},
        {"output",
         {{"out", "folder of the results; several captures get a folder each in it", &s.out},
          {"write", "any of ao,confidence,shaded,cloud,panel; auto = ao,confidence,shaded, and cloud for clouds",
           &s.write},
          {.name = "format", .help = "of the ao maps", .value = &s.format, .choices = {"png16", "png8", "tiff", "exr"}},
          {.name = "view",
           .help = "whose pixels maps and pictures have, where a colour camera stands beside the depth camera",
           .value = &s.view,
           .choices = {"depth", "colour"}},
          {"shade-strength", "0 leaves the colour, 1 multiplies it by visibility", &s.shade_strength, "", 0, 1},
          {"cloud", "a PLY file: one cloud of all frames with poses, points of the same place merged",
           &s.recording_cloud},
          {"cloud-resolution", "within cubes of this side; 0 = one and a half times what a pixel covers",
           &s.cloud_resolution_m, "m", 0, 100},
          {"colour-cloud", "replace the clouds' colour by colour times visibility", &s.colour_cloud},
          {"overwrite", "replace the results of an earlier run", &s.overwrite},
          {"resume", "go on with an earlier run: what is done, from the same input and settings, stays", &s.resume},
          {"retry", "with --resume: frames that failed are tried again, too", &s.retry},
          {.name = "log",
           .help = "what stderr gets: prose, or a JSON object per line",
           .value = &s.log,
           .choices = {"text", "json"}},
          {"shard", "of a job, the I-th of N parts: I/N; empty = as Slurm or Kubernetes number this one, else all",
           &s.shard},
          {"dump", "folder for what lies between the method's passes, as .npy files with an index.csv per frame",
           &s.dump}}}};
}

Stage RunSettings::cloud_stage() {
    return prefixed("clouds, from every point", "cloud.", clouds_by_points.parameters());
}

Stage RunSettings::sequence_stage() {
    return prefixed("sequences: with --sequence on, frames together with those around them", "sequence.",
                    sequences.parameters());
}

std::pair<std::string, std::string> RunSettings::method_defaults() {
    std::string radii, qualities;
    for (const auto& [name, setup] : setups_) {
        const std::vector<Parameter> rows = setup->parameters();
        if (const Parameter* row = row_named(rows, "radius"))
            radii += fmt::format("; {}: {} by default", name, value_text(*row));
        if (const Parameter* row = row_named(rows, "quality"))
            qualities += fmt::format("; {}: {}, {} by default", name, range_text(*row), value_text(*row));
    }
    return {radii, qualities};
}

void RunSettings::check() const {
    if (out.empty())
        throw Misuse("run needs -o FOLDER for its results");
    (void)outputs();
    if (depth_noise != "auto")
        (void)noise_from_text(depth_noise);
    (void)range();
    if (!recording_cloud.empty() && (resume || paths.size() > 1))
        throw Misuse("cloud: is made of all frames of one capture in one run, without --resume");
    if (budget.any() && !quality.empty())
        throw Misuse("a budget (--max-error, --max-ms) picks the quality: leave --quality out");
    if (!depth_scale.empty())
        (void)depth_encoding(depth_scale, "--depth-scale");
    (void)CloudAo(cloud_ao());
}

Outputs RunSettings::outputs() const {
    Outputs wanted;
    wanted.format = ao_format(format);
    wanted.shade_strength = shade_strength;
    wanted.colour_cloud = colour_cloud;
    wanted.colour_view = view == "colour";
    if (write != "auto") {
        const std::set<std::string> words = words_of(write);
        wanted.ao = words.contains("ao");
        wanted.confidence = words.contains("confidence");
        wanted.shaded = words.contains("shaded");
        wanted.panel = words.contains("panel");
        wanted.cloud = wanted.depth_cloud = words.contains("cloud");
    }
    return wanted;
}

ProjectOptions RunSettings::range() const {
    ProjectOptions limits;
    int used = 0;
    if (depth_range.empty())
        return limits;
    if (std::sscanf(depth_range.c_str(), "%lf,%lf%n", &limits.near_m, &limits.far_m, &used) != 2 ||
        used != static_cast<int>(depth_range.size()) || !(limits.near_m >= 0 && limits.far_m > limits.near_m))
        throw Misuse("depth-range: '" + depth_range + "' given, expected NEAR,FAR in metres, such as 0.4,5");
    return limits;
}

std::optional<Registration> RunSettings::registration() const {
    if (registered == "auto")
        return std::nullopt;
    return registered == "yes" ? Registration::yes : Registration::no;
}

CloudWalk RunSettings::cloud_walk() const {
    if (clouds == "points")
        return CloudWalk::points;
    return clouds == "view" ? CloudWalk::view : CloudWalk::automatic;
}

FitPlaneOptions RunSettings::preparation() const {
    return {.drop_flying = flying_pixels == "drop", .smoothing = depth_smoothing};
}

CloudAoOptions RunSettings::cloud_ao() const {
    CloudAoOptions options = clouds_by_points;
    if (options.radius == 0 && !radius.empty())
        set({"radius", "", &options.radius}, radius);
    return options;
}

MethodSetup& RunSettings::setup_of(std::string_view name) {
    return *std::ranges::find(setups_, name, [](const auto& each) { return each.first; })->second;
}

MethodSetup& RunSettings::chosen_setup() {
    MethodSetup& setup = setup_of(method);
    const std::vector<Parameter> rows = setup.parameters();
    for (const auto& [name, text] : {std::pair("radius", radius), std::pair("quality", quality)}) {
        if (text.empty())
            continue;
        const Parameter* row = row_named(rows, name);
        if (!row)
            throw Misuse(fmt::format("{}: the method {} has no such setting", name, method));
        set(*row, text);
    }
    return setup;
}

double RunSettings::radius_m() { return std::stod(value_text(*row_named(chosen_setup().parameters(), "radius"))); }

} // namespace scanshade
