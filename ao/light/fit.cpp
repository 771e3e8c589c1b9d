// Albedos are eliminated: for given light each is the robust centre of its samples, so that a solver sees seven numbers
// at most (variable projection, Golub and Pereyra 1973; slopes as Kaufman 1975 has them).
#include "ao/light/fit.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace scanshade {

using Eigen::Vector3d;

namespace {

constexpr double most_residual = 0.35; // beyond it a sample is of another albedo, or a highlight
constexpr double cauchy = 0.1;         // of log residuals: an albedo's own texture

/// The smaller of |r| and most_residual.
double limited(double r) { return std::min(std::abs(r), most_residual); }

/// x where it is positive, else 0; smooth, since where direct light ends there would be no slope to follow.
double smoothly_positive(double x) { return (x + std::sqrt(x * x + 1e-6)) * 0.5; }
double slope_of_smoothly_positive(double x) { return (1 + x / std::sqrt(x * x + 1e-6)) * 0.5; }

/// Light on a sample, its logarithm, and that logarithm's slopes.
struct Lighting {
    double ambient, all;
    Vector3d by_direct, by_gradient;
    double by_power;
};

Lighting lighting(const LightSample& sample, double log_visibility, const LightValues& values, double lit) {
    const double along = values.gradient.dot(sample.normal) + 1 - 0.05, towards = values.direct.dot(sample.normal);
    const double open = std::exp(values.power * log_visibility), seen = smoothly_positive(along) + 0.05;
    Lighting light{};
    light.ambient = open * seen;
    light.all = light.ambient + lit * smoothly_positive(towards); // without a tone, which changes no slope
    light.by_direct = lit * slope_of_smoothly_positive(towards) / light.all * sample.normal;
    light.by_gradient = open * slope_of_smoothly_positive(along) / light.all * sample.normal;
    light.by_power = light.ambient * log_visibility / light.all;
    return light;
}

double log_light(const LightSample& sample, double log_visibility, const LightValues& values, double lit) {
    const double along = values.gradient.dot(sample.normal) + 1 - 0.05;
    const double light = std::exp(values.power * log_visibility) * (smoothly_positive(along) + 0.05) +
                         lit * smoothly_positive(values.direct.dot(sample.normal));
    return std::log(light * (lit > 0 ? values.tones : 1));
}

/// Whether light on a sample depends on its being lit.
bool may_be_unlit(const LightSample& sample, const LightValues& values) {
    const double strength = values.direct.norm();
    return values.tones > 1 || (strength > 0 && sample.normal.dot(values.direct) > light_facing * strength);
}

/// Log residuals of the samples of one albedo, if they are lit and if not.
struct Choice {
    double lit, unlit;
    bool free; ///< else it is lit
};

/// The centre that leaves least of them, and what it leaves. An albedo half in the shadow has no median to go by.
std::pair<double, double> best_centre(std::span<const Choice> choices, double price) {
    constexpr int tried = 8; // of each kind
    std::vector<double> lit, unlit;
    for (const Choice& each : choices) {
        lit.push_back(each.lit);
        if (each.free)
            unlit.push_back(each.unlit);
    }
    std::pair<double, double> best{0, std::numeric_limits<double>::infinity()};
    for (std::vector<double>* values : {&lit, &unlit}) {
        std::ranges::sort(*values);
        for (std::size_t k = 0; k < tried && !values->empty(); ++k) {
            const double centre = (*values)[(2 * k + 1) * values->size() / (2 * tried)];
            double sum = 0;
            for (const Choice& each : choices) {
                const double as_lit = limited(each.lit - centre);
                sum += each.free ? std::min(as_lit, limited(each.unlit - centre) + price) : as_lit;
            }
            if (sum < best.second)
                best = {centre, sum};
        }
    }
    return best;
}

/// The upper median; the order of `values` is changed.
double median_of(std::span<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Takes each albedo's median from its values.
void subtract_medians(const LightPart& part, std::vector<double>& values) {
    std::vector<double> scratch;
    std::size_t from = 0;
    for (const std::size_t end : part.ends) {
        scratch.assign(values.begin() + static_cast<std::ptrdiff_t>(from),
                       values.begin() + static_cast<std::ptrdiff_t>(end));
        const double middle = median_of(scratch);
        for (; from < end; ++from)
            values[from] -= middle;
    }
}

/// Strengths to try of a light from one direction.
std::vector<double> strengths(bool fixed_direction) {
    if (!fixed_direction)
        return {0.3, 0.8, 2.0, 4.0};
    std::vector<double> all;
    for (double strength = 0.05; strength < 12; strength *= 1.15)
        all.push_back(strength);
    return all;
}

/// From all round: a Fibonacci sphere.
std::vector<Vector3d> directions(int count) {
    std::vector<Vector3d> all;
    for (int i = 0; i < count; ++i) {
        const double z = 1 - (2 * i + 1.0) / count, angle = i * std::numbers::pi * (3 - std::sqrt(5.0));
        const double across = std::sqrt(1 - z * z);
        all.emplace_back(across * std::cos(angle), across * std::sin(angle), z);
    }
    return all;
}

/// Which of the seven numbers a solver may change, and where they lie between.
struct Unknowns {
    std::vector<int> which; ///< 0 .. 2 direct, 3 .. 5 gradient, 6 power

    Unknowns(const LightTerms& terms, bool fixed_direction) {
        for (int i = 0; i < 7; ++i)
            if (i < 3 ? terms.direct && !fixed_direction : i < 6 ? terms.gradient : terms.power)
                which.push_back(i);
    }
    static double& number(LightValues& values, int i) {
        return i < 3 ? values.direct[i] : i < 6 ? values.gradient[i - 3] : values.power;
    }
    static double slope(const Lighting& light, int i) {
        return i < 3 ? light.by_direct[i] : i < 6 ? light.by_gradient[i - 3] : light.by_power;
    }
    static std::pair<double, double> limits(int i) {
        return i < 3 ? std::pair(-20.0, 20.0) : i < 6 ? std::pair(-0.9, 0.9) : std::pair(0.0, 2.0);
    }
};

} // namespace

/// All log residuals r of a part for Ceres, as roots of their Cauchy losses c^2 log(1 + r^2 / c^2): their squares' sum
/// is the robust cost.
class LightMisfit final : public ceres::CostFunction {
  public:
    LightMisfit(const LightFit& fit, const LightPart& part, const Unknowns& unknowns, const LightValues& base)
        : fit_(fit), part_(part), unknowns_(unknowns), base_(base), observed_(fit.observed(part)) {
        set_num_residuals(static_cast<int>(part.samples.size()));
        mutable_parameter_block_sizes()->push_back(static_cast<int>(unknowns.which.size()));
    }

    bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
        LightValues values = base_;
        const std::size_t count = unknowns_.which.size();
        for (std::size_t k = 0; k < count; ++k)
            Unknowns::number(values, unknowns_.which[k]) = parameters[0][k];
        double* slopes = jacobians != nullptr ? jacobians[0] : nullptr;
        std::vector<double> scratch;
        std::size_t from = 0;
        for (const std::size_t end : part_.ends) {
            for (std::size_t i = from; i < end; ++i) {
                const std::size_t number = part_.samples[i];
                const LightSample& sample = fit_.all_[number];
                const double log_visibility = fit_.log_visibility_[number], lit = part_.lit[i];
                if (slopes == nullptr) {
                    residuals[i] = observed_[i] - log_light(sample, log_visibility, values, lit);
                    continue;
                }
                const Lighting light = lighting(sample, log_visibility, values, lit);
                residuals[i] = observed_[i] - std::log(light.all * (lit > 0 ? values.tones : 1));
                for (std::size_t k = 0; k < count; ++k)
                    slopes[i * count + k] = -Unknowns::slope(light, unknowns_.which[k]);
            }
            without_albedo(residuals + from, slopes != nullptr ? slopes + from * count : nullptr, end - from, scratch);
            from = end;
        }
        return true;
    }

  private:
    static double weight(double r) { return 1 / (1 + r * r / (cauchy * cauchy)); }

