// Fits one model of light to samples whose albedos are unknown, too.
#pragma once

#include "ao/light/light.h"

#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <vector>

namespace scanshade {

/// What a model may use. `tones`: every albedo may come in two, the brighter so many times the other; which of them a
/// sample shows is guessed from its colour, as shadows of a direct light are. A direct light that explains no more than
/// these is paint.
struct LightTerms {
    const char* name;
    bool power, gradient, direct, tones;
};

struct LightValues {
    Eigen::Vector3d direct = Eigen::Vector3d::Zero(), gradient = Eigen::Vector3d::Zero();
    double power = 0;
    double tones = 1; ///< how many times the brighter of two tones is the other; 1 = there is one
};

/// Samples, those of one albedo side by side, and which of them see the light.
struct LightPart {
    std::vector<std::size_t> samples; ///< numbers of LightSamples::all()
    std::vector<std::size_t> ends;    ///< of each albedo's, in `samples`
    std::vector<double> lit;          ///< 0 or 1, as `samples`: reached by direct light, or of the brighter tone
    std::vector<double> centres;      ///< of the log residuals of each albedo, as `ends`; empty = their medians
};

/// A direct light to start from, and how well it explains a part as it is.
struct LightStart {
    LightValues values;
    double cost;
};

constexpr double light_facing = 0.1; ///< direct light on less than this could be anything

/// Thread-safe but for take_gains().
class LightFit {
  public:
    explicit LightFit(const LightSamples& samples);

    /// Samples of some albedos; of each albedo its share of `most`, evenly spread, and three at least.
    /// Only those with a visibility of `open` or more; albedos with fewer than eight are left out.
    [[nodiscard]] LightPart part_of(const std::function<bool(int albedo)>& wanted, double open = 0,
                                    std::size_t most = std::numeric_limits<std::size_t>::max()) const;
    /// Log residuals, as part.samples; the albedos are the medians of their samples'.
    [[nodiscard]] std::vector<double> residuals(const LightPart& part, const LightValues& values) const;
    /// The mean of min(|log residual|, 0.35) of each albedo, where guessed shadows have their price.
    [[nodiscard]] std::vector<double> costs(const LightPart& part, const LightValues& values) const;
    /// The same of all samples.
    [[nodiscard]] double cost(const LightPart& part, const LightValues& values) const;
    /// Guesses from colours which samples lie in the shadow of the direct light, or show the darker tone.
    void guess_shadows(LightPart& part, const LightValues& values) const;
    /// Asks the depth images what stands before the light.
    void cast_shadows(LightPart& part, const Eigen::Vector3d& direct) const;

    /// Lights from all round, or from where `request` says, of several strengths.
    [[nodiscard]] std::vector<LightStart> starts(const LightPart& part, const LightRequest& request,
                                                 bool thorough) const;
    /// The best values of a model; for one with direct light, from the best of `starts`. Sets part.lit. `request` may
    /// fix the direction. `thorough` tries more of them.
    [[nodiscard]] LightValues fitted(LightPart& part, const LightTerms& terms, const std::vector<LightStart>& starts,
                                     const LightRequest& request, bool thorough) const;
    /// Least squares with a Cauchy loss.
    [[nodiscard]] LightValues refined(const LightPart& part, const LightTerms& terms, const LightValues& from,
                                      bool fixed_direction = false) const;

    /// The medians of each frame's residuals under `values`: exposure and its automatic changes.
    void take_gains(const LightPart& part, const LightValues& values);
    /// What a shadow that is only guessed has to explain: more than the usual residual.
    void take_price(double usual);
    /// Of direct over ambient light in one channel (0 = red): what explains that channel best.
    [[nodiscard]] double tint(const LightPart& part, const LightValues& values, Eigen::Index channel) const;

    /// The power that regression of visibility on colours gives, all else as in `values`; infinite where they do not
    /// vary together. Errors of visibility lower the power that is fitted, texture raises this one: the true one lies
    /// between them (Frisch 1934).
    [[nodiscard]] double most_power(const LightPart& part, const LightValues& values) const;

    [[nodiscard]] const LightSample& sample(std::size_t number) const { return all_[number]; }

  private:
    friend class LightMisfit;
    [[nodiscard]] double log_gain(const LightSample& sample) const {
        return gains_[static_cast<std::size_t>(sample.frame)];
    }
    /// Log luminances without their frames' gains, as part.samples.
    [[nodiscard]] std::vector<double> observed(const LightPart& part) const;

    double price_ = 0.08;
    const LightSamples& samples_;
    const std::vector<LightSample>& all_;
    std::vector<std::size_t> by_albedo_; ///< of all samples with an albedo
    std::vector<double> log_luminance_, log_visibility_, gains_;
};

} // namespace scanshade
