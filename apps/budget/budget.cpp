#include "apps/budget/budget.h"

#include "ao/expected_errors.h"
#include "projection/base/error.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

constexpr int rounds = 3;

/// The points of the capture's sensor class. Where there are none: those of the first class, and a sentence.
const std::vector<BenchmarkPoint>& points_for(const ParetoFront& front, SensorClass sensor,
                                              std::vector<std::string>& sentences) {
    const auto own = front.points.find(sensor);
    if (own != front.points.end() && !own->second.empty())
        return own->second;
    const auto& [other, points] = *front.points.begin();
    sentences.push_back(
        fmt::format("the Pareto front has no {} depth: errors are those of {} depth", name_of(sensor), name_of(other)));
    return points;
}

/// Errors and times of one point on the capture's frames.
struct Tried {
    double ms = 0;
    std::vector<cv::Mat1f> maps;
};

class TimedTrials {
  public:
    TimedTrials(gpu::Device& device, const TrialCapture& capture, double radius_m)
        : device_(device), capture_(capture), radius_m_(radius_m) {}

    /// The median over frames and rounds, after a warm-up.
    Tried of(const Configuration& configuration) const {
        Trial trial(device_, configuration, capture_.noise, radius_m_, capture_.preparation);
        Tried tried;
        for (const TrialFrame& frame : capture_.frames)
            tried.maps.push_back(trial.compute(frame));
        std::vector<double> ms;
        for (int round = 0; round < rounds; ++round)
            for (const TrialFrame& frame : capture_.frames) {
                (void)trial.compute(frame);
                ms.push_back(trial.device_ms());
            }
        tried.ms = median(ms);
        return tried;
    }

    /// RMS of the errors expected on the frames; NaN where they cannot be told.
    double expected_of(const Configuration& configuration) const {
        Trial trial(device_, configuration, capture_.noise, radius_m_, capture_.preparation);
        double squares = 0;
        for (const TrialFrame& frame : capture_.frames)
            squares += std::pow(trial.expected_rms(frame, trial.compute(frame)), 2);
        return std::sqrt(squares / static_cast<double>(capture_.frames.size()));
    }

  private:
    gpu::Device& device_;
    const TrialCapture& capture_;
    double radius_m_;
};

double rms_between(const std::vector<cv::Mat1f>& ours, const std::vector<cv::Mat1f>& theirs) {
    std::vector<Difference> images;
    for (std::size_t i = 0; i < ours.size(); ++i)
        images.push_back(compare(ours[i], theirs[i]));
    return total(images, {}).rms;
}

std::vector<cv::Mat1f> truths(const TrialCapture& capture) {
    std::vector<cv::Mat1f> maps;
    for (const TrialFrame& frame : capture.frames)
        maps.push_back(frame.truth);
    return maps;
}

/// How many times slower this device is with these images than the Pareto front's device. Times the cheapest and the
/// middle point.
double slowness(const TimedTrials& trials, const std::vector<BenchmarkPoint>& points, double pixels) {
    std::vector<double> ratios;
    for (const std::size_t i : {std::size_t{0}, points.size() / 2})
        ratios.push_back(std::log(trials.of(points[i].configuration).ms / points[i].ms(pixels)));
    return std::exp((ratios[0] + ratios[1]) / 2);
}

std::string limit_text(const Budget& budget) {
    std::string text;
    if (budget.max_error > 0)
        text += fmt::format("RMSE {:g}", budget.max_error);
    if (budget.max_ms > 0)
        text += fmt::format("{}{:g} ms", text.empty() ? "" : ", ", budget.max_ms);
    return text;
}

bool within(const Budget& budget, double ms, double rms) {
    return (budget.max_ms <= 0 || ms <= budget.max_ms) && (budget.max_error <= 0 || rms <= budget.max_error);
}

} // namespace

