#include "projection/sensor/depth_steps.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <Eigen/Core>
#include <iterator>

namespace scanshade {
namespace {

/// The step, if steps grow with that power of z, and the share of the gaps between distinct values that equal it.
struct Step {
    double size = 0, share = 0;
};
Step step_by(const std::vector<float>& values_m, int power) {
    std::vector<double> gaps;
    for (std::size_t i = 1; i < values_m.size(); ++i)
        gaps.push_back((static_cast<double>(values_m[i]) - values_m[i - 1]) / std::pow(values_m[i], power));
    if (gaps.size() < 50)
        return {}; // a disparity sensor has some hundred values in all
    const double low = ranked(gaps, gaps.size() / 10);
    double sum = 0, count = 0;
    for (const double gap : gaps)
        if (gap > 0.75 * low && gap < 1.35 * low)
            sum += gap, ++count;
    return {sum / count, count / static_cast<double>(gaps.size())};
}

/// Whether all values are those of 16-bit floats, as OpenEXR files hold them, and use their last digit from one power
/// of two to the next: whole 256ths of a metre are such floats, too.
bool are_halves(const std::vector<float>& values_m) {
    constexpr std::ptrdiff_t enough_values = 100, enough_in_octave = 20;
    if (std::ssize(values_m) < enough_values)
        return false;
    for (auto first = values_m.begin(); first != values_m.end();) {
        const int octave = std::ilogb(*first);
        const auto end = std::find_if(first, values_m.end(), [&](float value) { return std::ilogb(value) != octave; });
        std::ptrdiff_t odd = 0;
        for (auto each = first; each != end; ++each) {
            const auto half = static_cast<Eigen::half>(*each);
            if (static_cast<float>(half) != *each)
                return false;
            odd += half.x & 1;
        }
        if (end - first >= enough_in_octave && odd < (end - first) / 4)
            return false;
        first = end;
    }
    return true;
}

/// The step that all values are whole numbers of apart, 0 if there is none that floats could tell: the least gap
/// between two values, or a part of it, or that of a file's usual units.
double common_step_of(const std::vector<float>& values_m) {
    constexpr std::size_t enough_values = 20;
    constexpr double least_m = 5e-5, most_off = 0.1; // of a step
    if (values_m.size() < enough_values)
        return 0;
    double least_gap = values_m.back();
    for (std::size_t i = 1; i < values_m.size(); ++i)
        least_gap = std::min(least_gap, static_cast<double>(values_m[i]) - values_m[i - 1]);
    for (const int parts : {1, 2, 3}) {
        double step = least_gap / parts, steps = 0; // from the first value on, which make the step more exact
        const bool common = std::ranges::all_of(values_m, [&](float value) {
            const double from_first = static_cast<double>(value) - values_m.front(), more = from_first / step - steps,
                         whole = std::round(more);
            steps += whole;
            step = steps > 0 ? from_first / steps : step;
            return std::abs(more - whole) < most_off;
        });
        if (common && step > least_m)
            return step;
    }
    for (const double per_metre : {100.0, 1000.0, 4000.0, 5000.0, 10000.0})
        if (std::ranges::all_of(values_m, [&](float value) {
                const double steps = static_cast<double>(value) * per_metre;
                return std::abs(steps - std::round(steps)) < most_off;
            }))
            return 1 / per_metre;
    return 0;
}

} // namespace

double DepthSteps::at(double z_m) const {
    return halves ? std::exp2(std::floor(std::log2(z_m)) - 10) : step_m + step_per_z2 * z_m * z_m;
}

double DepthSteps::sigma(double z_m) const { return at(z_m) / std::sqrt(12.0); }

/// Files hold growing steps in whole millimetres, which near the camera are all that shows: the values tell whose steps
/// would be well above these.
DepthSteps steps_of(const std::vector<float>& values_m) {
    DepthSteps steps{.halves = are_halves(values_m)};
    if (steps.halves)
        return steps;
    steps.rounding_m = common_step_of(values_m);
    const Step even = step_by(values_m, 0);
    Step growing = step_by(values_m, 2);
    constexpr double enough_share = 0.25; // of unquantised values the share is 0.02
    if (std::max(even.share, growing.share) < enough_share) {
        steps.step_m = steps.rounding_m; // a level camera sees few values
        return steps;
    }
    bool grows = growing.share > even.share;
    if (!grows && growing.share >= enough_share) {
        const auto far = std::ranges::lower_bound(values_m, std::sqrt(1.5 * even.size / growing.size));
        const std::vector<float> far_m(far, values_m.end());
        const Step growing_far = step_by(far_m, 2);
        grows = growing_far.share > std::max(enough_share, step_by(far_m, 0).share);
        growing = grows ? growing_far : growing;
    }
    if (grows)
        steps.step_per_z2 = growing.size;
    else if (steps.rounding_m > 0 || even.share > 0.5) // else the rows of a floor look like steps
        steps.step_m = steps.rounding_m > 0 ? steps.rounding_m : even.size;
    return steps;
}

} // namespace scanshade
