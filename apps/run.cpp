// `scanshade run`: ambient occlusion for every frame of one or more captures.
#include "ao/fit_plane/fit_plane.h"
#include "ao/gpu/device.h"
#include "ao/method.h"
#include "apps/batch.h"
#include "apps/budget.h"
#include "apps/command.h"
#include "apps/job_run.h"
#include "apps/progress.h"
#include "apps/report.h"
#include "apps/resume.h"
#include "apps/settings_file.h"
#include "apps/slice.h"
#include "apps/trial.h"
#include "io/output_file.h"
#include "projection/error.h"
#include "projection/project.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/core/utility.hpp>
#include <set>
#include <sstream>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

// ---------------------------------------------------------------------------------------------------- interruption

std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch nothing else");

/// The first Ctrl-C ends the run after the frames in flight; the second one kills it, as always.
void end_gracefully_on_signals() {
    struct sigaction action = {};
    action.sa_handler = [](int) { interrupted = true; };
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
}

// ---------------------------------------------------------------------------------------------------- what is asked

struct RunSettings {
    std::vector<std::string> paths;
    std::string frames, camera, poses, depth_scale, registered = "auto";
    std::string depth_noise = "auto", depth_range, flying_pixels = "drop";
    double depth_smoothing = 1;
    double association_limit_s = 0.02;
    std::string sequence = "off", method = "cacao", radius, quality, device, settings, clouds = "auto";
    Budget budget;
    std::string out, write = "auto", format = "png16", view = "depth", dump;
    double shade_strength = 1;
    std::string recording_cloud;
    double cloud_resolution_m = 0;
    bool colour_cloud = false, overwrite = false, resume = false, retry = false;
    std::string shard, log = "text";
};

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

Outputs outputs_from(const RunSettings& settings) {
    Outputs outputs;
    outputs.format = ao_format(settings.format);
    outputs.shade_strength = settings.shade_strength;
    outputs.colour_cloud = settings.colour_cloud;
    outputs.colour_view = settings.view == "colour";
    if (settings.write != "auto") {
        const std::set<std::string> words = words_of(settings.write);
        outputs.ao = words.contains("ao");
        outputs.confidence = words.contains("confidence");
        outputs.shaded = words.contains("shaded");
        outputs.panel = words.contains("panel");
        outputs.cloud = outputs.depth_cloud = words.contains("cloud");
    }
    return outputs;
}

ProjectOptions depth_range_from(const std::string& text) {
    ProjectOptions range;
    int used = 0;
    if (text.empty())
        return range;
    if (std::sscanf(text.c_str(), "%lf,%lf%n", &range.near_m, &range.far_m, &used) != 2 ||
        used != static_cast<int>(text.size()) || !(range.near_m >= 0 && range.far_m > range.near_m))
        throw Misuse("depth-range: '" + text + "' given, expected NEAR,FAR in metres, such as 0.4,5");
    return range;
}

std::optional<Registration> registration_from(const std::string& text) {
    if (text == "auto")
        return std::nullopt;
    return text == "yes" ? Registration::yes : Registration::no;
}

// ---------------------------------------------------------------------------------------------------- jobs

/// One capture, the frames to take of it, and where its results go.
struct Job {
    Capture capture;
    BatchOptions batch;
    std::vector<std::size_t> of = {}; ///< all that is taken of the capture, of which batch.frames may be a block
    std::string block = {};           ///< "" = all, else as Task::block() says
};

/// "office" of captures/office/ and captures/office.pcd; "office-2" when another capture has that name.
std::string folder_name(const fs::path& path, std::set<std::string>& taken) {
    const fs::path whole = fs::weakly_canonical(path);
    const fs::path last = whole.has_filename() ? whole.filename() : whole.parent_path().filename();
    const std::string stem = fs::is_directory(path) ? last.string() : last.stem().string();
    std::string name = stem.empty() ? "capture" : stem;
    for (int n = 2; !taken.insert(name).second; ++n)
        name = fmt::format("{}-{}", stem, n);
    return name;
}

