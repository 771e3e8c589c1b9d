#include "apps/run/outlook.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace scanshade {
namespace {

/// What was measured with these settings of a method; null where nothing was.
const BenchmarkPoint* measured_with(const ParetoFront& front, SensorClass sensor, const std::string& method,
                                    const Settings& values) {
    for (const auto* by_class : {&front.points, &front.others})
        if (const auto points = by_class->find(sensor); points != by_class->end())
            for (const BenchmarkPoint& point : points->second) {
                if (point.configuration.method != method)
                    continue;
                const auto setup = method_named(method).setup();
                apply(point.configuration, *setup);
                if (values_of(*setup) == values)
                    return &point;
            }
    return nullptr;
}

const BenchmarkPoint* measured_with(const ParetoFront& front, SensorClass sensor, Preset preset) {
    const Configuration& configuration = configuration_of(preset);
    const auto setup = method_named(configuration.method).setup();
    apply(configuration, *setup);
    return measured_with(front, sensor, configuration.method, values_of(*setup));
}

/// The cheapest preset that errs clearly less.
std::optional<Preset> better_preset(const ParetoFront& front, SensorClass sensor, const BenchmarkPoint& used) {
    constexpr double clearly = 0.98;
    for (const auto& [name, preset] : preset_words)
        if (const BenchmarkPoint* point = measured_with(front, sensor, preset);
            point && point->rms < clearly * used.rms)
            return preset;
    return std::nullopt;
}

std::string gain_text(const SequenceGain& gain) {
    const std::string time =
        gain.times_as_long > 0 ? fmt::format(", in {:.1f} times the time", gain.times_as_long) : "";
    return fmt::format("on generated recordings, computing frames together took {} from RMSE {:.3f} to {:.3f}{}",
                       gain.configuration.full_name(), gain.alone_rms, gain.together_rms, time);
}

/// Of the frames: all together, and the least and most of one.
struct Range {
    double all, least, most;
};

std::optional<Range> expected_of(const std::vector<FrameRow>& rows) {
    Range range{0, std::numeric_limits<double>::infinity(), 0};
    std::size_t known = 0;
    for (const FrameRow& row : rows)
        if (is_done(row.status) && std::isfinite(row.expected_error)) {
            range.all += row.expected_error * row.expected_error;
            range.least = std::min(range.least, row.expected_error);
            range.most = std::max(range.most, row.expected_error);
            ++known;
        }
    if (known == 0)
        return std::nullopt;
    range.all = std::sqrt(range.all / static_cast<double>(known));
    return range;
}

std::string text_of(const Range& range) {
    return range.most - range.least < 0.0005
               ? fmt::format("{:.3f}", range.all)
               : fmt::format("{:.3f} ({:.3f} to {:.3f} of single frames)", range.all, range.least, range.most);
}

bool is_prepared_as_measured(const RunSettings& settings) {
    return settings.depth_noise != "none" && settings.drop_flying && settings.depth_smoothing == 1;
}

} // namespace

std::vector<std::string> outlook(const RunSettings& settings, MethodSetup& setup, const DepthNoise& noise,
                                 const Capture& capture, const std::vector<FrameRow>& rows, const ParetoFront& front) {
    const bool clouds = std::ranges::any_of(capture.entries, [](const auto& entry) { return !entry.cloud.empty(); });
    if (clouds || capture.unit.arbitrary() || settings.budget.any() || !is_prepared_as_measured(settings))
        return {};
    const SensorClass sensor = class_of(noise);
    const BenchmarkPoint* used = measured_with(front, sensor, settings.method, values_of(setup));
    if (!used)
        return {};
    const bool together = std::ranges::any_of(rows, [](const FrameRow& row) { return row.other_frames > 0; });
    const auto gain = front.sequences.find(sensor);
    const std::string alone = together ? " of each frame by itself" : "";
    const bool asked_together = settings.in_sequence(capture);
    const std::string measured =
        fmt::format("measured with {} on generated scenes with {} depth; real sensors may err more",
                    used->configuration.full_name(), name_of(sensor));
    const std::optional<Range> here = expected_of(rows);
    std::vector<std::string> sentences{
        here ? fmt::format("expected error: RMSE {} to truth, by what errors such pixels had, {}", text_of(*here),
                           measured)
             : fmt::format("expected error{}: RMSE {:.3f} to truth, {}", alone, used->rms, measured)};
    if (gain != front.sequences.end() && together)
        sentences.push_back(gain_text(gain->second));
    if (asked_together && !together)
        sentences.emplace_back("no frame fitted together with another, so each was computed by itself");
    const auto better = better_preset(front, sensor, *used);
    if (better) {
        const BenchmarkPoint* point = measured_with(front, sensor, *better);
        sentences.push_back(fmt::format(
            "--preset {}: RMSE {:.3f} in place of {:.3f} on those scenes, in {:.1f} times the "
            "time of the method's passes",
            word_for(*better, preset_words), point->rms, used->rms, point->ns_per_pixel / used->ns_per_pixel));
    }
    // `best` looks at frames together, too.
    if (gain != front.sequences.end() && !asked_together && has_poses(capture) &&
        better.value_or(Preset::best) == Preset::best)
        sentences.push_back(fmt::format("{}: {}", settings.preset == Preset::best ? "--sequence on" : "--preset best",
                                        gain_text(gain->second)));
    return sentences;
}

} // namespace scanshade
