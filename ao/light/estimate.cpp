// Keeps the simplest model of light that explains unseen albedos as well as any.
#include "ao/light/fit.h"
#include "projection/base/hash.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <numeric>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;

constexpr double least_power = 0.1;   // less is no sign of AO
constexpr double most_gradient = 0.3; // of ambient light towards a direct one, and of that light
constexpr int fewest_samples = 500, fewest_albedos = 12, halvings = 5;
constexpr std::size_t most_of_search = 2500, most_of_half = 4000; // samples: more change no answer

// From the simplest on; those with direct light last.
constexpr std::array models{LightTerms{"albedo alone", false, false, false, false},
                            LightTerms{"ambient", true, false, false, false},
                            LightTerms{"ambient with a gradient", true, true, false, false},
                            LightTerms{"ambient and direct", true, false, true, false},
                            LightTerms{"ambient and direct with shadows", true, false, true, true},
                            LightTerms{"ambient with a gradient, and direct with shadows", true, true, true, true}};

/// Half of the albedos, another half in each round; `first` or the others.
bool in_half(int albedo, int round, bool first) {
    return ((hash(static_cast<std::uint32_t>(albedo), static_cast<std::uint32_t>(round) + 101U) >> 16 & 1U) == 0) ==
           first;
}

/// One number after the other as they rise; the mean and its standard error of what differs from `than`.
std::pair<double, double> mean_gain(const std::vector<double>& costs, const std::vector<double>& than) {
    double sum = 0, squares = 0;
    const auto n = static_cast<double>(costs.size());
    for (std::size_t i = 0; i < costs.size(); ++i)
        sum += than[i] - costs[i];
    for (std::size_t i = 0; i < costs.size(); ++i)
        squares += std::pow(than[i] - costs[i] - sum / n, 2);
    return {sum / n, std::sqrt(squares / (n - 1) / n)};
}

std::string text_of(const Vector3d& v) { return fmt::format("{:.2f}, {:.2f}, {:.2f}", v.x(), v.y(), v.z()); }

double degrees_between(const Vector3d& a, const Vector3d& b) {
    return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)) * 180 / std::numbers::pi;
}

/// What is wrong with a direct light that explains the samples; empty = nothing.
std::string doubt_about(const LightFit& fit, const LightTerms& terms, const LightPart& part, const LightValues& values,
                        const std::vector<LightValues>& halves, const LightSamples& samples, bool given) {
    double lit = 0, unlit = 0;
    for (std::size_t i = 0; i < part.samples.size(); ++i) {
        const double towards = fit.sample(part.samples[i]).normal.dot(values.direct);
        (towards > light_facing * values.direct.norm() && part.lit[i] > 0 ? lit : unlit) += 1;
    }
    const auto n = static_cast<double>(part.samples.size());
    if (lit < 0.05 * n)
        return "too few surfaces face it";
    if (unlit < 0.05 * n)
        return "every surface faces it, so it cannot be told from ambient light";
    std::vector<double> residuals = fit.residuals(part, values);
    for (double& r : residuals)
        r = std::abs(r);
    if (const double usual = median(residuals, 1.0); usual > 0.15)
        return fmt::format("colours differ from it by {:.0f} % in the median", 100 * usual);
    // Halves must agree in what they say of surfaces, not in a direction that no surface shows.
    std::vector<double> apart, light;
    for (const std::size_t i : part.samples) {
        const double whole = std::max(0.0, fit.sample(i).normal.dot(values.direct));
        if (whole <= light_facing * values.direct.norm())
            continue;
        for (const LightValues& half : halves)
            apart.push_back(std::abs(std::max(0.0, fit.sample(i).normal.dot(half.direct)) - whole) / whole);
    }
    if (const double usual = median(apart, 0.0); usual > 0.25)
        return fmt::format("halves of the surfaces disagree about it by {:.0f} %", 100 * usual);
    // Light that fades out over normals is a sky; that of one direction ends where surfaces turn away from it. Errors
    // of visibility make the one look like the other: it then takes a gradient, of whatever sign, to tell them apart.
    LightTerms both = terms;
    both.gradient = true;
    const LightValues with = fit.refined(part, both, values, given);
    if (std::abs(with.gradient.dot(with.direct.normalized())) > most_gradient * with.direct.norm())
        return "it cannot be told from ambient light that is brighter from one side";
    if (!given && samples.frames() > 0 && degrees_between(values.direct, -samples.forward()) < 15)
        return "it comes from the camera, where everything seen is lit";
    return "";
}

} // namespace

