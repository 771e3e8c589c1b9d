// The settings of `scanshade run`, and the options of the walk that follow from them.
#include "apps/session/settings.h"

#include "ao/cloud/cloud_ao.h"
#include "apps/method_settings.h"
#include "apps/settings_file.h"
#include "io/rasters/geocentric.h"
#include "projection/base/error.h"
#include "projection/base/nearest_word.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <map>
#include <set>
#include <sstream>

namespace scanshade {
namespace {

bool has_cloud(const CaptureEntry& entry) { return !entry.cloud.empty(); }

constexpr std::array registered_words{Named{"auto", Registration::unknown}, Named{"yes", Registration::yes},
                                      Named{"no", Registration::no}};
constexpr std::array flying_words{Named{"drop", true}, Named{"keep", false}};
constexpr std::array tile_words{Named{"auto", CloudTiles::automatic}, Named{"join", CloudTiles::join},
                                Named{"separate", CloudTiles::separate}};
constexpr std::array cloud_words{Named{"auto", CloudWalk::automatic}, Named{"points", CloudWalk::points},
                                 Named{"view", CloudWalk::view}};
constexpr std::array sequence_words{Named{"off", SequenceUse::off}, Named{"on", SequenceUse::on},
                                    Named{"auto", SequenceUse::automatic}};
constexpr auto format_words = [] {
    std::array<Named<AoFormat>, ao_formats.size()> words{};
    std::ranges::transform(ao_formats, words.begin(), [](const auto& row) { return Named{row.name, row.format}; });
    return words;
}();
/// format_words, and none: as many bits as the colour image has.
constexpr auto colour_format_words = [] {
    using Maybe = Named<std::optional<AoFormat>>;
    std::array<Maybe, ao_formats.size() + 1> words{Maybe{"auto", std::nullopt}};
    std::ranges::transform(ao_formats, words.begin() + 1, [](const auto& row) { return Maybe{row.name, row.format}; });
    return words;
}();
constexpr std::array view_words{Named{"depth", false}, Named{"colour", true}};
constexpr std::array colour_words{Named{"kept", CloudColours::kept}, Named{"shaded", CloudColours::shaded},
                                  Named{"grey", CloudColours::grey}};
constexpr std::array shade_words{Named{"multiply", Shade::multiply}, Named{"ambient", Shade::ambient},
                                 Named{"clay", Shade::clay}};
constexpr std::array log_words{Named{"text", false}, Named{"json", true}};

/// quality_words, and none for a quality that was not given.
using MaybeQuality = std::optional<Quality>;
constexpr auto maybe_quality_words = [] {
    std::array<Named<MaybeQuality>, quality_words.size() + 1> words{Named<MaybeQuality>{"", std::nullopt}};
    for (std::size_t i = 0; i < quality_words.size(); ++i)
        words[i + 1] = {quality_words[i].name, quality_words[i].value};
    return words;
}();

std::set<std::string> words_of(const std::string& list) {
    const std::vector<std::string> known{"ao",    "confidence", "error", "shaded", "unshaded", "light",  "indirect",
                                         "cloud", "panel",      "glb",   "mcap",   "texture",  "tiles3d"};
    std::set<std::string> words;
    std::istringstream stream(list);
    for (std::string word; std::getline(stream, word, ',');) {
        if (!std::ranges::count(known, word))
            throw Misuse(fmt::format("write: '{}' given, expected any of {}{}", word, fmt::join(known, ","),
                                     suggestion(word, known)));
        words.insert(word);
    }
    return words;
}

std::size_t page_points_from(const std::string& text) {
    std::size_t most = std::numeric_limits<std::uint32_t>::max(); // points are numbered with 32 bits
    if (text == "all")
        return most;
    const auto [end, trouble] = std::from_chars(text.data(), text.data() + text.size(), most);
    if (trouble != std::errc() || end != text.data() + text.size() || most < 1000)
        throw Misuse("page-points: '" + text + "' given, expected all or a number from 1000 on" +
                     suggestion(text, {"all"}));
    return most;
}

Outputs outputs_from(const RunSettings& asked) {
    Outputs wanted;
    wanted.format = asked.format;
    wanted.colour_format = asked.colour_format;
    wanted.shade = asked.shade;
    wanted.shade_strength = asked.shade_strength;
    wanted.colour_cloud = asked.colour_cloud;
    wanted.colour_view = asked.colour_view;
    wanted.texture = asked.texture;
    wanted.tiles_crs = asked.tiles_crs;
    if (!asked.tiles_crs.empty())
        try {
            (void)rasters::crs_of_code(asked.tiles_crs);
        } catch (const Error& wrong) {
            throw Misuse(fmt::format("tiles-crs: {}", wrong.what()));
        }
    wanted.frames_in_tar = static_cast<std::size_t>(asked.frames_in_tar);
    wanted.preview = asked.page && asked.frames_in_tar == 0;
    wanted.page_points = page_points_from(asked.page_points);
    if (asked.write != "auto") {
        const std::set<std::string> words = words_of(asked.write);
        wanted.ao = words.contains("ao");
        wanted.confidence = words.contains("confidence");
        wanted.error = words.contains("error");
        wanted.shaded = words.contains("shaded");
        wanted.unshaded = words.contains("unshaded");
        wanted.light = words.contains("light");
        wanted.indirect = words.contains("indirect");
        wanted.panel = words.contains("panel");
        wanted.glb = words.contains("glb");
        wanted.mcap = words.contains("mcap");
        wanted.tiles3d = words.contains("tiles3d");
        wanted.texture.wanted = words.contains("texture");
        wanted.cloud = wanted.depth_cloud = words.contains("cloud");
    }
    if (wanted.tiles3d && wanted.frames_in_tar > 0)
        throw Misuse("tar: --write tiles3d makes folders whose files name each other; leave one out");
    if (wanted.mcap && wanted.frames_in_tar > 0)
        throw Misuse("tar: --write mcap puts all frames into one file, which no tar can hold in parts; leave one out");
    return wanted;
}

ProjectOptions range_from(const std::string& text) {
    ProjectOptions limits;
    int used = 0;
    if (text.empty())
        return limits;
    if (std::sscanf(text.c_str(), "%lf,%lf%n", &limits.near_m, &limits.far_m, &used) != 2 ||
        used != static_cast<int>(text.size()) || !(limits.near_m >= 0 && limits.far_m > limits.near_m))
        throw Misuse("depth-range: '" + text + "' given, expected NEAR,FAR in metres, such as 0.4,5");
    return limits;
}

/// --cloud.rays and so on.
Stage prefixed(std::string title, const std::string& prefix, std::vector<Parameter> rows, std::string topic) {
    for (Parameter& row : rows)
        row.name = prefix + row.name;
    return {std::move(title), std::move(rows), std::move(topic)};
}

std::vector<std::string> method_names() {
    std::vector<std::string> names;
    for (const MethodRow& row : methods())
        names.emplace_back(row.name);
    return names;
}

/// "0.5", or where methods differ "low (luna), high (cacao, surfel)": what a setting is where it is not given.
std::string defaults_of(std::string_view setting) {
    std::vector<std::string> values;
    std::map<std::string, std::vector<std::string_view>> methods_by_value;
    for (const MethodRow& method : methods()) {
        const auto setup = method.setup();
        const std::vector<Parameter> rows = setup->parameters();
        if (const Parameter* row = row_named(rows, setting)) {
            const std::string value = value_text(*row);
            if (!methods_by_value.contains(value))
                values.push_back(value);
            methods_by_value[value].push_back(method.name);
        }
    }
    if (values.size() == 1)
        return values.front();
    std::string text;
    for (const std::string& value : values)
        text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", value, fmt::join(methods_by_value[value], ", "));
    return text;
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

std::vector<Stage> RunSettings::stages_in_use(MethodSetup& setup) {
    std::vector<Stage> all = common_stages();
    all.push_back(method_stage(method, setup));
    all.push_back(cloud_stage());
    all.push_back(sequence_stage());
    return all;
}

std::vector<Stage> RunSettings::common_stages() { // NOLINT(readability-function-size): a table
    RunSettings& s = *this;
    return {
        {"input",
         {{.name = "frames",
           .help = "which frames, by index: first:end:step without the end; negative numbers count from the end",
           .value = &s.frames,
           .common = true,
           .affects = Affects::as_used},
          {.name = "camera",
           .help = "a camera file, or fx,fy,cx,cy; replaces the capture's own",
           .value = &s.camera,
           .common = true,
           .affects = Affects::as_used},
          {.name = "colour",
           .help = "the colour image of a single depth image, whose pixels lie on the depth's",
           .value = &s.colour,
           .affects = Affects::as_used},
          {.name = "poses",
           .help = "a trajectory in TUM's format, as refine --trajectory writes it; replaces the capture's own poses",
           .value = &s.poses,
           .affects = Affects::as_used},
          {.name = "topic",
           .help = "the topic of depth images in a recording of ROS; empty = found by name and type",
           .value = &s.topic},
          {.name = "depth-scale",
           .help = "mm, tum, sun, nyu, m, or units per metre; replaces the capture's own",
           .value = &s.depth_scale,
           .common = true,
           .affects = Affects::as_used},
          {.name = "registered",
           .help = "whether colour pixels lie on depth pixels; auto = as the capture says",
           .value = OneOf(&s.registered, registered_words),
           .affects = Affects::as_used},
          {.name = "confidence-min",
           .help = "depth of a lower confidence is a hole, where phones recorded one: 0 low, 1 medium, 2 high",
           .value = &s.confidence_min,
           .low = 0,
           .high = 2},
          {.name = "copc",
           .help = "COPC keeps its octree, and one that is damaged is refused; no: COPC is read and written as LAZ is",
           .value = &s.copc},
          {.name = "association-limit",
           .help = "colour, depth and poses that are farther apart in time are not paired",
           .value = &s.association_limit_s,
           .unit = "s",
           .low = 0,
           .high = 1e6,
           .affects = Affects::as_used}}},
        {"depth preparation",
         {{.name = "depth-range",
           .help = "NEAR,FAR in metres; depth outside counts as a hole. Empty = all depth counts",
           .value = &s.depth_range,
           .common = true},
          {.name = "depth-noise",
           .help =
               "noise of the depth: auto (measured), none, kinect, tof, or FLOOR,PER_Z2[,CORRELATION]. Its sigma is "
               "FLOOR + PER_Z2 z^2 metres, its correlation length CORRELATION pixels. The next two act only on noisy "
               "depth",
           .value = &s.depth_noise,
           .affects = Affects::as_used},
          {.name = "flying-pixels",
           .help = "pixels where the sensor mixed two surfaces: drop makes them holes",
           .value = OneOf(&s.drop_flying, flying_words)},
          {.name = "depth-smoothing",
           .help = "scales the windows of the plane fits that give depth and normals; 0 = depth as recorded",
           .value = &s.depth_smoothing,
           .low = 0,
           .high = 10}}},
        {"method",
         {{.name = std::string(preset_flag),
           .help = "defaults for other flags: fast = cacao; balanced = surfel, downsampled; best = surfel, frames of a "
                   "recording together, 64 rays per point of a cloud",
           .value = OneOf(&s.preset, preset_words),
           .common = true,
           .affects = Affects::nothing},
          {.name = "method",
           .help = "the method that computes the visibility",
           .value = &s.method,
           .choices = method_names(),
           .common = true,
           .affects = Affects::as_used},
          {.name = "tiles",
           .help = "clouds of one folder: join = tiles of one survey, whose points near borders see those of the "
                   "neighbours; separate = each by itself; auto = joined where their boxes adjoin",
           .value = OneOf(&s.cloud_tiles, tile_words)},
          {.name = "clouds",
           .help = "points: rays from every point of a cloud; view: the cloud as one camera sees it; auto = points, "
                   "unless one depth camera took them or --camera is given; but for --cloud.radius, sky, outside and "
                   "normals",
           .value = OneOf(&s.clouds, cloud_words)},
          {.name = "sequence",
           .help = "on: frames of a recording with poses are computed together; auto: the same, and no warning where "
                   "there are none",
           .value = OneOf(&s.sequence, sequence_words),
           .common = true},
          {.name = "radius",
           .help = "surfaces farther away than this do not occlude; otherwise " + defaults_of("radius"),
           .value = &s.radius,
           .unit = "m",
           .low = 0,
           .common = true,
           .affects = Affects::as_used},
          {.name = "relative-radius",
           .help = "the radius in a capture whose unit is arbitrary (COLMAP): a share of the scene's median depth",
           .value = &s.relative_radius,
           .low = 1e-3,
           .high = 10},
          {.name = "quality",
           .help = "the method's quality level; otherwise " + defaults_of("quality"),
           .value = OneOf(&s.quality, maybe_quality_words),
           .common = true,
           .affects = Affects::as_used},
          {.name = "max-error",
           .help = "picks method and quality: the cheapest within this RMSE to truth; 0 = no limit",
           .value = &s.budget.max_error,
           .low = 0,
           .high = 1,
           .common = true,
           .affects = Affects::as_used},
          {.name = "max-ms",
           .help = "picks method and quality: the most accurate within this device time per frame; 0 = no limit",
           .value = &s.budget.max_ms,
           .unit = "ms",
           .low = 0,
           .high = 1e6,
           .common = true,
           .affects = Affects::as_used},
          {.name = std::string(settings_flag),
           .help = "a file of settings, such as an earlier run's manifest.json. Flags given here win",
           .value = &s.settings,
           .common = true,
           .affects = Affects::as_used},
          {.name = "device",
           .help =
               "index of a Vulkan device, or a part of its name; empty = the fastest kind; all = every GPU like the "
               "fastest",
           .value = &s.device,
           .common = true,
           .affects = Affects::nothing},
          {.name = "in-flight",
           .help = "frames computed at once on each device; 0 = 3 on a GPU, 1 on a processor",
           .value = &s.in_flight,
           .low = 0,
           .high = 64,
           .affects = Affects::nothing}}},
        {"output",
         {{.name = "out",
           .help = "folder of the results; several captures get a folder each in it",
           .value = &s.out,
           .common = true,
           .writes = Writes::folder,
           .affects = Affects::nothing},
          {.name = "write",
           .help =
               "any of ao,confidence,error,shaded,unshaded,light,indirect,cloud,panel,glb,mcap,texture,tiles3d; auto = "
               "ao,confidence,shaded, and cloud for clouds. error: the expected error of each value; confidence is "
               "1 - error / 0.3. unshaded: colour divided by visibility, where confidence allows it; light: ambient "
               "and direct, the parts of colour; indirect: colour that neighbours send; glb: each frame's points or "
               "mesh as binary glTF; mcap: run.mcap, all frames for Foxglove, Rerun and ROS; texture: images for the "
               "coordinates of meshes; tiles3d: a cloud's points for Cesium",
           .value = &s.write,
           .common = true,
           .affects = Affects::outputs},
          {.name = "texture-size",
           .help = "texels of a mesh's texture, across and down",
           .value = &s.texture.size,
           .low = 16,
           .high = 16384,
           .affects = Affects::outputs},
          {.name = "texture-margin",
           .help = "texels round the charts of a texture that continue their values; -1 = a 128th of the size",
           .value = &s.texture.margin,
           .low = -1,
           .high = 4096,
           .affects = Affects::outputs},
          {.name = "tiles-crs",
           .help = "coordinate system of a cloud for tiles3d, such as EPSG:25832, instead of the file's own",
           .value = &s.tiles_crs,
           .affects = Affects::outputs},
          {.name = "overwrite-occlusion",
           .help = "replaces occlusion textures that a glTF has",
           .value = &s.texture.replace,
           .affects = Affects::outputs},
          {.name = "format",
           .help = "file format of the ao maps and textures",
           .value = OneOf(&s.format, format_words),
           .common = true,
           .affects = Affects::outputs},
          {.name = "colour-format",
           .help =
               "file format of unshaded, ambient, direct and indirect: png8 and png16 hold sRGB, tiff and exr linear "
               "light as floats; auto = png16 where the colour image has 16 bits, else png8",
           .value = OneOf(&s.colour_format, colour_format_words),
           .affects = Affects::outputs},
          {.name = "view",
           .help = "camera whose pixels maps and pictures use, if a secondary camera took the colour images",
           .value = OneOf(&s.colour_view, view_words)},
          {.name = "shade",
           .help = "what visibility multiplies in pictures: multiply = all of the colour (clay where there is none); "
                   "ambient = its ambient light alone; clay = grey clay made from depth",
           .value = OneOf(&s.shade, shade_words),
           .affects = Affects::outputs},
          {.name = "light",
           .help =
               "direct light in the colours, for --shade ambient and --write light: auto, none = all light is ambient; "
               "X,Y,Z = towards it, as long as it is stronger than ambient light, in the recording's world where "
               "frames "
               "have poses, else in camera space (x right, y down, z forward)",
           .value = &s.light,
           .affects = Affects::outputs},
          {.name = "shade-strength",
           .help = "0 leaves the colour, 1 multiplies it by visibility",
           .value = &s.shade_strength,
           .low = 0,
           .high = 1,
           .affects = Affects::outputs},
          {.name = "cloud",
           .help = "a PLY file, or binary glTF if its name ends in .glb: one cloud of all frames with poses, points of "
                   "the same "
                   "place merged",
           .value = &s.recording_cloud,
           .common = true,
           .writes = Writes::file,
           .affects = Affects::outputs},
          {.name = "cloud-resolution",
           .help = "points of that cloud are merged within cubes of this side; 0 = one and a half times what a pixel "
                   "covers, or the spacing of a cloud's points",
           .value = &s.cloud_resolution_m,
           .unit = "m",
           .low = 0,
           .high = 100,
           .affects = Affects::outputs},
          {.name = "colour-cloud",
           .help = "shaded: replaces the clouds' colours by colour times visibility; grey: also gives clouds without "
                   "colours of their own visibility as grey",
           .value = OneOf(&s.colour_cloud, colour_words),
           .affects = Affects::outputs},
          {.name = "page",
           .help = "index.html, a page to look at the results in a browser, with a small preview of each frame",
           .value = &s.page,
           .common = true,
           .affects = Affects::outputs},
          {.name = "page-points",
           .help = "points of a cloud on the page, at most, or all; the page loads those that a view needs, and says "
                   "where the cloud has more",
           .value = &s.page_points,
           .affects = Affects::outputs},
          {.name = "tar",
           .help = "results of so many frames go into one tar, tars/000000.tar and on, as WebDataset reads them; 0 = "
                   "single files",
           .value = &s.frames_in_tar,
           .low = 0,
           .high = 1e6,
           .common = true,
           .affects = Affects::outputs},
          {.name = "overwrite",
           .help = "replaces the results of an earlier run",
           .value = &s.overwrite,
           .common = true,
           .affects = Affects::nothing},
          {.name = "resume",
           .help = "continues an earlier run; frames done from the same input and settings stay",
           .value = &s.resume,
           .common = true,
           .affects = Affects::nothing},
          {.name = "retry",
           .help = "with --resume: tries failed frames again, too",
           .value = &s.retry,
           .affects = Affects::nothing},
          {.name = "strict",
           .help = "doubtful results make the exit code 2, as failed frames do",
           .value = &s.strict,
           .affects = Affects::nothing},
          {.name = "quiet",
           .help = "prints only warnings and failures",
           .value = &s.quiet,
           .common = true,
           .affects = Affects::nothing},
          {.name = "log",
           .help = "what stderr gets: prose, or a JSON object per line",
           .value = OneOf(&s.log_json, log_words),
           .affects = Affects::nothing},
          {.name = "shard",
           .help = "of a job, the I-th of N parts: I/N; empty = as Slurm or Kubernetes number this task, else all",
           .value = &s.shard,
           .affects = Affects::nothing},
          {.name = "no-locks",
           .help = "of a job in a folder without working locks: runs this shard alone, takes over no other's tasks; no "
                   "shard may run twice at a time",
           .value = &s.no_locks,
           .affects = Affects::nothing},
          {.name = "scratch",
           .help = "of a job with hooks: folder on this machine for what is fetched and not yet delivered; empty = in "
                   "the system's temporary folder",
           .value = &s.scratch,
           .affects = Affects::nothing},
          {.name = "scratch-limit",
           .help = "space there, for all runs of the job on this machine; 0 = as planned",
           .value = &s.scratch_limit_gb,
           .unit = "GB",
           .low = 0,
           .high = 1e6,
           .affects = Affects::nothing},
          {.name = "dump",
           .help = "folder for the data between the method's passes: .npy files with an index.csv per frame",
           .value = &s.dump,
           .writes = Writes::folder,
           .affects = Affects::nothing}}}};
}

Stage RunSettings::cloud_stage() {
    return prefixed("clouds, from every point", "cloud.", clouds_by_points.parameters(), "clouds");
}

Stage RunSettings::sequence_stage() {
    return prefixed("sequences: with --sequence on, frames together with their neighbours", "sequence.",
                    sequences.parameters(), "sequence");
}

void RunSettings::take_preset() {
    const Configuration& of_preset = configuration_of(preset);
    method = of_preset.method;
    apply(of_preset, chosen_setup());
    if (preset == Preset::best) {
        sequence = SequenceUse::automatic;
        clouds_by_points.rays = 64; // RMSE 0.016 of a million points, 0.018 with the 16 that a processor casts
    }
}

void RunSettings::resolve() {
    outputs_ = outputs_from(*this);
    range_ = range_from(depth_range);
    if (depth_noise != "auto")
        (void)noise_from_text(depth_noise);
    (void)light_from_text(light);
    if (!recording_cloud.empty() && (resume || paths.size() > 1))
        throw Misuse("cloud: is made of all frames of one capture in one run, without --resume");
    if (budget.any() && (quality || preset != Preset::fast))
        throw Misuse("a budget (--max-error, --max-ms) picks method and quality: leave --quality and --preset out");
    if (!colour.empty() && paths.size() > 1)
        throw Misuse("colour: is the colour image of one depth image, and there are several captures");
    if (!depth_scale.empty())
        (void)depth_encoding(depth_scale, "--depth-scale");
    const CloudAoOptions usual; // what only rays can do is asked of rays
    if (clouds == CloudWalk::automatic &&
        (outputs_.texture.wanted || clouds_by_points.radius > 0 || clouds_by_points.sky ||
         clouds_by_points.outside != usual.outside || clouds_by_points.normals != usual.normals))
        clouds = CloudWalk::points;
    refuse_settings_of_others();
    cloud_options_ = clouds_by_points;
    if (cloud_options_.radius == 0 && radius)
        cloud_options_.radius = *radius;
    outputs_.texture.rays = cloud_options_.rays;
    outputs_.texture.seed = cloud_options_.seed;
    (void)CloudAo(cloud_options_);
    put_common_settings();
}

void RunSettings::refuse_settings_of_others() const {
    if (budget.any()) // picks the method later
        return;
    for (const auto& [name, setup] : setups_) {
        const auto usual = method_named(name).setup();
        if (configuration_of(preset).method == name)
            apply(configuration_of(preset), *usual);
        const std::vector<Parameter> defaults = usual->parameters();
        for (const Parameter& row : setup->parameters())
            if (name != method && value_text(row) != value_text(*row_named(defaults, row.name)))
                throw Misuse(fmt::format("{0}.{1}: is a setting of the method {0}, and the method is {2}", name,
                                         row.name, method));
    }
}

void RunSettings::put_common_settings() {
    const std::vector<Parameter> rows = chosen_setup().parameters();
    const auto row = [&](const char* name) -> const Parameter& {
        if (const Parameter* found = row_named(rows, name))
            return *found;
        throw Misuse(fmt::format("{}: the method {} has no such setting", name, method));
    };
    if (radius)
        set(row("radius"), *radius);
    if (quality)
        set(row("quality"), std::string(word_for(*quality, quality_words)));
}

void RunSettings::choose(const Configuration& picked) {
    if (before_choice_)
        apply(*before_choice_, chosen_setup());
    method = picked.method;
    put_common_settings();
    before_choice_ = {method, "as given", values_of(chosen_setup())};
    apply(picked, chosen_setup());
}

std::optional<Registration> RunSettings::registration() const {
    return registered == Registration::unknown ? std::nullopt : std::optional(registered);
}

FitPlaneOptions RunSettings::preparation() const { return {.drop_flying = drop_flying, .smoothing = depth_smoothing}; }

MethodSetup& RunSettings::setup_of(std::string_view name) const {
    return *std::ranges::find(setups_, name, [](const auto& each) { return each.first; })->second;
}

double RunSettings::radius_m() const {
    const std::vector<Parameter> rows = chosen_setup().parameters();
    return number_of(*row_named(rows, "radius"));
}

bool RunSettings::gives_radius() const {
    const auto usual = method_named(method).setup();
    const std::vector<Parameter> defaults = usual->parameters(), rows = chosen_setup().parameters();
    return radius || std::ranges::any_of(rows, [&](const Parameter& row) {
               return row.unit == "m" && value_text(row) != value_text(*row_named(defaults, row.name));
           });
}

std::unique_ptr<MethodSetup> RunSettings::setup_with(double radius_m) const {
    std::unique_ptr<MethodSetup> setup = method_named(method).setup();
    apply({method, "as given", values_of(chosen_setup())}, *setup);
    if (radius_m != this->radius_m()) {
        const std::vector<Parameter> rows = setup->parameters();
        set(*row_named(rows, "radius"), radius_m);
    }
    return setup;
}

std::vector<std::string> RunSettings::given_in_metres() {
    std::vector<std::string> given;
    RunSettings usual;
    usual.method = method;
    const std::vector<Stage> defaults = usual.stages_in_use();
    const auto is_default = [&](const Parameter& row) {
        return std::ranges::any_of(defaults, [&](const Stage& stage) {
            const Parameter* other = row_named(stage.rows, row.name);
            return other && value_text(*other) == value_text(row);
        });
    };
    for (const Stage& stage : stages_in_use())
        for (const Parameter& row : stage.rows)
            if (const bool follows = radius && row.name.ends_with(".radius"); // from --radius
                row.unit == "m" && !follows && !is_default(row))
                given.push_back(fmt::format("--{} {}", row.name, value_text(row)));
    if (!depth_range.empty())
        given.push_back("--depth-range " + depth_range);
    if (depth_noise != "auto" && depth_noise != "none")
        given.push_back("--depth-noise " + depth_noise);
    if (budget.max_error > 0)
        given.emplace_back("--max-error");
    if (budget.max_ms > 0)
        given.emplace_back("--max-ms");
    return given;
}

double RunSettings::median_depth() const {
    const double of_method = radius_m();
    return of_method > 0 ? of_method / relative_radius : usual_median_depth;
}

bool RunSettings::in_sequence(const Capture& capture) const {
    if (sequence == SequenceUse::on) // clouds taken as views say where they were seen from once they are loaded
        return has_poses(capture) || std::ranges::any_of(capture.entries, has_cloud);
    return sequence == SequenceUse::automatic && has_poses(capture);
}

bool RunSettings::asks_for_device(const Capture& capture) const {
    return !device.empty() || budget.any() || !recording_cloud.empty() || in_sequence(capture);
}

bool has_poses(const Capture& capture) {
    const auto posed = [](const CaptureEntry& entry) { return entry.world_from_camera && !has_cloud(entry); };
    return std::ranges::count_if(capture.entries, posed) > 1;
}

} // namespace scanshade
