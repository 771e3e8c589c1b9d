// `developers_bench expected-errors`: whether pixels err as much as expected; fits what is expected.
#include "ao/expected_errors.h"
#include "apps/budget/configurations.h"
#include "apps/budget/trial.h"
#include "apps/lists.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"
#include "projection/base/statistics.h"
#include "tests/bench/error_fit.h"
#include "tests/bench/part.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <tbb/parallel_for.h>

namespace scanshade::bench {
namespace {

/// "office" of "office-kinect": captures of one scene are left out together.
std::string scene_of(const std::string& capture) { return capture.substr(0, capture.find('-')); }

using Samples = std::map<SensorClass, std::vector<ErrorSample>>;

class ExpectedErrorsPart final : public Part {
  public:
    Words words() override { return {"CAPTURE", "captures with truth", &captures_, 1, 1 << 20}; }

  private:
    std::vector<Parameter> rows() override {
        return {{"methods", "which methods, with commas, at their defaults; empty = all", &methods_},
                {"fit", "file for tables fitted to these captures, as ao/expected_errors.txt is", &fit_},
                {"each-scene-left-out",
                 "judges every scene by tables fitted to the others (the word before - names the scene)",
                 &each_left_out_},
                {"held-out",
                 "captures, with commas, that are not fitted to: these are judged, by tables fitted to the others",
                 &held_out_},
                {"every", "of the pixels, one in so many", &every_, "", 1, 100000},
                {"variants", "whether other settings than the defaults are fitted, too", &with_variants_},
                {"together",
                 "judges frames computed together (run --sequence on), and fits the factor that the shipped tables get",
                 &together_},
                {"frames", "of each capture; together: those in its middle", &frames_, "", 1, 1000}};
    }

    int measure(const std::string& choice) override {
        if (together_ && !held_out_.empty())
            throw Misuse(
                "--together judges no captures held out; --each-scene-left-out judges each scene by the others");
        gpu::Device device(choice);
        TrialRequest request;
        request.frames = together_ ? std::numeric_limits<int>::max() : frames_; // neighbours are needed, too
        std::vector<std::string> paths = captures_;
        first_held_out_ = paths.size();
        std::ranges::move(comma_separated(held_out_), std::back_inserter(paths));
        for (const std::string& path : paths) {
            trials_.push_back(load_trial(path, request));
            const TrialCapture& capture = trials_.back();
            fmt::print(stderr, "{}: {} ({})\n", capture.name, name_of(class_of(capture.noise)),
                       describe(capture.noise));
            const std::string scene = scene_of(capture.name);
            if (!scenes_.contains(scene))
                scenes_.emplace(scene, static_cast<int>(scenes_.size()));
        }
        table_.emplace(std::vector<std::string>{
            "method", "sensor", "an eighth of the pixels each, by expected error: expected/found", "all",
            "nine of ten frames err by at most so many times what is expected"});
        ErrorTables tables;
        std::string names;
        for (const TrialCapture& capture : std::span(trials_).first(first_held_out_))
            names += " " + capture.name;
        tables.made_by = fmt::format("developers_bench expected-errors{} --fit FILE", names);
        if (together_)
            tables = shipped_error_tables();
        for (const MethodRow& row : scanshade::methods())
            if (const std::string name(row.name); wanted(name)) {
                if (together_)
                    measure_together(device, name, tables);
                else
                    measure(device, name, tables);
            }
        if (!fit_.empty())
            write_atomically(fit_, text_of(tables));
        return all_well;
    }

    [[nodiscard]] bool wanted(const std::string& method) const {
        const std::vector<std::string> only = comma_separated(methods_);
        return only.empty() || std::ranges::count(only, method) > 0;
    }