/// Nothing is begun when something would be lost: an earlier result is replaced only with --overwrite.
void refuse_to_overwrite(const Job& job) {
    const Outputs& outputs = job.batch.outputs;
    std::vector<fs::path> files = {outputs.folder / "manifest.json", outputs.folder / "frames.csv",
                                   journal_file(outputs.folder, "")};
    for (const std::size_t index : job.batch.frames)
        std::ranges::copy(files_of(job.capture.entries[index], outputs), std::back_inserter(files));
    const auto there = std::ranges::find_if(files, [](const fs::path& file) { return fs::exists(file); });
    if (there != files.end())
        throw Misuse(there->string() + " exists already: --resume goes on with an earlier run, --overwrite replaces its "
                                       "results, or choose another -o");
}

/// Clears what a killed run left, and the report of an earlier one: a manifest says that what lies beside it is
/// complete. The journal is held.
void prepare_folder(const Job& job, const std::vector<fs::path>& reports) {
    const fs::path& folder = job.batch.outputs.folder;
    std::set<std::string, std::less<>> stems;
    for (const std::size_t index : job.batch.frames)
        stems.insert(job.capture.entries[index].name);
    for (const fs::path& report : reports) {
        stems.insert(report.stem().string());
        fs::remove(folder / report);
    }
    for (const char* part : {"", "ao", "confidence", "shaded", "panel", "clouds"})
        remove_leftovers(folder / part, [&](std::string_view stem) { return stems.contains(stem); });
}

/// "frames.csv", or "frames.0-500.csv" of a block.
std::string report_name(const std::string& stem, const std::string& block, const char* extension) {
    return block.empty() ? stem + extension : stem + "." + block + extension;
}

// ---------------------------------------------------------------------------------------------------- what is said

/// What the shaded pictures of this capture show, and how to have it otherwise.
std::string shading_sentence(const Capture& capture, Registration registration) {
    const bool clouds = std::ranges::all_of(capture.entries, [](const auto& entry) { return !entry.cloud.empty(); });
    const bool colour = std::ranges::any_of(capture.entries, [](const auto& entry) { return !entry.colour.empty(); });
    if (clouds)
        return "shaded pictures show the points' own colours, or grey clay where they have none.";
    if (!colour)
        return "shaded pictures show grey clay made from depth: the capture has no colour images.";
    if (registration == Registration::yes)
        return "shaded pictures show the colour images.";
    if (capture.colour_camera)
        return "shaded pictures show the colour images, carried over from the camera that took them (" +
               describe(capture.colour_camera->camera) + "); what it did not see is grey clay.";
    const std::string why = registration == Registration::no ? "do not lie on" : "are not known to lie on";
    return fmt::format(
        "shaded pictures show grey clay made from depth, because the colour images {} the depth pixels{}; "
        "--registered yes shades the colour images anyway.",
        why, capture.registration_reason.empty() ? "" : " (" + capture.registration_reason + ")");
}

void introduce(const RunReport& report) {
    const Capture& capture = report.capture;
    say(fmt::format("{}: {}, {} of {} frames", capture.path.string(), capture.kind, report.frames.size(),
                    capture.entries.size()));
    if (!capture.depth.origin.empty())
        say(fmt::format("  depth: {} ({})", capture.depth.name, capture.depth.origin));
    if (capture.camera)
        say(fmt::format("  camera: {} ({})", describe(*capture.camera), capture.camera->origin));
    if (capture.depth_correction.any())
        say(fmt::format("  depth correction: {} ({})", describe(capture.depth_correction), capture.camera->origin));
    say("  depth noise: " + report.depth_noise);
    for (const std::string& warning : capture.warnings)
        say("  warning: " + warning);
    for (const std::string& sentence : report.budget)
        say("  " + sentence);
    say("  " + report.shading);
}

/// The first ten by name, the rest by number.
std::string names_of_failed(const std::vector<FrameRow>& rows) {
    std::vector<std::string> names;
    for (const FrameRow& row : rows)
        if (row.status == FrameStatus::failed)
            names.push_back(row.name);
    constexpr std::size_t most = 10;
    const std::string more = names.size() > most ? fmt::format(" and {} more", names.size() - most) : "";
    names.resize(std::min(names.size(), most));
    return fmt::format("{}{}", fmt::join(names, ", "), more);
}

