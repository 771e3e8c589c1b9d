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
constexpr double most_turn_deg = 20;  // of a direct light between halves of the surfaces, in the median
constexpr double surely_explained =
    0.13; // of what ambient light leaves unexplained, by a direct light whose direction is sure
constexpr int fewest_samples = 500, fewest_albedos = 12, halvings = 3;
constexpr std::size_t most_of_search = 2500, most_of_half = 4000; // samples: more change no answer
constexpr double open = 0.8; // of visibility: it errs least, and counts least, where surfaces are open

// From the simplest on; those with direct light last.
constexpr std::array models{LightTerms{"albedo alone", false, false, false, false},
                            LightTerms{"ambient", true, false, false, false},
                            LightTerms{"ambient with a gradient", true, true, false, false},
                            LightTerms{"ambient with a gradient on two tones", true, true, false, true},
                            LightTerms{"ambient and direct", true, false, true, false},
                            LightTerms{"ambient with a gradient, and direct", true, true, true, false}};
constexpr std::size_t ambient_models = 3, tones_model = 3;

/// Half of the albedos, another half in each round; `first` or the others.
bool in_half(int albedo, int round, bool first) {
    return ((hash(static_cast<std::uint32_t>(albedo), static_cast<std::uint32_t>(round) + 101U) >> 16 & 1U) == 0) ==
           first;
}

/// What each albedo costs in each model, of those fitted to others; and how much it weighs.
struct HeldOut {
    std::vector<std::vector<double>> costs; ///< of each model
    std::vector<double> weights;

    HeldOut(std::size_t tried, int albedos)
        : costs(tried, std::vector<double>(static_cast<std::size_t>(albedos))),
          weights(static_cast<std::size_t>(albedos)) {}
    [[nodiscard]] double mean(std::size_t model) const {
        return std::inner_product(costs[model].begin(), costs[model].end(), weights.begin(), 0.0) / sum();
    }
    /// How much better one model is than another, and the standard error of that: albedos are what is independent,
    /// samples of one are not.
    [[nodiscard]] std::pair<double, double> gain(std::size_t model, std::size_t over) const {
        const double mean_gain = mean(over) - mean(model), all = sum();
        double squares = 0;
        for (std::size_t k = 0; k < weights.size(); ++k)
            squares += std::pow(weights[k] * (costs[over][k] - costs[model][k] - mean_gain), 2);
        return {mean_gain, std::sqrt(squares) / all};
    }
    [[nodiscard]] bool is_better(std::size_t model, std::size_t over, double errors) const {
        const auto [by, error] = gain(model, over);
        return by > std::max(errors * error, 0.02 * mean(over));
    }

  private:
    [[nodiscard]] double sum() const { return std::max(1.0, std::accumulate(weights.begin(), weights.end(), 0.0)); }
};

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

struct Judged {
    HeldOut all, opened;                          ///< on all samples, of ambient models; on open ones, of all models
    std::vector<std::vector<LightValues>> halves; ///< of each model, as fitted to open samples
};

