// `scanshade bench`: methods x settings on captures with a reference, milliseconds against error, as one page.
#include "ao/gpu/device.h"
#include "apps/budget/bench_results.h"
#include "apps/budget/configurations.h"
#include "apps/budget/fused_reference.h"
#include "apps/command.h"
#include "apps/command_line.h"
#include "apps/picture.h"
#include "apps/scenes/generate.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/sensor.h"
#include "apps/walk/progress.h"
#include "io/images/jpeg_output.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <tbb/parallel_for.h>
#include <tbb/parallel_for_each.h>
#include <thread>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

/// The comma-separated words, each one of `known`; all of them for "all".
std::vector<std::string> chosen(const std::string& flag, const std::string& list,
                                const std::vector<std::string>& known) {
    if (list == "all")
        return known;
    std::vector<std::string> words;
    std::istringstream stream(list);
    for (std::string word; std::getline(stream, word, ',');) {
        if (std::ranges::find(known, word) == known.end())
            throw Misuse(fmt::format("{}: '{}' given, expected all or any of {}", flag, word, fmt::join(known, ",")));
        words.push_back(word);
    }
    if (words.empty())
        throw Misuse(fmt::format("{}: nothing given, expected all or any of {}", flag, fmt::join(known, ",")));
    return words;
}

template <class Table>
std::vector<std::string> names_of(const Table& table) {
    std::vector<std::string> names;
    for (const auto& row : table)
        names.emplace_back(row.name);
    return names;
}

std::string settings_text(const std::vector<Parameter>& rows) {
    std::string text;
    for (const Parameter& row : rows)
        text += fmt::format("{}{}={}", text.empty() ? "" : " ", row.name, value_text(row));
    return text;
}

// ---------------------------------------------------------------------------------------------------- one capture

/// Trials are kept from capture to capture, by configuration and radius.
class Trials {
  public:
    explicit Trials(gpu::Device& device) : device_(device) {}

    /// The configuration's trial, ready for the capture. Throws where it cannot be made.
    Trial& of(const Configuration& configuration, const TrialCapture& capture) {
        auto& trial = made_[{configuration.full_name(), capture.radius_m}];
        if (!trial)
            trial = std::make_unique<Trial>(device_, configuration, capture.noise, capture.radius_m);
        trial->set_noise(capture.noise);
        return *trial;
    }

  private:
    gpu::Device& device_;
    std::map<std::pair<std::string, double>, std::unique_ptr<Trial>> made_;
};

/// All configurations on one capture. Errors are computed once, since the same input gives the same bytes. Times are
/// taken in rounds.
class CaptureBench {
  public:
    CaptureBench(Trials& trials, const TrialCapture& capture, const std::vector<Configuration>& all)
        : capture_(capture) {
        result_ = {capture.name,
                   capture.path.string(),
                   capture.reference,
                   describe(capture.noise),
                   capture.sensor,
                   capture.radius_m,
                   {},
                   capture.frames.front().depth.z_m.size(),
                   {},
                   capture.frames.front().truth,
                   {},
                   {}};
        for (const TrialFrame& frame : capture.frames) {
            result_.frames.push_back(frame.name);
            const Pinhole& camera = frame.frame.camera.pinhole;
            const cv::Mat1f& recorded = frame.frame.depth_m.empty() ? frame.depth.z_m : frame.frame.depth_m;
            classes_.push_back({by_place(frame.exact_z_m, recorded, frame.truth, camera),
                                by_edge_distance(frame.exact_z_m), by_grazing_angle(frame.exact_z_m, camera),
                                by_range(frame.exact_z_m)});
        }
        for (const Configuration& configuration : all)
            begin(trials, configuration);
    }

    BenchCapture run(int rounds) {
        std::vector<std::vector<cv::Mat1f>> maps(trials_.size());
        for (std::size_t i = 0; i < trials_.size(); ++i)
            attempt(i, [&] {
                for (const TrialFrame& frame : capture_.frames)
                    maps[i].push_back(trials_[i]->compute(frame));
            });
        // Finding the best tone curve of a map takes longer than the map.
        tbb::parallel_for(std::size_t{0}, trials_.size(),
                          [&](std::size_t i) { attempt(i, [&] { judge(i, maps[i]); }); });
        for (int round = 0; round < rounds; ++round) {
            say(fmt::format("  {}: round {} of {}", capture_.name, round + 1, rounds));
            for (const TrialFrame& frame : capture_.frames)
                for (std::size_t k = 0; k < trials_.size(); ++k) {
                    const std::size_t i = (k + static_cast<std::size_t>(round)) % trials_.size();
                    attempt(i, [&] { time(i, frame); });
                }
        }
        tbb::parallel_for_each(result_.measured, [](Measured& measured) { measured.sum_up(); });
        return std::move(result_);
    }