    void measure(gpu::Device& device, const std::string& method, ErrorTables& tables) {
        const Configuration usual{method, "as it comes", {}};
        const Samples samples = samples_of(device, usual, frames_, false);
        Samples held_out;
        if (!held_out_.empty())
            held_out = samples_of(device, usual, frames_, true);
        for (const auto& [sensor, own] : samples) {
            const shared::ErrorTable shipped =
                errors_of(shipped_error_tables(), method, defaults_of(method), sensor, 0);
            MethodErrors errors;
            if (!fit_.empty() || !held_out_.empty())
                errors.table = fitted_errors(own);
            const bool fitted = !fit_.empty() || !held_out_.empty();
            if (held_out_.empty()) {
                const double spread = tell(method, sensor, own, fitted ? errors.table : shipped,
                                           [&of_all = own](int scene) { return fitted_errors(of_all, scene); });
                if (each_left_out_ && scenes_.size() > 1)
                    errors.spread = static_cast<float>(spread);
            } else if (const auto judged = held_out.find(sensor); judged != held_out.end())
                tell(method, sensor, judged->second, errors.table, {});
            if (!fit_.empty())
                tables.methods[{method, sensor}] = errors;
        }
        if (fit_.empty() || !with_variants_)
            return;
        for (const Configuration& configuration : configurations()) {
            if (configuration.method != method || is_default(configuration))
                continue;
            for (const auto& [sensor, own] : samples_of(device, configuration, 1, false))
                if (const auto known = tables.methods.find({method, sensor}); known != tables.methods.end())
                    known->second.variants.push_back({configuration.settings, factor_of(own, known->second.table)});
        }
    }

    /// What computing frames together makes of their squared error, by the same frames computed alone: how hard the
    /// captures are cancels out.
    void measure_together(gpu::Device& device, const std::string& method, ErrorTables& tables) {
        const Configuration usual{method, "as it comes", {}};
        const Samples together = samples_of(device, usual, frames_, false, true);
        Samples alone = samples_of(device, usual, frames_, false, false);
        for (const auto& [sensor, own] : together) {
            const ChosenSettings settings = defaults_of(method);
            const shared::ErrorTable table = errors_of(shipped_error_tables(), method, settings, sensor, 0);
            const auto factor = [&table, &with_others = own, &by_itself = alone[sensor]](int without) {
                return factor_of(with_others, table, without) - factor_of(by_itself, table, without);
            };
            tell(method, sensor, own,
                 fit_.empty() ? errors_of(shipped_error_tables(), method, settings, sensor, 1)
                              : scaled(table, factor(-1)),
                 [&](int scene) { return scaled(table, factor(scene)); });
            if (const auto known = tables.methods.find({method, sensor}); known != tables.methods.end())
                known->second.together = factor(-1);
        }
    }

    static ChosenSettings defaults_of(const std::string& method) {
        ChosenSettings settings;
        const auto setup = method_named(method).setup();
        for (const Parameter& row : setup->parameters())
            settings.emplace_back(row.name, value_text(row));
        return settings;
    }

    static bool is_default(const Configuration& configuration) {
        const ChosenSettings usual = defaults_of(configuration.method);
        return std::ranges::all_of(configuration.settings,
                                   [&](const auto& each) { return std::ranges::find(usual, each) != usual.end(); });
    }

    /// Pixels of `frames` frames of each capture: the first, or with --together those in the middle.
    /// `together`: of these as computed together, not each by itself.
    Samples samples_of(gpu::Device& device, const Configuration& configuration, int frames, bool held_out,
                       bool together = false) {
        Samples all;
        std::optional<Trial> trial;
        double radius_m = 0;
        for (std::size_t c = held_out ? first_held_out_ : 0; c < (held_out ? trials_.size() : first_held_out_); ++c) {
            const TrialCapture& capture = trials_[c];
            if (!trial || radius_m != capture.radius_m)
                trial.emplace(device, configuration, capture.noise, capture.radius_m);
            radius_m = capture.radius_m;
            trial->set_noise(capture.noise);
            std::vector<ErrorSample>& samples = all[class_of(capture.noise)];
            const int scene = scenes_.at(scene_of(capture.name));
            const std::size_t count = std::min(capture.frames.size(), static_cast<std::size_t>(frames));
            const std::size_t first = together_ ? (capture.frames.size() - count) / 2 : 0;
            std::vector<cv::Mat1f> maps;
            if (together)
                maps = trial->compute_together(capture.frames, first, count);
            for (std::size_t i = first; i < first + count; ++i)
                add(samples, capture.frames[i], together ? maps[i - first] : trial->compute(capture.frames[i]), capture,
                    scene, static_cast<int>(c) * 1000 + static_cast<int>(i));
        }
        return all;
    }

