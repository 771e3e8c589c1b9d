// `developers_bench calibrate`: a method's free settings fitted to truth on some captures, judged on others.
#include "ao/gpu/device.h"
#include "apps/budget/trial.h"
#include "apps/command_line.h"
#include "apps/json.h"
#include "apps/lists.h"
#include "apps/walk/progress.h"
#include "io/output_file.h"
#include "projection/base/error.h"
#include "tests/bench/part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core/optim.hpp>
#include <optional>

namespace scanshade::bench {
namespace {

namespace fs = std::filesystem;

/// A setting that the search may change.
struct Free {
    std::string name;
    double start = 0, step = 0, low = 0, high = 0;
};

Free free_setting(const std::vector<Parameter>& rows, const std::string& method, const std::string& name) {
    const Parameter* row = row_named(rows, name);
    if (!row)
        throw Misuse(fmt::format("free: the method {} has no setting '{}'", method, name));
    if (!std::holds_alternative<float*>(row->value) && !std::holds_alternative<double*>(row->value))
        throw Misuse(fmt::format("free: {} is not a real number; only real numbers can be fitted", name));
    const double start = number_of(*row);
    const double span = std::isfinite(row->high - row->low) ? row->high - row->low : 1;
    return {name, start, start != 0 ? 0.25 * std::abs(start) : 0.05 * std::min(span, 1.0), row->low, row->high};
}

/// The settings of a method's tone curve. The best ones follow from maps made without it (1, 1), whatever else is
/// searched.
struct ToneCurveRows {
    std::string_view strength, power;
};
/// cacao applies its curve before the blur. The best curve of the blurred map is as good, to within the blur.
constexpr std::array tone_curve_rows{ToneCurveRows{"strength", "power"},
                                     ToneCurveRows{"shadow-multiplier", "shadow-power"}};

/// A method's tone curve, where both settings are to be fitted, and their bounds.
struct FreeToneCurve {
    ToneCurveRows rows;
    ToneCurve least, most;
};

/// k of exp(-k (1 - V)), where it is fitted and strength and power are not both.
constexpr std::string_view exponent_row = "curve";

/// Errors of one configuration: of each capture, and over all (root mean square over captures).
struct FitScore {
    std::vector<Difference> captures;
    std::vector<PairSums> pairs_of_captures;
    PairSums pairs;
    double rms = 0;
};

/// Without `figures` only the pairs are gathered: figures take longer than maps.
FitScore score(gpu::Device& device, const std::vector<TrialCapture>& captures, const Configuration& configuration,
               bool figures = true) {
    FitScore all;
    for (const TrialCapture& capture : captures) {
        Trial trial(device, configuration, capture.noise, capture.radius_m);
        PairSums pairs;
        std::vector<Difference> images;
        for (const TrialFrame& frame : capture.frames) {
            const cv::Mat1f map = trial.compute(frame);
            if (figures)
                images.push_back(compare(map, frame.truth));
            pairs.add(pair_sums(map, frame.truth));
        }
        all.pairs.add(pairs);
        all.pairs_of_captures.push_back(pairs);
        if (!figures)
            continue;
        all.captures.push_back(total(images, pairs));
        all.rms += all.captures.back().rms * all.captures.back().rms / static_cast<double>(captures.size());
    }
    all.rms = std::sqrt(all.rms);
    return all;
}

/// Root mean square over captures with exp(-k (1 - V)) in place of V.
double rms_with(double k, const std::vector<PairSums>& captures) {
    double sum = 0;
    for (const PairSums& pairs : captures)
        sum += std::pow(pairs.rms({1, 1, k}), 2);
    return std::sqrt(sum / static_cast<double>(captures.size()));
}

/// The best k to 0.01: the error has one valley.
double best_exponent(const std::vector<PairSums>& captures, double most) {
    constexpr double step = 0.01;
    int best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i * step <= most; ++i)
        if (const double rms = rms_with(i * step, captures); rms < least) {
            least = rms;
            best = i;
        }
    return best * step;
}

/// Nelder and Mead's simplex (1965) over the free settings, in units of their first steps. Beyond a limit the nearest
/// allowed value counts, with a penalty that grows with the distance, so that the simplex comes back.
class Search final : public cv::MinProblemSolver::Function {
  public:
    Search(gpu::Device& device, const std::vector<TrialCapture>& captures, Configuration fixed, std::vector<Free> free,
           std::optional<FreeToneCurve> curve, std::optional<double> most_exponent)
        : device_(device), captures_(captures), fixed_(std::move(fixed)), free_(std::move(free)), curve_(curve),
          most_exponent_(most_exponent) {
        if (most_exponent_)
            fixed_.settings.emplace_back(exponent_row, "0");
        if (curve_)
            for (const std::string_view row : {curve_->rows.strength, curve_->rows.power})
                fixed_.settings.emplace_back(row, "1");
    }