  private:
    void begin(Trials& trials, const Configuration& configuration) {
        const std::size_t i = trials_.size();
        trials_.emplace_back();
        result_.measured.emplace_back();
        result_.measured.back().configuration = configuration;
        result_.visibilities.emplace_back();
        attempt(i, [&] {
            trials_[i] = &trials.of(configuration, capture_);
            result_.measured[i].settings = settings_text(trials_[i]->settings());
        });
    }

    /// A configuration that fails is left out for this capture, and the report says why.
    template <class Step>
    void attempt(std::size_t i, Step&& step) {
        Measured& measured = result_.measured[i];
        if (!measured.why.empty())
            return;
        try {
            step();
        } catch (const Error& failure) {
            measured.why = failure.what();
            say(fmt::format("  {}: {} failed: {}", capture_.name, measured.configuration.full_name(), failure.what()));
        }
    }

    void judge(std::size_t i, const std::vector<cv::Mat1f>& maps) {
        Measured& measured = result_.measured[i];
        PlacePairs& places = measured.places.emplace_back();
        for (std::size_t n = 0; n < capture_.frames.size(); ++n) {
            const TrialFrame& frame = capture_.frames[n];
            const cv::Mat1f& map = maps[n];
            const cv::Mat1b& place_of = classes_[n][place].of;
            for (std::size_t p = 0; p < place_count; ++p) {
                cv::Mat1f truth_there(frame.truth.size(), std::numeric_limits<float>::quiet_NaN());
                frame.truth.copyTo(truth_there, place_of == static_cast<int>(p));
                places[p].add(pair_sums(map, truth_there));
            }
            measured.images.push_back(compare(map, frame.truth));
            measured.pairs.add(pair_sums(map, frame.truth));
            for (std::size_t by = 0; by < error_by_count; ++by)
                measured.errors[by].add(map, frame.truth, classes_[n][by]);
            if (n == 0)
                result_.visibilities[i] = map;
        }
        say(fmt::format("  {}: {:<34} RMSE {:.4f}", capture_.name, measured.configuration.full_name(),
                        total(measured.images, {}).rms));
    }

    void time(std::size_t i, const TrialFrame& frame) {
        (void)trials_[i]->compute(frame);
        Measured& measured = result_.measured[i];
        measured.device_ms.push_back(trials_[i]->device_ms());
        measured.wall_ms.push_back(trials_[i]->wall_ms());
        measured.ns_per_pixel.push_back(trials_[i]->device_ms() * 1e6 / static_cast<double>(frame.depth.z_m.total()));
    }

    const TrialCapture& capture_;
    std::vector<std::array<PixelClasses, error_by_count>> classes_;
    std::vector<Trial*> trials_; ///< null where none could be made
    BenchCapture result_;
};

// ---------------------------------------------------------------------------------------------------- the command

class Bench final : public Command {
  public:
    Words words() override {
        return {"CAPTURE",
                "captures with truth/ao, as generate makes them, or with poses: then rays against all frames fused",
                &paths_, 0, 1 << 20};
    }

