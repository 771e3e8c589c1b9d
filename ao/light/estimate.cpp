// Fits models of light to samples, and keeps the simplest one that explains unseen albedos as well as any.
#include "ao/light/light.h"

#include "projection/base/hash.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <ceres/ceres.h>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <numbers>
#include <numeric>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;

constexpr double most_residual = 0.35;   // beyond it a sample is of another albedo, or a highlight
constexpr double cauchy = 0.1;           // of log residuals: an albedo's own texture
constexpr double price_of_shadow = 0.08; // a shadow that is only guessed has to explain that much
constexpr double facing_light = 0.1;     // direct light on less than this could be anything
constexpr int fewest_samples = 500, fewest_albedos = 12, halvings = 5;

/// What a model may use.
struct Terms {
    const char* name;
    bool power, gradient, direct, shadows;
};
// From the simplest on; those with direct light last.
constexpr std::array models{Terms{"albedo alone", false, false, false, false},
                            Terms{"ambient", true, false, false, false},
                            Terms{"ambient with a gradient", true, true, false, false},
                            Terms{"ambient and direct", true, false, true, false},
                            Terms{"ambient and direct with shadows", true, false, true, true},
                            Terms{"ambient with a gradient, and direct with shadows", true, true, true, true}};

struct Values {
    Vector3d direct = Vector3d::Zero(), gradient = Vector3d::Zero();
    double power = 0;
};

/// Numbers of samples, and which of these see the light.
struct Part {
    std::vector<std::size_t> samples;
    std::vector<double> lit; ///< 0 or 1, as `samples`
};

template <class Number>
Number smoothly_positive(const Number& x) { // where direct light ends there would be no slope to follow
    using std::sqrt;
    return (x + sqrt(x * x + Number(1e-6))) * Number(0.5);
}

/// The log of light on a sample.
template <class Number, class Vector>
Number log_light(const LightSample& sample, const Vector& direct, const Vector& gradient, const Number& power,
                 double lit) {
    using std::exp;
    using std::log;
    const Number along =
        gradient[0] * sample.normal.x() + gradient[1] * sample.normal.y() + gradient[2] * sample.normal.z() + Number(1);
    const Number towards =
        direct[0] * sample.normal.x() + direct[1] * sample.normal.y() + direct[2] * sample.normal.z();
    const Number ambient = exp(power * std::log(sample.visibility)) * (smoothly_positive(Number(along - 0.05)) + 0.05);
    return log(ambient + lit * smoothly_positive(towards));
}

/// One sample's, for Ceres.
struct Residual {
    const LightSample* sample;
    double observed, lit;
    template <class T>
    bool operator()(const T* direct, const T* gradient, const T* power, const T* of_albedo, T* residual) const {
        residual[0] = observed - of_albedo[0] - log_light(*sample, direct, gradient, power[0], lit);
        return true;
    }
};

class Fit {
  public:
    explicit Fit(const LightSamples& samples) : samples_(samples), all_(samples.all()), gains_(samples.frames(), 0) {
        for (const LightSample& sample : all_) {
            const Vector3d& c = sample.colour;
            log_luminance_.push_back(std::log(0.2126 * c.x() + 0.7152 * c.y() + 0.0722 * c.z()));
        }
    }

    [[nodiscard]] Part part_of(const std::function<bool(int albedo)>& wanted) const {
        Part part;
        for (std::size_t i = 0; i < all_.size(); ++i)
            if (all_[i].albedo >= 0 && wanted(all_[i].albedo))
                part.samples.push_back(i);
        part.lit.assign(part.samples.size(), 1);
        return part;
    }

    /// Log residuals, the albedos being the medians of their samples'.
    [[nodiscard]] std::vector<double> residuals(const Part& part, const Values& values) const {
        std::vector<double> r(part.samples.size());
        for (std::size_t i = 0; i < r.size(); ++i) {
            const LightSample& sample = all_[part.samples[i]];
            r[i] = log_luminance_[part.samples[i]] - gains_[static_cast<std::size_t>(sample.frame)] -
                   log_light(sample, values.direct, values.gradient, values.power, part.lit[i]);
        }
        const std::vector<double> albedo = medians(part, r);
        for (std::size_t i = 0; i < r.size(); ++i)
            r[i] -= albedo[static_cast<std::size_t>(all_[part.samples[i]].albedo)];
        return r;
    }

    [[nodiscard]] double cost(const Part& part, const Values& values) const {
        double sum = 0;
        for (const double r : residuals(part, values))
            sum += std::min(std::abs(r), most_residual);
        return sum / static_cast<double>(std::max<std::size_t>(part.samples.size(), 1));
    }