    void add(std::vector<ErrorSample>& samples, const TrialFrame& frame, const cv::Mat1f& visibility,
             const TrialCapture& capture, int scene, int number) const {
        const auto seed = static_cast<std::uint32_t>(number);
        if (visibility.size() != frame.depth.z_m.size() || frame.truth.empty())
            throw Error(frame.name + ": expected errors need truth on the pixels of the view");
        std::vector<std::vector<ErrorSample>> rows(static_cast<std::size_t>(visibility.rows));
        for_each_sign(frame.depth, visibility, capture.radius_m, capture.noise,
                      [&](int v, int u, const ErrorSigns& signs) {
                          const float off = visibility(v, u) - frame.truth(v, u);
                          const std::uint32_t dice =
                              hash(hash(seed, static_cast<std::uint32_t>(v)), static_cast<std::uint32_t>(u));
                          if (std::isfinite(off) && dice % static_cast<std::uint32_t>(every_) == 0)
                              rows[static_cast<std::size_t>(v)].push_back(
                                  {weights_of(signs, visibility(v, u)), off * off, scene, number});
                      });
        for (const auto& row : rows)
            samples.insert(samples.end(), row.begin(), row.end());
    }

    /// Prints a row; `of_others` makes a table without a scene. Returns how many times what is expected nine of ten
    /// frames err by at most.
    double tell(const std::string& method, SensorClass sensor, std::span<const ErrorSample> samples,
                const shared::ErrorTable& table, const std::function<shared::ErrorTable(int)>& of_others) {
        Calibration all;
        std::map<int, std::pair<double, double>> frames; // expected and found squares
        const auto judge = [&](int scene, const shared::ErrorTable& by) {
            for (const ErrorSample& sample : samples)
                if (scene < 0 || sample.scene == scene) {
                    const float expects = expected_error(sample.signs, by);
                    all.add(expects, sample.square);
                    frames[sample.frame].first += static_cast<double>(expects * expects);
                    frames[sample.frame].second += static_cast<double>(sample.square);
                }
        };
        if (each_left_out_ && of_others) {
            std::vector<shared::ErrorTable> by(scenes_.size());
            tbb::parallel_for(0, static_cast<int>(scenes_.size()),
                              [&](int scene) { by[static_cast<std::size_t>(scene)] = of_others(scene); });
            for (int scene = 0; scene < static_cast<int>(scenes_.size()); ++scene)
                judge(scene, by[static_cast<std::size_t>(scene)]);
        } else
            judge(-1, table);
        std::vector<double> times;
        for (const auto& [frame, squares] : frames)
            times.push_back(std::sqrt(squares.second / squares.first));
        const double spread = quantile(times, 0.9);
        table_->row({method, std::string(name_of(sensor)), text_of_bins(all), text_of(all.whole()),
                     fmt::format("{:.2f}", spread)});
        return spread;
    }

    std::vector<std::string> captures_;
    std::optional<Table> table_;
    std::string methods_, fit_, held_out_;
    std::size_t first_held_out_ = 0;
    bool each_left_out_ = false, with_variants_ = true, together_ = false;
    int every_ = 29, frames_ = 8;
    std::vector<TrialCapture> trials_;
    std::map<std::string, int> scenes_;
};

} // namespace

std::unique_ptr<Command> expected_errors_part() { return std::make_unique<ExpectedErrorsPart>(); }

} // namespace scanshade::bench