    std::vector<Stage> stages() override {
        std::vector<Stage> all{
            {"captures",
             {{.name = "generated",
               .help = "generates captures of the scenes first, in REPORT/captures",
               .value = &generated_},
              {.name = "scenes", .help = "which scenes: all, or names with commas", .value = &scenes_},
              {.name = "sensor",
               .help = "which simulated sensors record them: all, or names with commas",
               .value = &sensors_},
              {.name = "size", .help = "their image size, width x height", .value = &generate_.size, .unit = "pixels"},
              {.name = "first",
               .help = "index of their first frame, in tenths of a second",
               .value = &generate_.first,
               .low = 0,
               .high = 100000},
              {.name = "step",
               .help = "from one frame to the next, in tenths of a second",
               .value = &generate_.step,
               .low = 1,
               .high = 100000},
              {.name = "truth-rays",
               .help = "rays per pixel of their truth",
               .value = &generate_.truth_rays,
               .low = 1,
               .high = 65536},
              {.name = "frames",
               .help = "frames taken of each capture, spread evenly",
               .value = &request_.frames,
               .low = 1,
               .high = 100000},
              {.name = "radius",
               .help = "what is farther does not occlude, where truth does not say",
               .value = &request_.radius_m,
               .unit = "m",
               .low = 1e-4,
               .high = 1e5},
              {.name = "depth-noise",
               .help = "as run takes it: auto (measured), none, kinect, tof or FLOOR,PER_Z2",
               .value = &request_.depth_noise}}},
            {"method",
             {{.name = "methods", .help = "which methods: all, or names with commas", .value = &methods_},
              {.name = "rounds",
               .help = "how often each is timed on each frame, in turns with all others",
               .value = &rounds_,
               .low = 1,
               .high = 1000},
              {.name = "device",
               .help = "index of a Vulkan device, or a part of its name; empty = the fastest kind",
               .value = &device_}}},
            {"output",
             {{.name = "out",
               .help = "folder of the report: index.html, bench.csv, bench.json, a plot of each sensor class as .svg",
               .value = &out_,
               .writes = Writes::folder},
              {.name = "pictures",
               .help = "width of small pictures of each capture's first frame, REPORT/pictures/*.jpg: truth, every "
                       "configuration and its difference, full colour at 0.5; 0 = none",
               .value = &pictures_,
               .unit = "pixels",
               .low = 0,
               .high = 8192},
              {.name = "front",
               .help = "file for the measured Pareto front, as `run --max-error` takes it; parts of other sensors stay",
               .value = &front_,
               .writes = Writes::file},
              {.name = "overwrite", .help = "replaces an earlier report", .value = &overwrite_}}}};
        for (Stage& stage : all)
            for (Parameter& row : stage.rows)
                row.common = true;
        return all;
    }