    /// OpenCV's simplex needs two dimensions: beside a single setting, one that changes nothing.
    [[nodiscard]] int getDims() const override { return std::max(2, static_cast<int>(free_.size())); }

    double calc(const double* at) const override {
        Settings values;
        double excess = 0;
        for (std::size_t i = 0; i < free_.size(); ++i) {
            const Free& free = free_[i];
            const double wanted = free.start + at[i] * free.step, value = std::clamp(wanted, free.low, free.high);
            excess += std::abs(wanted - value) / free.step;
            values.emplace_back(free.name, fmt::format("{:.6g}", value));
        }
        return tried(values) * (1 + 0.01 * excess);
    }

    /// The best settings found.
    [[nodiscard]] Settings run(int evaluations) {
        if (free_.empty()) {
            (void)tried({});
            return best_;
        }
        const auto solver = cv::DownhillSolver::create();
        solver->setFunction(cv::Ptr<Search>(this, [](Search*) {}));
        solver->setInitStep(cv::Mat1d::ones(1, getDims()));
        solver->setTermCriteria({cv::TermCriteria::MAX_ITER + cv::TermCriteria::EPS, evaluations, 1e-5});
        cv::Mat1d at(1, getDims(), 0.0);
        solver->minimize(at);
        return best_;
    }

  private:
    double tried(Settings values) const {
        Configuration configuration = fixed_;
        std::ranges::copy(values, std::back_inserter(configuration.settings));
        // The best curve alone decides where one is fitted.
        FitScore now = score(device_, captures_, configuration, !curve_ && !most_exponent_);
        if (curve_) {
            const ToneCurve best = now.pairs.best_curve(curve_->least, curve_->most);
            now.rms = now.pairs.rms(best);
            values.emplace_back(curve_->rows.strength, fmt::format("{:.4g}", best.strength));
            values.emplace_back(curve_->rows.power, fmt::format("{:.4g}", best.power));
        }
        if (most_exponent_) {
            const double k = best_exponent(now.pairs_of_captures, *most_exponent_);
            now.rms = rms_with(k, now.pairs_of_captures);
            values.emplace_back(exponent_row, fmt::format("{:.2f}", k));
        }
        std::string line;
        for (const auto& [name, value] : values)
            line += fmt::format(" {} {}", name, value);
        say(fmt::format("  {:>4} RMSE {:.4f}{}", ++tried_, now.rms, line));
        if (best_.empty() || now.rms < best_rms_) {
            best_ = values;
            best_rms_ = now.rms;
        }
        return now.rms;
    }

    gpu::Device& device_;
    const std::vector<TrialCapture>& captures_;
    Configuration fixed_;
    std::vector<Free> free_;
    std::optional<FreeToneCurve> curve_;
    std::optional<double> most_exponent_; ///< where k follows from maps made without it
    mutable int tried_ = 0;               // mutable, since the solver's interface is const
    mutable Settings best_;
    mutable double best_rms_ = 0;
};

// ---------------------------------------------------------------------------------------------------- the command

class Calibrate final : public Command {
  public:
    Calibrate() {
        for (const MethodRow& row : methods())
            setups_.emplace_back(row.name, row.setup());
    }