void conclude(const RunReport& report, const fs::path& table) {
    const std::size_t ok = count(report.frames, FrameStatus::ok);
    const std::string before = ok > report.done_now ? fmt::format(", {} of them before", ok - report.done_now) : "";
    say(fmt::format("  {} of {} frames{} in {:.1f} s ({}) -> {}", ok, report.frames.size(), before,
                    report.took_ms / 1000, describe(rates_of(report)), table.parent_path().string()));
    if (count(report.frames, FrameStatus::failed) > 0)
        say(fmt::format("  failed: {} ({} says why)", names_of_failed(report.frames), table.string()));
    if (const std::size_t skipped = count(report.frames, FrameStatus::skipped); skipped > 0)
        say(fmt::format("  not finished: {} frames are left; --resume goes on with them", skipped));
}

// ---------------------------------------------------------------------------------------------------- the command

class Run final : public Command {
  public:
    Run() {
        for (const MethodRow& row : methods())
            setups_.emplace_back(row.name, row.setup());
    }

    Words words() override { return {"PATH", "captures: folders, depth images or clouds", &asked_.paths, 1, 1 << 20}; }

    std::vector<Stage> stages() override {
        std::vector<Stage> all = common_stages();
        for (const auto& [name, setup] : setups_)
            all.push_back(method_stage(name, *setup));
        all.push_back(cloud_stage());
        all.push_back(sequence_stage());
        return all;
    }

    int run() override {
        if (asked_.log == "json")
            log_as_json();
        if (std::ranges::any_of(asked_.paths, is_job))
            return run_planned();
        check_settings();
        if (!asked_.budget.any())
            (void)chosen_setup(); // refuses before anything is opened
        int unopened = 0;
        std::vector<Job> jobs = plan(unopened);
        for (const Job& job : jobs)
            if (!asked_.overwrite && !asked_.resume)
                refuse_to_overwrite(job);
        if (jobs.empty())
            return nothing_done;

        cv::setNumThreads(1); // frames are the parallelism; threads inside a frame would only compete with them
        end_gracefully_on_signals();
        std::vector<FrameRow> rows;
        for (const Job& job : jobs)
            if (!interrupted)
                std::ranges::move(process(job), std::back_inserter(rows));
        return exit_code(rows, unopened);
    }