    /// The same where each sample that faces the light may be in shadow, at a price.
    [[nodiscard]] double cost_with_guessed_shadows(const Part& part, const Values& values) const {
        const std::vector<double> r = residuals(part, values);
        double sum = 0;
        for (std::size_t i = 0; i < r.size(); ++i) {
            const LightSample& sample = all_[part.samples[i]];
            double least = std::min(std::abs(r[i]), most_residual);
            if (sample.normal.dot(values.direct) > facing_light) {
                const double in_shadow = r[i] + log_light(sample, values.direct, values.gradient, values.power, 1) -
                                         log_light(sample, values.direct, values.gradient, values.power, 0);
                least = std::min(least, std::abs(in_shadow) + price_of_shadow);
            }
            sum += least;
        }
        return sum / static_cast<double>(std::max<std::size_t>(part.samples.size(), 1));
    }

    /// Asks the depth images what stands before the light.
    void cast_shadows(Part& part, const Vector3d& direct) const {
        for (std::size_t i = 0; i < part.samples.size(); ++i) {
            const LightSample& sample = all_[part.samples[i]];
            part.lit[i] = direct.norm() > 0 && sample.normal.dot(direct) > 0 ? samples_.lit(sample, direct) : 1;
        }
    }

    /// The best values of a model. `request` may fix the direction. `thorough` searches more densely.
    Values fitted(Part& part, const Terms& terms, const LightRequest& request, bool thorough) const {
        std::fill(part.lit.begin(), part.lit.end(), 1);
        Values start;
        if (terms.power) {
            start.power = 1;
            start = refined(part, {terms.name, true, terms.gradient, false, false}, start);
        }
        if (!terms.direct)
            return start;
        std::vector<std::pair<double, Values>> found;
        for (const Values& each : request.towards ? along(*request.towards) : starts(start, thorough))
            found.emplace_back(terms.shadows ? cost_with_guessed_shadows(part, each) : cost(part, each), each);
        std::ranges::stable_sort(found, {}, [](const auto& each) { return each.first; });
        std::vector<Values> distinct; // false minima are many, and their costs alike
        for (const auto& [cost, values] : found)
            if (distinct.size() < (thorough ? 6U : 3U) &&
                std::ranges::none_of(distinct, [&each = values](const Values& other) {
                    return (other.direct - each.direct).norm() < 0.35 * each.direct.norm();
                }))
                distinct.push_back(values);
        std::pair<double, Values> best{1e9, start};
        std::vector<double> lit_of_best = part.lit;
        for (Values each : distinct) {
            std::fill(part.lit.begin(), part.lit.end(), 1);
            for (int round = 0; round < (terms.shadows ? 3 : 1); ++round) {
                if (terms.shadows)
                    cast_shadows(part, each.direct);
                each = refined(part, terms, each, request.towards.has_value());
            }
            if (terms.shadows)
                cast_shadows(part, each.direct);
            if (const double now = cost(part, each); now < best.first) {
                best = {now, each};
                lit_of_best = part.lit;
            }
        }
        part.lit = lit_of_best;
        return best.second;
    }

    /// The medians of each frame's residuals under `values`: exposure and its automatic changes.
    void take_gains(const Part& part, const Values& values) {
        if (!samples_.in_world()) // every albedo is of one frame: nothing to compare
            return;
        for (int round = 0; round < 5; ++round) {
            const std::vector<double> r = residuals(part, values);
            std::vector<std::vector<double>> by_frame(gains_.size());
            for (std::size_t i = 0; i < r.size(); ++i)
                by_frame[static_cast<std::size_t>(all_[part.samples[i]].frame)].push_back(r[i]);
            for (std::size_t f = 0; f < gains_.size(); ++f)
                gains_[f] += median(by_frame[f], 0.0);
        }
        const double first = gains_.front();
        for (double& gain : gains_)
            gain -= first;
    }

    /// Of direct over ambient light in one channel (0 = red): what explains that channel best.
    [[nodiscard]] double tint(const Part& part, const Values& values, Eigen::Index channel) const {
        const auto cost_of = [&](double tint) {
            std::vector<double> r(part.samples.size());
            for (std::size_t i = 0; i < r.size(); ++i) {
                const LightSample& sample = all_[part.samples[i]];
                r[i] = std::log(sample.colour[channel]) - gains_[static_cast<std::size_t>(sample.frame)] -
                       log_light(sample, Vector3d(values.direct * tint), values.gradient, values.power, part.lit[i]);
            }
            const std::vector<double> albedo = medians(part, r);
            double sum = 0;
            for (std::size_t i = 0; i < r.size(); ++i)
                sum += std::min(std::abs(r[i] - albedo[static_cast<std::size_t>(all_[part.samples[i]].albedo)]),
                                most_residual);
            return sum;
        };
        double best = 1, least = cost_of(1);
        for (double step : {0.2, 0.05}) // in logarithms
            for (const double from = best; const int k : {-4, -3, -2, -1, 1, 2, 3, 4})
                if (const double tried = from * std::exp(step * k), now = cost_of(tried); now < least) {
                    best = tried;
                    least = now;
                }
        return best;
    }