    Words words() override {
        return {"CAPTURE", "training captures with truth/ao, as generate makes them", &training_, 1, 1 << 20};
    }

    std::vector<Stage> stages() override {
        std::vector<std::string> names;
        for (const MethodRow& row : methods())
            names.emplace_back(row.name);
        std::vector<Stage> all{
            {"captures",
             {{.name = "held-out",
               .help = "captures to judge the result on, with commas: none of the training ones",
               .value = &held_out_},
              {.name = "frames",
               .help = "frames taken of each capture, spread evenly",
               .value = &request_.frames,
               .low = 1,
               .high = 100000},
              {.name = "depth-noise",
               .help = "as run takes it: auto (measured), none, kinect, tof or FLOOR,PER_Z2",
               .value = &request_.depth_noise}}},
            {"method",
             {{.name = "method", .help = "the method whose settings are fitted", .value = &method_, .choices = names},
              {.name = "free",
               .help = "names of its settings to fit, with commas; the others stay as given",
               .value = &free_},
              {.name = "evaluations",
               .help = "how many steps the search may take",
               .value = &evaluations_,
               .low = 1,
               .high = 100000},
              {.name = "device",
               .help = "index of a Vulkan device, or a part of its name; empty = the fastest kind",
               .value = &device_}}},
            {"output",
             {{.name = "out",
               .help = "JSON file of the fitted settings, as `run --settings` takes it",
               .value = &out_,
               .writes = Writes::file},
              {.name = "overwrite", .help = "replaces an earlier file", .value = &overwrite_}}}};
        for (const auto& [name, setup] : setups_)
            all.push_back(method_stage(name, *setup));
        return all;
    }

    int run() override {
        check_settings();
        const Configuration start = as_given();
        gpu::Device device(device_);
        const std::vector<TrialCapture> training = load(training_), others = load(comma_separated(held_out_));
        std::vector<Free> free;
        const std::vector<Parameter> rows = setup().parameters();
        for (const std::string& name : comma_separated(free_))
            free.push_back(free_setting(rows, method_, name));
        const std::optional<FreeToneCurve> curve = taken_out(free);
        const std::optional<double> most_exponent = curve ? std::nullopt : exponent_taken_out(free, start);
        const Settings found = Search(device, training, start, free, curve, most_exponent).run(evaluations_);
        Configuration fitted = start;
        std::ranges::copy(found, std::back_inserter(fitted.settings));
        report(device, start, fitted, found, training, others);
        return all_well;
    }

  private:
    void check_settings() const {
        if (out_.empty())
            throw Misuse("calibrate needs -o FILE for the settings");
        if (comma_separated(free_).empty())
            throw Misuse("calibrate needs --free NAMES: which settings to fit");
        if (fs::exists(out_) && !overwrite_)
            throw Misuse(out_ + " exists already: --overwrite replaces it, or choose another -o");
        for (const std::string& path : comma_separated(held_out_))
            for (const std::string& other : training_)
                if (fs::weakly_canonical(path) == fs::weakly_canonical(other))
                    throw Misuse(fmt::format("held-out: {} is a training capture", path));
    }

    /// Takes a tone curve out of the search, where both of its settings are free.
    static std::optional<FreeToneCurve> taken_out(std::vector<Free>& free) {
        for (const ToneCurveRows& rows : tone_curve_rows) {
            const auto strength = std::ranges::find(free, rows.strength, &Free::name);
            const auto power = std::ranges::find(free, rows.power, &Free::name);
            if (strength == free.end() || power == free.end())
                continue;
            const FreeToneCurve curve{rows, {strength->low, power->low}, {strength->high, power->high}};
            std::erase_if(free, [&](const Free& f) { return f.name == rows.strength || f.name == rows.power; });
            return curve;
        }
        return std::nullopt;
    }