  private:
    std::vector<Stage> common_stages() {
        RunSettings& s = asked_;
        const auto [radius, quality] = method_defaults();
        return {
            {"input",
             {{"frames", "which frames, by index: first:end:step, end not included; negative counts from the end",
               &s.frames},
              {"camera", "a camera file, or fx,fy,cx,cy; replaces the capture's own", &s.camera},
              {"poses", "a trajectory in TUM's rows, as refine --trajectory writes it; replaces the capture's own poses", &s.poses},
              {"depth-scale", "mm, tum, sun, nyu, m, or units per metre; replaces the capture's own", &s.depth_scale},
              {.name = "registered",
               .help = "whether colour pixels lie on depth pixels",
               .value = &s.registered,
               .choices = {"auto", "yes", "no"}},
              {"association-limit", "colour, depth and poses farther apart in time are not paired",
               &s.association_limit_s, "s", 0, 1e6}}},
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
               .help = "on: frames of a recording with poses are looked at together with those around them (sequences, below)",
               .value = &s.sequence,
               .choices = {"off", "on"}},
              {"radius", "how far away a surface may still occlude, in metres" + radius, &s.radius},
              {"quality", "the method's quality level" + quality, &s.quality},
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
              {"device", "index or part of the name of a Vulkan device; empty = the fastest kind", &s.device}}},
            {"output",
             {{"out", "folder of the results; several captures get a folder each in it", &s.out},
              {"write", "any of ao,confidence,shaded,cloud,panel; auto = ao,confidence,shaded, and cloud for clouds", &s.write},
              {.name = "format",
               .help = "of the ao maps",
               .value = &s.format,
               .choices = {"png16", "png8", "tiff", "exr"}},
              {.name = "view",
               .help = "whose pixels maps and pictures have, where a colour camera stands beside the depth camera",
               .value = &s.view,
               .choices = {"depth", "colour"}},
              {"shade-strength", "0 leaves the colour, 1 multiplies it by visibility", &s.shade_strength, "", 0, 1},
              {"cloud", "a PLY file: one cloud of all frames with poses, points of the same place merged", &s.recording_cloud},
              {"cloud-resolution", "within cubes of this side; 0 = one and a half times what a pixel covers", &s.cloud_resolution_m, "m", 0, 100},
              {"colour-cloud", "replace the clouds' colour by colour times visibility", &s.colour_cloud},
              {"overwrite", "replace the results of an earlier run", &s.overwrite},
              {"resume", "go on with an earlier run: what is done, from the same input and settings, stays", &s.resume},
              {"retry", "with --resume: frames that failed are tried again, too", &s.retry},
              {.name = "log",
               .help = "what stderr gets: prose, or a JSON object per line",
               .value = &s.log,
               .choices = {"text", "json"}},
              {"shard", "of a job, the I-th of N parts: I/N; empty = as Slurm or Kubernetes number this one, else all", &s.shard},
              {"dump", "folder for what lies between the method's passes, as .npy files with an index.csv per frame", &s.dump}}}};
    }

    /// --cloud.rays and so on.
    Stage cloud_stage() {
        Stage stage{"clouds, from every point", cloud_options_.parameters()};
        for (Parameter& row : stage.rows)
            row.name = "cloud." + row.name;
        return stage;
    }

    /// --sequence.layers and so on.
    Stage sequence_stage() {
        Stage stage{"sequences: with --sequence on, frames together with those around them", sequence_options_.parameters()};
        for (Parameter& row : stage.rows)
            row.name = "sequence." + row.name;
        return stage;
    }

    /// As given; --radius holds for clouds, too, and --cloud.radius before it.
    CloudAo cloud_ao() const {
        CloudAoOptions options = cloud_options_;
        if (options.radius == 0 && !asked_.radius.empty())
            set({"radius", "", &options.radius}, asked_.radius);
        return CloudAo(options);
    }

    static std::vector<std::string> method_names() {
        std::vector<std::string> names;
        for (const MethodRow& row : methods())
            names.emplace_back(row.name);
        return names;
    }

    /// What --radius and --quality are when not given, as their help says it.
    std::pair<std::string, std::string> method_defaults() {
        std::string radius, quality;
        for (const auto& [name, setup] : setups_) {
            const std::vector<Parameter> rows = setup->parameters();
            if (const Parameter* row = row_named(rows, "radius"))
                radius += fmt::format("; {}: {} by default", name, value_text(*row));
            if (const Parameter* row = row_named(rows, "quality"))
                quality += fmt::format("; {}: {}, {} by default", name, range_text(*row), value_text(*row));
        }
        return {radius, quality};
    }

    void check_settings() {
        if (asked_.out.empty())
            throw Misuse("run needs -o FOLDER for its results");
        outputs_ = outputs_from(asked_);
        if (asked_.depth_noise != "auto")
            (void)noise_from_text(asked_.depth_noise);
        range_ = depth_range_from(asked_.depth_range);
        if (!asked_.recording_cloud.empty() && (asked_.resume || asked_.paths.size() > 1))
            throw Misuse("cloud: is made of all frames of one capture in one run, without --resume");
        if (asked_.budget.any() && !asked_.quality.empty())
            throw Misuse("a budget (--max-error, --max-ms) picks the quality: leave --quality out");
        if (!asked_.depth_scale.empty())
            (void)depth_encoding(asked_.depth_scale, "--depth-scale");
        (void)cloud_ao();
    }

    /// The chosen method's settings, --radius and --quality put in their rows.
    MethodSetup& chosen_setup() {
        MethodSetup& setup = *std::ranges::find(setups_, asked_.method, [](const auto& s) { return s.first; })->second;
        const std::vector<Parameter> rows = setup.parameters();
        for (const auto& [name, text] : {std::pair("radius", asked_.radius), std::pair("quality", asked_.quality)}) {
            if (text.empty())
                continue;
            const Parameter* row = row_named(rows, name);
            if (!row)
                throw Misuse(fmt::format("{}: the method {} has no such setting", name, asked_.method));
            set(*row, text);
        }
        return setup;
    }

    Job job_from(const fs::path& path, const fs::path& folder) const {
        Job job{open_capture(path, {asked_.camera, asked_.depth_scale, asked_.association_limit_s, asked_.poses}), {}};
        refuse_absent_view(job.capture);
        job.batch.frames = job.of = slice(asked_.frames, job.capture.entries.size());
        job.batch.outputs = outputs_;
        job.batch.outputs.folder = folder;
        if (!asked_.dump.empty())
            job.batch.dump = fs::path(asked_.dump) / folder.lexically_relative(asked_.out);
        job.batch.registration = registration_from(asked_.registered);
        job.batch.range = range_;
        job.batch.stop = &interrupted;
        return job;
    }

    /// Opens what is to be processed. A capture that cannot be opened is told and counted; it stops no other.
    std::vector<Job> plan(int& unopened) {
        std::vector<Job> jobs;
        std::set<std::string> taken;
        for (const std::string& path : asked_.paths) {
            const fs::path folder =
                asked_.paths.size() == 1 ? fs::path(asked_.out) : asked_.out / fs::path(folder_name(path, taken));
            try {
                jobs.push_back(job_from(path, folder));
            } catch (const Misuse&) {
                throw;
            } catch (const std::exception& failure) {
                say(fmt::format("failed: {}", failure.what()));
                ++unopened;
            }
        }
        return jobs;
    }

    void refuse_absent_view(const Capture& capture) const {
        if (outputs_.colour_view && !capture.colour_camera)
            throw Error(capture.path.string() +
                        ": --view colour needs to know the colour camera beside the depth camera; refine finds it");
    }

    RunReport report_on(const Job& job, const gpu::DeviceInfo& device) {
        const auto& said = job.batch.registration;
        const Registration registration = said.value_or(job.capture.registration);
        RunReport report{.started = std::chrono::system_clock::now(),
                         .device = device,
                         .method = asked_.method,
                         .settings = common_stages(),
                         .capture = job.capture,
                         .registration = registration,
                         .registration_reason = said ? "--registered" : job.capture.registration_reason,
                         .depth_noise = {},
                         .budget = {},
                         .shading = shading_sentence(job.capture, registration),
                         .frames = {}};
        for (const auto& [name, setup] : setups_)
            if (name == asked_.method)
                report.settings.push_back(method_stage(name, *setup));
        report.settings.push_back(cloud_stage());
        report.settings.push_back(sequence_stage());
        return report;
    }

    /// Picks method and settings for the capture, from where the command line left them. Says what it did.
    std::vector<std::string> keep_to_budget(const Job& job, gpu::Device& device) {
        const TrialRequest request{.depth_noise = asked_.depth_noise,
                                   .capture = {asked_.camera, asked_.depth_scale, asked_.association_limit_s},
                                   .among = job.of,
                                   .leave_bad_out = true,
                                   .preparation = {.drop_flying = asked_.flying_pixels == "drop",
                                                   .smoothing = asked_.depth_smoothing}};
        const TrialCapture trial = load_trial(job.capture.path, request);
        const double radius_m = asked_.radius.empty() ? request.radius_m : std::stod(asked_.radius);
        const Choice choice = choose(device, shipped_front(), trial, radius_m, asked_.budget);
        if (!before_budget_.settings.empty())
            apply(before_budget_, chosen_setup());
        asked_.method = choice.configuration.method;
        MethodSetup& setup = chosen_setup();
        before_budget_ = {asked_.method, "as given", values_of(setup)};
        apply(choice.configuration, setup);
        return choice.sentences;
    }

    /// A job made by `plan`: in worker processes, task by task.
    int run_planned() {
        if (asked_.paths.size() != 1 || !asked_.out.empty() || asked_.overwrite)
            throw Misuse("run JOB goes on with that job, in its own folder: neither other captures, nor -o, nor --overwrite");
        const fs::path job = asked_.paths.front();
        const Plan plan = read_plan(job);
        const Shard shard = shard_from(asked_.shard);
        for (const Stage& stage : stages())
            for (const auto& [name, value] : plan.settings)
                if (const Parameter* row = row_named(stage.rows, name))
                    set(*row, value);
        asked_.out = (job / "results").string();
        asked_.resume = true;
        check_settings();
        (void)chosen_setup();
        return supervise(1, [&](const Shift& shift) {
            cv::setNumThreads(1);
            end_gracefully_on_signals();
            return work_through(job, plan, shard, interrupted,
                                [&](const Task& task) { return exit_code(process(job_of(job, task), shift), 0); });
        });
    }

    Job job_of(const fs::path& folder, const Task& task) {
        // The plan opened it: whatever is in the way now may be gone the next time.
        if (std::error_code ignored; !fs::exists(task.capture, ignored))
            throw Outage(task.capture.string() + ": not there any more");
        Job job = job_from(task.capture, results_of(folder, task));
        if (job.of.size() != task.of)
            throw Error(fmt::format("{}: planned with {} frames, has {} now: plan anew", task.capture.string(), task.of,
                                    job.of.size()));
        job.block = task.block();
        job.batch.frames = {job.of.begin() + static_cast<std::ptrdiff_t>(task.first),
                            job.of.begin() + static_cast<std::ptrdiff_t>(task.first + task.frames)};
        return job;
    }

    /// Opened when the first frame needs it: where all is done already, never.
    gpu::Device& device() {
        if (!device_)
            device_ = std::make_unique<gpu::Device>(asked_.device);
        return *device_;
    }

    /// Kept from capture to capture while its settings stay: its shaders are compiled once.
    Method& method_as_set(gpu::Device& device) {
        MethodSetup& setup = chosen_setup();
        const Configuration wanted{asked_.method, "", values_of(setup)};
        if (!method_ || wanted.method != made_.method || wanted.settings != made_.settings) {
            method_ = setup.make(device);
            made_ = wanted;
        }
        return *method_;
    }

    std::vector<FrameRow> process(Job job, const Shift& shift = {}) {
        const fs::path& folder = job.batch.outputs.folder;
        Journal journal(folder, job.block);
        if (asked_.overwrite)
            journal.clear();
        std::vector<Stage> all_settings = common_stages();
        all_settings.push_back(method_stage(asked_.method, chosen_setup()));
        all_settings.push_back(cloud_stage());
        all_settings.push_back(sequence_stage());
        const std::string task = task_key(all_settings, job.capture, job.of, asked_.sequence == "on");
        const fs::path table = report_name("frames", job.block, ".csv"), manifest = report_name("manifest", job.block, ".json");
        if (auto rows = rows_if_complete(journal, task, job.capture, job.batch.frames, asked_.retry);
            rows && fs::exists(folder / manifest)) {
            say(fmt::format("{}: done already, {} frames -> {}", job.capture.path.string(), rows->size(), folder.string()));
            return *std::move(rows);
        }
        gpu::Device& device = this->device();
        const std::vector<std::string> budget =
            asked_.budget.any() ? keep_to_budget(job, device) : std::vector<std::string>{};
        Method& plain = method_as_set(device);
        job.batch.point_method = dynamic_cast<PointMethod*>(&plain);
        job.batch.radius_m = std::stod(value_text(*row_named(chosen_setup().parameters(), "radius")));
        const CloudAo of_clouds = cloud_ao();
        job.batch.cloud_ao = &of_clouds;
        job.batch.cloud_walk = asked_.clouds == "points" ? CloudWalk::points
                               : asked_.clouds == "view" ? CloudWalk::view
                                                         : CloudWalk::automatic;
        say(fmt::format("{} on {} ({})", asked_.method, device.info().name, device.info().driver));
        const DepthNoise noise = noise_of(job.capture, job.of, asked_.depth_noise);
        const FitPlaneOptions fit{.drop_flying = asked_.flying_pixels == "drop",
                                  .smoothing = asked_.depth_smoothing * method_named(asked_.method).smoothing};
        std::optional<OnFittedDepth> fitted;
        if (noise.any())
            fitted.emplace(device, noise, plain, fit);
        std::optional<Neighbourhood> sequence;
        std::optional<RecordingCloud> cloud;
        if (!asked_.recording_cloud.empty()) {
            cloud.emplace(asked_.cloud_resolution_m);
            job.batch.cloud = &*cloud;
        }
        if (asked_.sequence == "on" || cloud) {
            sequence.emplace(device, plain, job.batch.radius_m, noise, fit, asked_.sequence == "on" ? sequence_options_ : alone());
            job.batch.sequence = &*sequence;
        }
        Method& method = fitted ? static_cast<Method&>(*fitted) : plain;
        job.batch.noise = noise;
        RunReport report = report_on(job, device.info());
        report.depth_noise = noise_sentence(noise);
        report.budget = budget;
        report.frames.resize(job.batch.frames.size());
        introduce(report);
        prepare_folder(job, {table, manifest});
        const Recording recording{.journal = journal,
                                  .settings = settings_key(report, job.batch.outputs, noise),
                                  .task = task,
                                  .device = device.info().name,
                                  .retry = asked_.retry,
                                  .carefully = shift.carefully,
                                  .finished = shift.finished};
        Progress progress(job.batch.frames.size());
        const auto start = std::chrono::steady_clock::now();
        report.frames = run_recorded(job.capture, method, job.batch, recording, [&](const FrameRow& row) {
            progress.add(row);
            report.done_now += row.status == FrameStatus::ok;
            report.ms_now = report.ms_now + row.ms;
        });
        report.took_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
        progress.end();
        write_frames_csv(folder / table, report.frames);
        write_manifest(folder / manifest, report);
        conclude(report, folder / table);
        if (cloud && !interrupted)
            write_recording(*cloud);
        return report.frames;
    }

    void write_recording(const RecordingCloud& cloud) const {
        if (cloud.points() == 0) {
            say("  no frame had a pose: " + asked_.recording_cloud + " is not written");
            return;
        }
        cloud.write(asked_.recording_cloud);
        say(fmt::format("  {} points, merged within {:.4f} m -> {}", cloud.points(), cloud.resolution_m(), asked_.recording_cloud));
    }

    /// What is known of the depth's noise, and what is done about it.
    std::string noise_sentence(const DepthNoise& noise) const {
        const std::string origin = asked_.depth_noise == "auto" ? "measured" : "--depth-noise";
        if (!noise.any())
            return fmt::format("{} to mind ({}); depth is used as recorded", describe(noise), origin);
        return fmt::format("{} ({}); flying pixels are {}; {}", describe(noise), origin,
                           asked_.flying_pixels == "drop" ? "dropped" : "kept",
                           asked_.depth_smoothing > 0 ? "depth and normals come from plane fits" : "depth is used as recorded");
    }

    static int exit_code(const std::vector<FrameRow>& rows, int unopened) {
        const auto any = [&](Fault fault) { return std::ranges::count(rows, fault, &FrameRow::fault) > 0; };
        const std::size_t ok = count(rows, FrameStatus::ok);
        if (interrupted || any(Fault::outage))
            return unfinished;
        if (any(Fault::internal) || any(Fault::crash))
            return internal_error;
        if (ok == rows.size() && unopened == 0)
            return all_well;
        return ok == 0 ? nothing_done : some_failed;
    }

    RunSettings asked_;
    Outputs outputs_;
    ProjectOptions range_;
    CloudAoOptions cloud_options_;
    NeighbourhoodOptions sequence_options_;
    std::unique_ptr<gpu::Device> device_; ///< outlives what was made on it
    std::unique_ptr<Method> method_;
    Configuration made_; ///< what method_ was made from
    Configuration before_budget_; ///< of the method that a budget picked for the capture before this one
    std::vector<std::pair<std::string, std::unique_ptr<MethodSetup>>> setups_;
};

} // namespace

std::unique_ptr<Command> run_command() { return std::make_unique<Run>(); }

} // namespace scanshade