    [[nodiscard]] const std::vector<LightSample>& all() const { return all_; }

  private:
    [[nodiscard]] std::vector<double> medians(const Part& part, const std::vector<double>& r) const {
        std::vector<std::vector<double>> of(static_cast<std::size_t>(samples_.albedos()));
        for (std::size_t i = 0; i < r.size(); ++i)
            of[static_cast<std::size_t>(all_[part.samples[i]].albedo)].push_back(r[i]);
        std::vector<double> found(of.size());
        for (std::size_t k = 0; k < of.size(); ++k)
            found[k] = of[k].empty() ? 0 : ranked(of[k], of[k].size() / 2);
        return found;
    }

    /// Light from all round (a Fibonacci sphere), of several strengths.
    static std::vector<Values> starts(const Values& from, bool thorough) {
        std::vector<Values> all;
        const int directions = thorough ? 160 : 80;
        for (int i = 0; i < directions; ++i) {
            const double z = 1 - (2 * i + 1.0) / directions, angle = i * std::numbers::pi * (3 - std::sqrt(5.0));
            const double across = std::sqrt(1 - z * z);
            for (const double strength : {0.3, 0.8, 2.0, 4.0}) {
                Values each = from;
                each.gradient.setZero(); // it would have taken the light's part
                each.power = 1;
                each.direct = strength * Vector3d(across * std::cos(angle), across * std::sin(angle), z);
                all.push_back(each);
            }
        }
        return all;
    }
    static std::vector<Values> along(const Vector3d& towards) {
        std::vector<Values> all;
        for (double strength = 0.05; strength < 12; strength *= 1.15) {
            Values each;
            each.power = 1;
            each.direct = strength * towards.normalized();
            all.push_back(each);
        }
        return all;
    }

    /// Least squares with a Cauchy loss from a start; the light's direction may be fixed.
    [[nodiscard]] Values refined(const Part& part, const Terms& terms, Values values, bool fixed = false) const {
        std::vector<double> albedo(static_cast<std::size_t>(samples_.albedos()), 0);
        { // from the medians
            std::vector<double> r(part.samples.size());
            for (std::size_t i = 0; i < r.size(); ++i) {
                const LightSample& sample = all_[part.samples[i]];
                r[i] = log_luminance_[part.samples[i]] - gains_[static_cast<std::size_t>(sample.frame)] -
                       log_light(sample, values.direct, values.gradient, values.power, part.lit[i]);
            }
            albedo = medians(part, r);
        }
        ceres::Problem problem;
        auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
        auto* loss = new ceres::CauchyLoss(cauchy); // the problem's own from here on
        for (std::size_t i = 0; i < part.samples.size(); ++i) {
            const LightSample& sample = all_[part.samples[i]];
            double* own = &albedo[static_cast<std::size_t>(sample.albedo)];
            const double observed = log_luminance_[part.samples[i]] - gains_[static_cast<std::size_t>(sample.frame)];
            problem.AddResidualBlock(
                new ceres::AutoDiffCostFunction<Residual, 1, 3, 3, 1, 1>(new Residual{&sample, observed, part.lit[i]}),
                loss, values.direct.data(), values.gradient.data(), &values.power, own);
            ordering->AddElementToGroup(own, 0);
        }
        for (double* block : {values.direct.data(), values.gradient.data(), &values.power})
            ordering->AddElementToGroup(block, 1);
        if (!terms.direct || fixed)
            problem.SetParameterBlockConstant(values.direct.data());
        if (!terms.gradient)
            problem.SetParameterBlockConstant(values.gradient.data());
        if (!terms.power)
            problem.SetParameterBlockConstant(&values.power);
        problem.SetParameterLowerBound(&values.power, 0, 0);
        problem.SetParameterUpperBound(&values.power, 0, 2);
        for (int axis = 0; axis < 3 && terms.gradient; ++axis) {
            problem.SetParameterLowerBound(values.gradient.data(), axis, -0.9);
            problem.SetParameterUpperBound(values.gradient.data(), axis, 0.9);
        }
        for (int axis = 0; axis < 3 && terms.direct && !fixed; ++axis) {
            problem.SetParameterLowerBound(values.direct.data(), axis, -20);
            problem.SetParameterUpperBound(values.direct.data(), axis, 20);
        }
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::DENSE_SCHUR;
        options.linear_solver_ordering = ordering;
        options.max_num_iterations = 30;
        options.function_tolerance = 1e-5;
        options.num_threads = 1; // sums in one order: the same bytes every time
        options.logging_type = ceres::SILENT;
        ceres::Solver::Summary summary;
        ceres::Solve(options, &problem, &summary);
        return values;
    }