/// Fits halves of the albedos and judges on the others: ambient light on all samples, direct light on open ones.
Judged judged_on_halves(const LightFit& fit, const LightRequest& request, int albedos) {
    const std::size_t tried = request.direct ? models.size() : ambient_models;
    Judged judged{{ambient_models, albedos}, {tried, albedos}, {}};
    judged.halves.assign(tried, std::vector<LightValues>(2 * halvings));
    struct Scores {
        LightPart unseen;
        std::vector<std::vector<double>> costs;
    };
    std::vector<std::pair<Scores, Scores>> scores(2 * halvings); // on all samples and on open ones
    tbb::parallel_for(std::size_t{0}, std::size_t{2 * halvings}, [&](std::size_t half) {
        const int round = static_cast<int>(half / 2);
        const bool first = half % 2 == 0;
        const auto mine = [&](int albedo) { return in_half(albedo, round, first); };
        const auto others = [&](int albedo) { return in_half(albedo, round, !first); };
        for (const bool is_open : {false, true}) {
            if (is_open && !request.direct)
                continue;
            const double least = is_open ? open : 0;
            LightPart seen = fit.part_of(mine, least, most_of_half);
            Scores& score = is_open ? scores[half].second : scores[half].first;
            score.unseen = fit.part_of(others, least);
            std::vector<LightStart> starts;
            if (is_open)
                starts = fit.starts(fit.part_of(mine, least, most_of_search), request, false);
            for (std::size_t model = 0; model < (is_open ? tried : ambient_models); ++model) {
                const LightValues values = fit.fitted(seen, models[model], starts, request, false);
                if (is_open)
                    judged.halves[model][half] = values;
                std::fill(score.unseen.lit.begin(), score.unseen.lit.end(), 1);
                score.unseen.centres.clear();
                if (models[model].direct || models[model].tones)
                    fit.guess_shadows(score.unseen, values);
                score.costs.push_back(fit.costs(score.unseen, values));
            }
        }
    });
    const auto take = [&](HeldOut& into, const Scores& from) {
        std::size_t begin = 0;
        for (std::size_t k = 0; k < from.unseen.ends.size(); ++k) {
            const auto albedo = static_cast<std::size_t>(fit.sample(from.unseen.samples[begin]).albedo);
            for (std::size_t model = 0; model < from.costs.size(); ++model)
                into.costs[model][albedo] += from.costs[model][k] / halvings;
            into.weights[albedo] = static_cast<double>(from.unseen.ends[k] - begin);
            begin = from.unseen.ends[k];
        }
    };
    for (const auto& [of_all, of_open] : scores) {
        take(judged.all, of_all);
        take(judged.opened, of_open);
    }
    return judged;
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
    LightPart open_part = fit.part_of(every, open);
    fit.take_price(fit.cost(open_part, fit.fitted(open_part, models[2], {}, {}, false)));
    const bool tells = open_part.samples.size() >= fewest_samples && open_part.ends.size() >= fewest_albedos;

    const std::size_t tried = request.direct ? models.size() : ambient_models;
    const Judged judged = judged_on_halves(fit, request, samples.albedos());
    const HeldOut &all = judged.all, &opened = judged.opened;
    std::size_t ambient = 0;
    for (std::size_t model = 1; model < ambient_models; ++model)
        if (all.is_better(model, ambient, 1))
            ambient = model;
    std::size_t chosen = ambient;
    std::string why_none = !request.direct ? "as asked"
                           : tells         ? "no direct light explains unseen surfaces better"
                                           : "too few open surfaces tell of direct light";
    if (request.direct && tells) {
        std::size_t rival = 1;
        for (const std::size_t model : {std::size_t{2}, tones_model})
            if (opened.mean(model) < opened.mean(rival))
                rival = model;
        std::size_t best = tones_model + 1;
        if (opened.is_better(best + 1, best, 1))
            ++best;
        if (opened.is_better(best, rival, 1))
            chosen = best;
    }
    for (std::size_t model = 0; model < tried; ++model)
        result.models.push_back({models[model].name, request.direct ? opened.mean(model) : all.mean(model)});
    LightPart part = models[chosen].direct ? fit.part_of(every, open) : whole;
    std::vector<LightStart> starts;
    if (models[chosen].direct)
        starts = fit.starts(fit.part_of(every, open, most_of_search), request, true);
    LightValues values = fit.fitted(part, models[chosen], starts, request, true);
    if (models[chosen].direct) {
        std::string doubt =
            doubt_about(fit, models[chosen], part, values, judged.halves[chosen], samples, request.towards.has_value());
        std::vector<double> turns;
        for (const LightValues& half : judged.halves[chosen])
            turns.push_back(degrees_between(half.direct, values.direct));
        result.spread_deg = median(turns, 0.0);
        if (doubt.empty() && result.spread_deg > most_turn_deg)
            doubt = fmt::format("halves of the surfaces have it {:.0f} degrees apart", result.spread_deg);
        if (!doubt.empty()) {
            why_none =
                fmt::format("a direct light from {} is not believed: {}", text_of(values.direct.normalized()), doubt);
            chosen = ambient; // its sum with ambient light; what remains is no light of one direction
            part = whole;
            values = fit.fitted(part, models[chosen], {}, request, true);
        }
    }
    if (models[chosen].direct) { // open surfaces tell little of the power
        part = whole;
        fit.guess_shadows(part, values);
        values = fit.refined(part, models[1], values, request.towards.has_value());
    }
    // Errors of visibility and light that was not found make the photographs look as if they showed less of it.
    if (values.power >= least_power && values.power < 1 && fit.most_power(part, values) >= 1) {
        values.power = 1;
        if (!models[chosen].direct) {
            LightTerms rest = models[chosen];
            rest.power = false;
            values = fit.refined(part, rest, values);
        }
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
    if (const double explained = opened.gain(chosen, 1).first / opened.mean(1);
        !request.towards && explained < surely_explained)
        light.doubt =
            fmt::format("the direct light's direction is not sure: it explains {:.0f} % of what ambient light "
                        "leaves of the colours. Lights that were 20 degrees off and more did so on generated "
                        "scenes; --light none or X,Y,Z overrides",
                        100 * explained);
    // Whether depth images know its shadows: what they never saw casts none there, and walls that it shines through do.
    LightPart open_to_it = fit.part_of(every, open, most_of_search);
    const double without = fit.cost(open_to_it, values);
    fit.cast_shadows(open_to_it, values.direct);
    light.shadows = fit.cost(open_to_it, values) < without;
    for (Eigen::Index channel = 0; channel < 3; ++channel)
        light.tint[channel] = fit.tint(part, values, channel);
    result.sentence =
        fmt::format("light: ambient, and {:.2f} times as much direct light from {} in {} ({:.0f} degrees between "
                    "halves); held-out error {:.3f}, {:.3f} without; {} samples of {} frames{}{}",
                    light.direct.norm(), text_of(light.direct.normalized()), space, result.spread_deg,
                    result.models[chosen].held_out,
                    std::min({result.models[1].held_out, result.models[2].held_out, result.models[3].held_out}),
                    result.samples, result.frames, no_sign, light.doubt.empty() ? "" : "; its direction is not sure");
    return result;
}

} // namespace scanshade