    /// Takes the albedo from log values and the mean slope from their slopes, then the loss's root of both.
    void without_albedo(double* values, double* slopes, std::size_t size, std::vector<double>& scratch) const {
        scratch.assign(values, values + size);
        double centre = median_of(scratch);
        double weights = 0;
        for (int round = 0; round < 4; ++round) { // to the cost's least; half a digit each
            double sum = 0;
            weights = 0;
            for (std::size_t i = 0; i < size; ++i) {
                const double w = weight(values[i] - centre);
                sum += w * values[i];
                weights += w;
            }
            centre = sum / weights;
        }
        const std::size_t count = unknowns_.which.size();
        for (std::size_t k = 0; k < count && slopes != nullptr; ++k) {
            double mean = 0;
            for (std::size_t i = 0; i < size; ++i)
                mean += weight(values[i] - centre) * slopes[i * count + k];
            mean /= weights;
            for (std::size_t i = 0; i < size; ++i)
                slopes[i * count + k] -= mean;
        }
        for (std::size_t i = 0; i < size; ++i) {
            const double r = values[i] - centre;
            const double root = cauchy * std::sqrt(std::log1p(r * r / (cauchy * cauchy)));
            const double turned = std::abs(r) > 1e-9 ? weight(r) * std::abs(r) / root : 1;
            values[i] = std::copysign(root, r);
            for (std::size_t k = 0; k < count && slopes != nullptr; ++k)
                slopes[i * count + k] *= turned;
        }
    }

    const LightFit& fit_;
    const LightPart& part_;
    const Unknowns& unknowns_;
    const LightValues& base_;
    std::vector<double> observed_;
};

LightFit::LightFit(const LightSamples& samples) : samples_(samples), all_(samples.all()), gains_(samples.frames(), 0) {
    for (std::size_t i = 0; i < all_.size(); ++i) {
        const Vector3d& c = all_[i].colour;
        log_luminance_.push_back(std::log(0.2126 * c.x() + 0.7152 * c.y() + 0.0722 * c.z()));
        log_visibility_.push_back(std::log(all_[i].visibility));
        if (all_[i].albedo >= 0)
            by_albedo_.push_back(i);
    }
    std::ranges::stable_sort(by_albedo_, {}, [&](std::size_t i) { return all_[i].albedo; });
}

LightPart LightFit::part_of(const std::function<bool(int albedo)>& wanted, double open, std::size_t most) const {
    constexpr std::size_t fewest = 3, fewest_open = 8;
    std::vector<std::size_t> here;
    for (const std::size_t i : by_albedo_)
        if (all_[i].visibility >= open && wanted(all_[i].albedo))
            here.push_back(i);
    const auto end_of = [&](std::size_t from) { // of the samples of one albedo
        std::size_t end = from;
        while (end < here.size() && all_[here[end]].albedo == all_[here[from]].albedo)
            ++end;
        return end;
    };
    const std::size_t there = here.size();
    const double share =
        std::min(1.0, static_cast<double>(most) / static_cast<double>(std::max<std::size_t>(there, 1)));
    LightPart part;
    for (std::size_t from = 0, end = 0; from < here.size(); from = end) {
        end = end_of(from);
        const std::size_t size = end - from;
        if (open > 0 && size < fewest_open)
            continue;
        const auto taken = std::clamp(static_cast<std::size_t>(std::ceil(share * static_cast<double>(size))),
                                      std::min(size, fewest), size);
        for (std::size_t i = 0; i < taken; ++i)
            part.samples.push_back(here[from + i * size / taken]);
        part.ends.push_back(part.samples.size());
    }
    part.lit.assign(part.samples.size(), 1);
    return part;
}

std::vector<double> LightFit::observed(const LightPart& part) const {
    std::vector<double> values(part.samples.size());
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = log_luminance_[part.samples[i]] - log_gain(all_[part.samples[i]]);
    return values;
}

std::vector<double> LightFit::residuals(const LightPart& part, const LightValues& values) const {
    std::vector<double> r = observed(part);
    for (std::size_t i = 0; i < r.size(); ++i)
        r[i] -= log_light(all_[part.samples[i]], log_visibility_[part.samples[i]], values, part.lit[i]);
    if (part.centres.empty())
        subtract_medians(part, r);
    std::size_t from = 0;
    for (std::size_t k = 0; k < part.centres.size(); ++k)
        for (; from < part.ends[k]; ++from)
            r[from] -= part.centres[k];
    return r;
}