    /// Takes k out of the search: it follows from maps without a curve, as long as strength and power leave them alone.
    static std::optional<double> exponent_taken_out(std::vector<Free>& free, const Configuration& given) {
        const auto exponent = std::ranges::find(free, exponent_row, &Free::name);
        const auto changed = [&](std::string_view row) {
            const auto other = std::ranges::find(given.settings, row, &Settings::value_type::first);
            return std::ranges::find(free, row, &Free::name) != free.end() ||
                   (other != given.settings.end() && other->second != "1");
        };
        if (exponent == free.end() || changed("strength") || changed("power"))
            return std::nullopt;
        const double most = exponent->high;
        free.erase(exponent);
        return most;
    }

    MethodSetup& setup() {
        return *std::ranges::find(setups_, method_, [](const auto& s) { return s.first; })->second;
    }

    /// Every setting from the command line, except the radius: each capture's truth has its own.
    Configuration as_given() {
        Configuration given{method_, "candidate", values_of(setup())};
        std::erase_if(given.settings, [](const auto& setting) { return setting.first == "radius"; });
        return given;
    }

    std::vector<TrialCapture> load(const std::vector<std::string>& paths) const {
        std::vector<TrialCapture> captures;
        for (const std::string& path : paths) {
            captures.push_back(load_trial(path, request_));
            if (captures.back().reference.empty())
                throw Error(path + ": no truth/ao to fit to");
            say(fmt::format("{}: {} frames, {} depth", path, captures.back().frames.size(),
                            name_of(captures.back().sensor)));
        }
        return captures;
    }

    void report(gpu::Device& device, const Configuration& before, const Configuration& after, const Settings& found,
                const std::vector<TrialCapture>& training, const std::vector<TrialCapture>& others) const {
        json text{{"made_by", "developers_bench calibrate"},
                  {"command_line", command_line()},
                  {"settings", {{"method", {{"method", method_}}}}}};
        json& settings = text["settings"]["method " + method_];
        for (const auto& [name, value] : found) {
            fmt::print("--{}.{} {}\n", method_, name, value);
            settings[fmt::format("{}.{}", method_, name)] = std::stod(value);
        }
        Table table({"captures", "capture", "RMSE before", "after", "with the best curve before", "after"});
        text["training"] =
            judged(table, "training", training, score(device, training, before), score(device, training, after));
        text["held_out"] =
            judged(table, "held out", others, score(device, others, before), score(device, others, after));
        if (others.empty())
            say("no --held-out captures: the result is not checked on other captures");
        write_atomically(out_, text_of(text) + "\n");
    }

    static json judged(Table& table, const std::string& role, const std::vector<TrialCapture>& captures,
                       const FitScore& before, const FitScore& after) {
        json rows = json::array();
        const auto line = [&](const std::string& name, double rms, double rms_after, double calibrated,
                              double calibrated_after) {
            table.row({role, name, fmt::format("{:.4f}", rms), fmt::format("{:.4f}", rms_after),
                       fmt::format("{:.4f}", calibrated), fmt::format("{:.4f}", calibrated_after)});
            rows.push_back({{"capture", name}, {"rms_before", rms}, {"rms_after", rms_after}});
        };
        for (std::size_t i = 0; i < captures.size(); ++i)
            line(captures[i].name, before.captures[i].rms, after.captures[i].rms, before.captures[i].calibrated_rms,
                 after.captures[i].calibrated_rms);
        if (!captures.empty())
            line("all", before.rms, after.rms, before.pairs.rms(before.pairs.best_curve()),
                 after.pairs.rms(after.pairs.best_curve()));
        return rows;
    }

    std::vector<std::string> training_;
    TrialRequest request_;
    std::string held_out_, method_ = "cacao", free_, device_, out_;
    int evaluations_ = 60;
    bool overwrite_ = false;
    std::vector<std::pair<std::string, std::unique_ptr<MethodSetup>>> setups_;
};

} // namespace

std::unique_ptr<Command> calibrate_part() { return std::make_unique<Calibrate>(); }

} // namespace scanshade::bench