LightEstimate estimate_light(const LightSamples& samples, const LightRequest& request) {
    LightEstimate result;
    result.frames = samples.frames();
    result.light.in_world = samples.in_world();
    LightFit fit(samples);
    const auto every = [](int) { return true; };
    LightPart whole = fit.part_of(every);
    result.samples = whole.samples.size();
    result.albedos = samples.albedos();
    if (whole.samples.size() < fewest_samples || samples.albedos() < fewest_albedos) {
        result.sentence = fmt::format(
            "light: all of it is taken for ambient: {} samples of {} albedos tell too little (at least {} of {})",
            whole.samples.size(), samples.albedos(), fewest_samples, fewest_albedos);
        return result;
    }
    fit.take_gains(whole, fit.fitted(whole, models[2], {}, {}, false));

    const std::size_t tried = request.direct ? models.size() : 3;
    std::vector<std::vector<double>> costs(tried, std::vector<double>(2 * halvings));
    std::vector<std::vector<LightValues>> halves(tried, std::vector<LightValues>(2 * halvings));
    tbb::parallel_for(std::size_t{0}, std::size_t{2 * halvings}, [&](std::size_t half) {
        const int round = static_cast<int>(half / 2);
        const bool first = half % 2 == 0;
        const auto mine = [&](int albedo) { return in_half(albedo, round, first); };
        const auto others = [&](int albedo) { return in_half(albedo, round, !first); };
        LightPart seen = fit.part_of(mine, most_of_half), unseen = fit.part_of(others);
        std::vector<LightStart> starts;
        if (request.direct)
            starts = fit.starts(fit.part_of(mine, most_of_search), request, false);
        for (std::size_t model = 0; model < tried; ++model) {
            const LightValues values = halves[model][half] = fit.fitted(seen, models[model], starts, request, false);
            std::fill(unseen.lit.begin(), unseen.lit.end(), 1);
            if (models[model].shadows)
                fit.cast_shadows(unseen, values.direct);
            costs[model][half] = fit.cost(unseen, values);
        }
    });
    std::size_t chosen = 0;
    for (std::size_t model = 0; model < tried; ++model) {
        result.models.push_back(
            {models[model].name, std::accumulate(costs[model].begin(), costs[model].end(), 0.0) / (2 * halvings)});
        // A term is kept if it explains what it was not fitted to better, by more than chance and two per cent.
        const auto [gain, error] = mean_gain(costs[model], costs[chosen]);
        if (model > 0 && gain > std::max(error, 0.02 * result.models[chosen].held_out))
            chosen = model;
    }
    std::string why_none = !request.direct         ? "as asked"
                           : models[chosen].direct ? ""
                                                   : "no direct light explains unseen surfaces better";
    std::vector<LightStart> starts;
    if (models[chosen].direct)
        starts = fit.starts(fit.part_of(every, most_of_search), request, true);
    LightValues values = fit.fitted(whole, models[chosen], starts, request, true);
    if (models[chosen].direct) {
        why_none =
            doubt_about(fit, models[chosen], whole, values, halves[chosen], samples, request.towards.has_value());
        std::vector<double> turns;
        for (const LightValues& half : halves[chosen])
            turns.push_back(degrees_between(half.direct, values.direct));
        result.spread_deg = median(turns, 0.0);
        if (!why_none.empty()) {
            why_none = fmt::format("a direct light from {} is not believed: {}", text_of(values.direct.normalized()),
                                   why_none);
            chosen = 2; // its sum with ambient light; what remains is no light of one direction
            const auto [gain, error] = mean_gain(costs[2], costs[1]);
            if (gain <= std::max(error, 0.02 * result.models[1].held_out))
                chosen = 1;
            values = fit.fitted(whole, models[chosen], {}, request, true);
        }
    }
    // Errors of visibility and light that was not found make the photographs look as if they showed less of it.
    if (values.power >= least_power && values.power < 1 && fit.most_power(whole, values) >= 1) {
        LightTerms rest = models[chosen];
        rest.power = false;
        values.power = 1;
        values = fit.refined(whole, rest, values, request.towards.has_value());
    }
    result.chosen = models[chosen].name;
    Light& light = result.light;
    light.power = values.power;
    light.gradient = values.gradient;
    const std::string no_sign =
        light.power < least_power ? "; the colours show no sign of this AO, so unshaded leaves their ambient part" : "";
    const char* space = samples.in_world() ? "the recording's world" : "camera space";
    if (!models[chosen].direct) {
        result.sentence = fmt::format("light: all of it is ambient ({}); {} samples of {} frames{}", why_none,
                                      result.samples, result.frames, no_sign);
        return result;
    }
    light.direct = values.direct;
    light.shadows = models[chosen].shadows;
    for (Eigen::Index channel = 0; channel < 3; ++channel)
        light.tint[channel] = fit.tint(whole, values, channel);
    result.sentence =
        fmt::format("light: ambient, and {:.2f} times as much direct light from {} in {} ({:.0f} degrees between "
                    "halves); held-out error {:.3f}, {:.3f} without; {} samples of {} frames{}",
                    light.direct.norm(), text_of(light.direct.normalized()), space, result.spread_deg,
                    result.models[chosen].held_out, std::min(result.models[1].held_out, result.models[2].held_out),
                    result.samples, result.frames, no_sign);
    return result;
}

} // namespace scanshade