std::vector<double> LightFit::costs(const LightPart& part, const LightValues& values) const {
    const std::vector<double> r = residuals(part, values);
    std::vector<double> all;
    std::size_t from = 0;
    for (const std::size_t end : part.ends) {
        const auto size = static_cast<double>(end - from);
        double sum = 0;
        for (; from < end; ++from)
            sum += limited(r[from]) + (part.lit[from] > 0 || part.centres.empty() ? 0 : price_);
        all.push_back(sum / size);
    }
    return all;
}

double LightFit::cost(const LightPart& part, const LightValues& values) const {
    const std::vector<double> each = costs(part, values);
    double sum = 0;
    for (std::size_t k = 0; k < each.size(); ++k)
        sum += each[k] * static_cast<double>(part.ends[k] - (k > 0 ? part.ends[k - 1] : 0));
    return sum / static_cast<double>(std::max<std::size_t>(part.samples.size(), 1));
}

void LightFit::guess_shadows(LightPart& part, const LightValues& values) const {
    const std::vector<double> known = observed(part);
    part.centres.clear();
    std::vector<Choice> choices;
    std::size_t from = 0;
    for (const std::size_t end : part.ends) {
        choices.clear();
        for (std::size_t i = from; i < end; ++i) {
            const LightSample& sample = all_[part.samples[i]];
            const double log_visibility = log_visibility_[part.samples[i]];
            choices.push_back({known[i] - log_light(sample, log_visibility, values, 1),
                               known[i] - log_light(sample, log_visibility, values, 0), may_be_unlit(sample, values)});
        }
        const double centre = best_centre(choices, price_).first;
        part.centres.push_back(centre);
        for (std::size_t i = from; i < end; ++i) {
            const Choice& each = choices[i - from];
            part.lit[i] = each.free && limited(each.unlit - centre) + price_ < limited(each.lit - centre) ? 0 : 1;
        }
        from = end;
    }
}

void LightFit::cast_shadows(LightPart& part, const Vector3d& direct) const {
    for (std::size_t i = 0; i < part.samples.size(); ++i) {
        const LightSample& sample = all_[part.samples[i]];
        part.lit[i] = direct.norm() > 0 && sample.normal.dot(direct) > 0 ? samples_.lit(sample, direct) : 1;
    }
}

std::vector<LightStart> LightFit::starts(const LightPart& part, const LightRequest& request, bool thorough) const {
    const bool fixed = request.towards.has_value();
    const std::vector<Vector3d> from =
        fixed ? std::vector{request.towards->normalized()} : directions(thorough ? 160 : 80);
    const std::vector<double> known = observed(part), tried = strengths(fixed);
    std::vector<LightStart> all;
    std::vector<double> facing(known.size());
    std::vector<Choice> choices(known.size());
    for (const Vector3d& direction : from) {
        for (std::size_t i = 0; i < known.size(); ++i)
            facing[i] = std::max(0.0, direction.dot(all_[part.samples[i]].normal));
        for (const double strength : tried) {
            for (std::size_t i = 0; i < known.size(); ++i) {
                const LightSample& sample = all_[part.samples[i]];
                choices[i] = {known[i] - std::log(sample.visibility + strength * facing[i]),
                              known[i] - log_visibility_[part.samples[i]], facing[i] > light_facing};
            }
            double sum = 0;
            std::size_t first = 0;
            for (const std::size_t end : part.ends) {
                sum += best_centre(std::span(choices).subspan(first, end - first), price_).second;
                first = end;
            }
            all.push_back({{strength * direction, Vector3d::Zero(), 1},
                           sum / static_cast<double>(std::max<std::size_t>(known.size(), 1))});
        }
    }
    return all;
}