    int run() override {
        check_settings();
        std::vector<Configuration> all = configurations();
        const std::vector<std::string> methods = chosen("methods", methods_, names_of(scanshade::methods()));
        std::erase_if(all, [&](const auto& c) { return std::ranges::find(methods, c.method) == methods.end(); });

        gpu::Device device(device_);
        BenchReport report{command_line(),
                           device.info().name,
                           device.info().driver,
                           SCANSHADE_VERSION,
                           fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr))),
                           rounds_,
                           std::thread::hardware_concurrency(),
                           {},
                           {}};
        Trials trials(device);
        for (const fs::path& path : captures()) {
            const TrialCapture capture = loaded(device, path);
            say(fmt::format("{}: {} frames, {} depth ({}, {})", path.string(), capture.frames.size(),
                            name_of(capture.sensor), describe(capture.noise), capture.noise_origin));
            report.captures.push_back(CaptureBench(trials, capture, all).run(rounds_));
        }
        draw_pictures(report);
        report.groups = grouped(report);
        write(report);
        fmt::print("{}", bench_table(report));
        return exit_code(report);
    }

  private:
    void check_settings() const {
        if (out_.empty())
            throw Misuse("bench needs -o FOLDER for its report");
        if (paths_.empty() && !generated_)
            throw Misuse("bench needs captures, or --generated");
        if (request_.depth_noise != "auto")
            (void)noise_from_text(request_.depth_noise);
        if (fs::exists(fs::path(out_) / "index.html") && !overwrite_)
            throw Misuse(out_ + "/index.html exists already: --overwrite replaces it, or choose another -o");
    }

    /// The capture with its truth, or with the reference fused from its posed frames.
    TrialCapture loaded(gpu::Device& device, const fs::path& path) const {
        TrialCapture capture = load_trial(path, request_);
        if (!capture.reference.empty())
            return capture;
        FusedReference fused(device, path, capture, request_.capture);
        say(fmt::format("{}: {}", path.string(), fused.description()));
        capture.reference = fused.description();
        for (TrialFrame& frame : capture.frames)
            frame.truth = fused.visibility(frame);
        return capture;
    }

    /// The captures named, and those generated.
    std::vector<fs::path> captures() {
        std::vector<fs::path> all(paths_.begin(), paths_.end());
        if (!generated_)
            return all;
        const auto sensor_names = chosen("sensor", sensors_, names_of(sensors()));
        for (const std::string& scene : chosen("scenes", scenes_, names_of(scene::scenes())))
            for (const std::string& sensor : sensor_names)
                all.push_back(generated(scene, sensor));
        return all;
    }

    fs::path generated(const std::string& scene, const std::string& sensor) {
        GenerateOptions options = generate_;
        options.scene = scene;
        options.sensor = sensor;
        options.frames = request_.frames;
        options.overwrite = overwrite_;
        fs::path folder = fs::path(out_) / "captures" / fmt::format("{}-{}", scene, sensor);
        say(fmt::format("generating {}", folder.string()));
        generate(options, folder);
        return folder;
    }

    /// Files of the first frames, small enough to be put side by side by the dozen.
    void draw_pictures(BenchReport& report) const {
        if (pictures_ == 0)
            return;
        constexpr double scale = 0.5;
        const auto draw = [&](const std::string& name, const cv::Mat3b& picture) {
            cv::Mat3b small = picture;
            if (picture.cols > pictures_)
                cv::resize(picture, small, {pictures_, std::max(1, picture.rows * pictures_ / picture.cols)}, 0, 0,
                           cv::INTER_AREA);
            write_atomically(fs::path(out_) / name, encoded_jpeg(small, 75));
        };
        cv::Mat1f ramp(14, 260);
        for (int x = 0; x < ramp.cols; ++x)
            ramp.col(x).setTo((2.0 * x / (ramp.cols - 1) - 1) * scale);
        write_atomically(fs::path(out_) / "pictures/scale.jpg", encoded_jpeg(difference_picture(ramp, scale), 95));
        for (std::size_t c = 0; c < report.captures.size(); ++c) {
            BenchCapture& capture = report.captures[c];
            capture.picture = fmt::format("pictures/{}-truth.jpg", c);
            draw(capture.picture, visibility_picture(capture.truth));
            for (std::size_t i = 0; i < capture.measured.size(); ++i) {
                const cv::Mat1f& map = capture.visibilities[i];
                if (map.empty())
                    continue;
                const std::string name = fmt::format("pictures/{}-{}", c, i);
                capture.measured[i].picture = name + ".jpg";
                draw(name + ".jpg", visibility_picture(map));
                draw(name + "-difference.jpg", difference_picture(cv::Mat1f(map - capture.truth), scale));
            }
        }
    }

    static std::string plot_name(SensorClass sensor) {
        std::string name = fmt::format("{}.svg", name_of(sensor));
        std::ranges::replace(name, ' ', '-');
        return name;
    }

    void write(const BenchReport& report) const {
        const fs::path folder = out_;
        write_atomically(folder / "bench.csv", bench_csv(report));
        write_atomically(folder / "bench.json", text_of(bench_json(report)) + "\n");
        for (const BenchGroup& group : report.groups)
            write_atomically(folder / plot_name(group.sensor), bench_plot(group));
        if (!front_.empty())
            write_front(front_of(report));
        write_atomically(folder / "index.html", bench_page(report)); // last: it says that the rest is there
        say(fmt::format("-> {}", (folder / "index.html").string()));
    }

    /// Sensor classes that were not measured keep the points of an earlier bench.
    void write_front(ParetoFront front) const {
        if (fs::exists(front_)) {
            ParetoFront earlier = front_from(parsed_or_discarded(read_bytes(front_)), front_);
            earlier.replace_with(front);
            front = earlier;
        }
        write_atomically(front_, text_of(to_json(front)) + "\n");
    }

    static int exit_code(const BenchReport& report) {
        std::size_t good = 0, bad = 0;
        for (const BenchCapture& capture : report.captures)
            for (const Measured& m : capture.measured)
                ++(m.why.empty() ? good : bad);
        if (bad == 0)
            return all_well;
        return good == 0 ? nothing_done : some_failed;
    }

    std::vector<std::string> paths_;
    GenerateOptions generate_{.step = 25, .truth_rays = 256}; // views that differ
    TrialRequest request_;
    std::string scenes_ = "all", sensors_ = "ideal", methods_ = "all", device_, out_, front_;
    int rounds_ = 3, pictures_ = 0;
    bool generated_ = false, overwrite_ = false;
};

} // namespace

std::unique_ptr<Command> bench_command() { return std::make_unique<Bench>(); }

} // namespace scanshade
