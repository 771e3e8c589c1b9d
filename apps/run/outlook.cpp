#include "apps/run/outlook.h"

#include <algorithm>
#include <fmt/format.h>

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

bool is_prepared_as_measured(const RunSettings& settings) {
    return settings.depth_noise != "none" && settings.drop_flying && settings.depth_smoothing == 1;
}

} // namespace

std::vector<std::string> outlook(const RunSettings& settings, const DepthNoise& noise, const Capture& capture,
                                 const ParetoFront& front) {
    const bool clouds = std::ranges::any_of(capture.entries, [](const auto& entry) { return !entry.cloud.empty(); });
    if (clouds || capture.unit.arbitrary() || settings.budget.any() || !is_prepared_as_measured(settings))
        return {};
    const SensorClass sensor = class_of(noise);
    const BenchmarkPoint* used = measured_with(front, sensor, settings.method, values_of(settings.chosen_setup()));
    if (!used)
        return {};
    const bool together = settings.in_sequence(capture);
    const auto gain = front.sequences.find(sensor);
    std::vector<std::string> sentences{fmt::format(
        "expected error{}: RMSE {:.3f} to truth, measured with {} on generated scenes with {} depth; real sensors may "
        "err more",
        together ? " of each frame by itself" : "", used->rms, used->configuration.full_name(), name_of(sensor))};
    if (gain != front.sequences.end() && together)
        sentences.push_back(gain_text(gain->second));
    const auto better = better_preset(front, sensor, *used);
    if (better) {
        const BenchmarkPoint* point = measured_with(front, sensor, *better);
        sentences.push_back(fmt::format("--preset {}: RMSE {:.3f}, in {:.1f} times the time of the method's passes",
                                        word_for(*better, preset_words), point->rms,
                                        point->ns_per_pixel / used->ns_per_pixel));
    }
    // `best` looks at frames together, too.
    if (gain != front.sequences.end() && !together && has_poses(capture) &&
        better.value_or(Preset::best) == Preset::best)
        sentences.push_back(fmt::format("{}: {}", settings.preset == Preset::best ? "--sequence on" : "--preset best",
                                        gain_text(gain->second)));
    return sentences;
}

} // namespace scanshade