LightValues LightFit::fitted(LightPart& part, const LightTerms& terms, const std::vector<LightStart>& starts,
                             const LightRequest& request, bool thorough) const {
    std::fill(part.lit.begin(), part.lit.end(), 1);
    part.centres.clear();
    LightValues ambient;
    ambient.power = terms.power ? 1 : 0;
    std::vector<LightValues> from;
    if (terms.direct) {
        std::vector<LightStart> found = starts;
        std::ranges::stable_sort(found, {}, &LightStart::cost);
        for (const LightStart& start : found) // false minima are many, and their costs alike
            if (from.size() < (thorough ? 6U : 3U) && std::ranges::none_of(from, [&](const LightValues& other) {
                    return (other.direct - start.values.direct).norm() < 0.35 * start.values.direct.norm();
                }))
                from.push_back(start.values);
    } else if (terms.tones) {
        for (const double tones : {1.2, 1.5, 2.0, 3.0, 5.0}) {
            from.push_back(ambient);
            from.back().tones = tones;
        }
    } else {
        return refined(part, terms, ambient);
    }
    std::pair<double, LightValues> best{std::numeric_limits<double>::infinity(), ambient};
    LightPart best_part = part;
    for (LightValues each : from) {
        for (int round = 0; round < 3; ++round) {
            guess_shadows(part, each);
            each = refined(part, terms, each, request.towards.has_value());
        }
        guess_shadows(part, each);
        if (const double now = cost(part, each); now < best.first) {
            best = {now, each};
            best_part = part;
        }
    }
    part = best_part;
    return best.second;
}

LightValues LightFit::refined(const LightPart& part, const LightTerms& terms, const LightValues& from,
                              bool fixed_direction) const {
    const Unknowns unknowns(terms, fixed_direction);
    if (unknowns.which.empty() || part.samples.empty())
        return from;
    LightValues values = from;
    std::vector<double> numbers;
    for (const int i : unknowns.which)
        numbers.push_back(Unknowns::number(values, i));
    ceres::Problem problem;
    problem.AddResidualBlock(new LightMisfit(*this, part, unknowns, from), nullptr, numbers.data());
    for (std::size_t k = 0; k < numbers.size(); ++k) {
        const auto [least, most] = Unknowns::limits(unknowns.which[k]);
        numbers[k] = std::clamp(numbers[k], least, most);
        problem.SetParameterLowerBound(numbers.data(), static_cast<int>(k), least);
        problem.SetParameterUpperBound(numbers.data(), static_cast<int>(k), most);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY; // thousands of rows, seven columns
    options.max_num_iterations = 30;
    options.function_tolerance = 1e-5;
    options.num_threads = 1; // sums in one order: the same bytes every time
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    for (std::size_t k = 0; k < numbers.size(); ++k)
        Unknowns::number(values, unknowns.which[k]) = numbers[k];
    return values;
}

void LightFit::take_gains(const LightPart& part, const LightValues& values) {
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

void LightFit::take_price(double usual) { price_ = std::max(price_, 1.5 * usual); }

double LightFit::most_power(const LightPart& part, const LightValues& values) const {
    const std::vector<double> r = residuals(part, values);
    double squares = 0, products = 0; // of colours, and of both
    std::size_t from = 0;
    for (const std::size_t end : part.ends) {
        std::vector<Eigen::Vector2d> pairs; // the power's slope, and log colours without all other light
        for (; from < end; ++from)
            if (std::abs(r[from]) < most_residual) {
                const std::size_t number = part.samples[from];
                const double slope = lighting(all_[number], log_visibility_[number], values, part.lit[from]).by_power;
                pairs.emplace_back(slope, values.power * slope + r[from]);
            }
        Eigen::Vector2d mean = Eigen::Vector2d::Zero();
        for (const Eigen::Vector2d& pair : pairs)
            mean += pair / static_cast<double>(pairs.size());
        for (const Eigen::Vector2d& pair : pairs) {
            squares += std::pow(pair[1] - mean[1], 2);
            products += (pair[0] - mean[0]) * (pair[1] - mean[1]);
        }
    }
    return products > 0 ? squares / products : std::numeric_limits<double>::infinity();
}

double LightFit::tint(const LightPart& part, const LightValues& values, Eigen::Index channel) const {
    const auto cost_of = [&](double tint) {
        LightValues tinted = values;
        tinted.direct *= tint;
        std::vector<double> r(part.samples.size());
        for (std::size_t i = 0; i < r.size(); ++i) {
            const LightSample& sample = all_[part.samples[i]];
            r[i] = std::log(sample.colour[channel]) - log_gain(sample) -
                   log_light(sample, log_visibility_[part.samples[i]], tinted, part.lit[i]);
        }
        subtract_medians(part, r);
        return std::accumulate(r.begin(), r.end(), 0.0, [](double sum, double each) { return sum + limited(each); });
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

} // namespace scanshade