    const LightSamples& samples_;
    const std::vector<LightSample>& all_;
    std::vector<double> log_luminance_, gains_;
};

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
std::string doubt_about(const Fit& fit, const Part& part, const Values& values, const std::vector<Values>& halves,
                        const LightSamples& samples, bool given) {
    double lit = 0, unlit = 0;
    for (std::size_t i = 0; i < part.samples.size(); ++i) {
        const double towards = fit.all()[part.samples[i]].normal.dot(values.direct);
        (towards > facing_light * values.direct.norm() && part.lit[i] > 0 ? lit : unlit) += 1;
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
        const double whole = std::max(0.0, fit.all()[i].normal.dot(values.direct));
        if (whole <= facing_light * values.direct.norm())
            continue;
        for (const Values& half : halves)
            apart.push_back(std::abs(std::max(0.0, fit.all()[i].normal.dot(half.direct)) - whole) / whole);
    }
    if (const double usual = median(apart, 0.0); usual > 0.25)
        return fmt::format("halves of the surfaces disagree about it by {:.0f} %", 100 * usual);
    if (!given && samples.frames() > 0 && degrees_between(values.direct, -samples.forward()) < 15)
        return "it comes from the camera, where everything seen is lit";
    return "";
}

} // namespace

LightEstimate estimate_light(const LightSamples& samples, const LightRequest& request) {
    LightEstimate result;
    result.frames = samples.frames();
    result.light.in_world = samples.in_world();
    Fit fit(samples);
    Part whole = fit.part_of([](int) { return true; });
    result.samples = whole.samples.size();
    result.albedos = samples.albedos();
    if (whole.samples.size() < fewest_samples || samples.albedos() < fewest_albedos) {
        result.sentence = fmt::format(
            "light: all of it is taken for ambient: {} samples of {} albedos tell too little (at least {} of {})",
            whole.samples.size(), samples.albedos(), fewest_samples, fewest_albedos);
        return result;
    }
    fit.take_gains(whole, fit.fitted(whole, models[2], {}, false));

    const std::size_t tried = request.direct ? models.size() : 3;
    std::vector<std::vector<double>> costs(tried, std::vector<double>(2 * halvings));
    std::vector<std::vector<Values>> halves(tried, std::vector<Values>(2 * halvings));
    tbb::parallel_for(std::size_t{0}, tried * 2 * halvings, [&](std::size_t job) {
        const std::size_t model = job / (2 * halvings), half = job % (2 * halvings);
        const int round = static_cast<int>(half / 2);
        const bool first = half % 2 == 0;
        Part seen = fit.part_of([&](int albedo) { return in_half(albedo, round, first); });
        Part unseen = fit.part_of([&](int albedo) { return in_half(albedo, round, !first); });
        const Values values = halves[model][half] = fit.fitted(seen, models[model], request, false);
        if (models[model].shadows)
            fit.cast_shadows(unseen, values.direct);
        costs[model][half] = fit.cost(unseen, values);
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
    Values values = fit.fitted(whole, models[chosen], request, true);
    if (models[chosen].direct) {
        why_none = doubt_about(fit, whole, values, halves[chosen], samples, request.towards.has_value());
        std::vector<double> turns;
        for (const Values& half : halves[chosen])
            turns.push_back(degrees_between(half.direct, values.direct));
        result.spread_deg = median(turns, 0.0);
        if (!why_none.empty()) {
            why_none = fmt::format("a direct light from {} is not believed: {}", text_of(values.direct.normalized()),
                                   why_none);
            chosen = 2; // its sum with ambient light; what remains is no light of one direction
            const auto [gain, error] = mean_gain(costs[2], costs[1]);
            if (gain <= std::max(error, 0.02 * result.models[1].held_out))
                chosen = 1;
            values = fit.fitted(whole, models[chosen], request, true);
        }
    }
    result.chosen = models[chosen].name;
    Light& light = result.light;
    light.power = values.power;
    light.gradient = values.gradient;
    const std::string no_sign =
        light.power < 0.1 ? "; the colours show no sign of this AO, so unshaded leaves their ambient part" : "";
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