std::size_t pick(const std::vector<BenchmarkPoint>& points, const std::vector<double>& ms, const Budget& budget) {
    std::size_t best = points.size(), fastest = 0, most_accurate = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        fastest = ms[i] < ms[fastest] ? i : fastest;
        most_accurate = points[i].rms < points[most_accurate].rms ? i : most_accurate;
        if (!within(budget, ms[i], points[i].rms))
            continue;
        const bool better =
            best == points.size() || (budget.max_ms > 0 ? points[i].rms < points[best].rms : ms[i] < ms[best]);
        best = better ? i : best;
    }
    if (best < points.size())
        return best;
    throw Misuse(
        fmt::format("nothing keeps to {}: the fastest, {}, takes about {:.2g} ms (RMSE {:.3f}); the most accurate, {}, "
                    "is expected at RMSE {:.3f} ({:.2g} ms)",
                    limit_text(budget), points[fastest].configuration.full_name(), ms[fastest], points[fastest].rms,
                    points[most_accurate].configuration.full_name(), points[most_accurate].rms, ms[most_accurate]));
}

Choice choose(gpu::Device& device, const ParetoFront& front, const TrialCapture& capture, double radius_m,
              const Budget& budget) {
    Choice choice;
    std::vector<BenchmarkPoint> points = points_for(front, capture.sensor, choice.sentences);
    const TimedTrials trials(device, capture, radius_m);
    const double pixels = static_cast<double>(capture.frames.front().depth.z_m.total());
    const double slower = slowness(trials, points, pixels);
    choice.sentences.push_back(
        fmt::format("budget {}: Pareto front of {} depth measured on {}; this device takes {:.2f} times as long "
                    "per pixel",
                    limit_text(budget), name_of(capture.sensor), front.device, slower));
    const bool truth_fits = !capture.reference.empty() && std::abs(capture.radius_m - radius_m) < 1e-6 * radius_m;
    const auto reference = std::ranges::min_element(points, {}, &BenchmarkPoint::rms)->configuration;
    if (budget.max_error > 0 && !truth_fits) {
        for (BenchmarkPoint& point : points)
            if (const double expected = trials.expected_of(point.configuration); std::isfinite(expected))
                point.rms = expected * spread_of(shipped_error_tables(), point.configuration.method, capture.sensor);
        choice.sentences.push_back(
            fmt::format("errors are what {} frames of this capture keep to with a chance of nine in ten, by how much "
                        "frames of generated scenes exceeded what was expected of them",
                        capture.frames.size()));
    }
    const std::vector<cv::Mat1f> right = truth_fits ? truths(capture) : trials.of(reference).maps;

    while (true) {
        std::vector<double> ms;
        for (const BenchmarkPoint& point : points)
            ms.push_back(point.ms(pixels) * slower);
        const std::size_t picked = pick(points, ms, budget);
        const Tried tried = trials.of(points[picked].configuration);
        choice.configuration = points[picked].configuration;
        choice.expected_ms = ms[picked];
        choice.expected_rms = points[picked].rms;
        choice.measured_ms = tried.ms;
        choice.measured_rms = rms_between(tried.maps, right);
        const bool slow = budget.max_ms > 0 && choice.measured_ms > budget.max_ms;
        const bool off = truth_fits && budget.max_error > 0 && choice.measured_rms > budget.max_error;
        choice.sentences.push_back(
            fmt::format("{} {}: expected {:.3g} ms, RMSE {:.3f}; {} frames: {:.3g} ms, RMSE {:.3f} to {}",
                        slow || off ? "tried" : "picked", choice.configuration.full_name(), choice.expected_ms,
                        choice.expected_rms, capture.frames.size(), choice.measured_ms, choice.measured_rms,
                        truth_fits ? "truth" : reference.full_name()));
        if (!slow && !off)
            return choice;
        points.erase(points.begin() + static_cast<std::ptrdiff_t>(picked));
        if (points.empty())
            throw Misuse(
                fmt::format("nothing keeps to {} on this capture: {}", limit_text(budget), choice.sentences.back()));
    }
}

} // namespace scanshade
