#include "ao/compare.h"

#include "projection/base/error.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// Pixels with a value.
std::size_t known(const cv::Mat1f& map) {
    return static_cast<std::size_t>(std::count_if(map.begin(), map.end(), [](float v) { return !std::isnan(v); }));
}

void check_sizes(const cv::Mat1f& a, const cv::Mat1f& b) {
    if (a.size() != b.size())
        throw Error(fmt::format("maps of one size expected, found {}x{} and {}x{}", a.cols, a.rows, b.cols, b.rows));
}

/// Calls use(a, b) for the pixels that have a value in both.
template <class Use>
void each_pair(const cv::Mat1f& a, const cv::Mat1f& b, Use&& use) {
    for (int y = 0; y < a.rows; ++y)
        for (int x = 0; x < a.cols; ++x)
            if (std::isfinite(a(y, x)) && std::isfinite(b(y, x)))
                use(a(y, x), b(y, x));
}

// ---------------------------------------------------------------------------------------------------- the best tone
// curve

constexpr double darkest = 1e-4; // below power 1 the slope at 0 is infinite, which solvers cannot handle

/// What the fit knows of a bin: sqrt(n), and the means of both sides.
struct BinMeans {
    double root_n, ours, truth;
};

/// sqrt(n) (curve(v) - mean truth) of each bin: the part of the squared error that a tone curve can change. Of strength
/// and power, with derivatives: as a block for each bin, derived by Ceres, the fit took ten times as long.
class BinResiduals final : public ceres::CostFunction {
  public:
    explicit BinResiduals(std::vector<BinMeans> bins) : bins_(std::move(bins)) {
        set_num_residuals(static_cast<int>(bins_.size()));
        *mutable_parameter_block_sizes() = {1, 1};
    }
    bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
        const double strength = *parameters[0], power = *parameters[1];
        double* const by_strength = jacobians ? jacobians[0] : nullptr;
        double* const by_power = jacobians ? jacobians[1] : nullptr;
        for (std::size_t i = 0; i < bins_.size(); ++i) {
            const auto& [root_n, ours, truth] = bins_[i];
            const double light = 1 - strength * (1 - ours), shown = std::clamp(light, darkest, 1.0);
            const double log_shown = std::log(shown), value = std::exp(power * log_shown);
            residuals[i] = root_n * (value - truth);
            if (by_strength) // flat where the light is clamped
                by_strength[i] = light == shown ? -root_n * (1 - ours) * power * value / shown : 0;
            if (by_power)
                by_power[i] = root_n * value * log_shown;
        }
        return true;
    }

  private:
    std::vector<BinMeans> bins_;
};

/// Starts of the fit: the identity, a weaker curve, and both ends of the valley that strength and power share.
constexpr std::array starts{ToneCurve{1, 1}, ToneCurve{0.5, 1}, ToneCurve{0.25, 4}, ToneCurve{1, 0.5},
                            ToneCurve{0.8, 2}};

// ---------------------------------------------------------------------------------------------------- similarity

constexpr int window = 11;

cv::Mat1d blurred(const cv::Mat1d& image) {
    cv::Mat1d mean;
    cv::GaussianBlur(image, mean, {window, window}, 1.5, 1.5, cv::BORDER_REFLECT);
    return mean;
}

cv::Mat1d blurred_product(const cv::Mat1d& p, const cv::Mat1d& q) {
    cv::Mat1d product;
    cv::multiply(p, q, product);
    return blurred(product);
}

/// Holes become 0; windows with holes do not count.
cv::Mat1d filled(const cv::Mat1f& map) {
    cv::Mat1d image(map.size());
    std::transform(map.begin(), map.end(), image.begin(), [](float v) { return std::isfinite(v) ? double(v) : 0.0; });
    return image;
}

/// 255 where the whole window lies inside the image and has a value in both maps.
cv::Mat1b whole_windows(const cv::Mat1f& a, const cv::Mat1f& b) {
    cv::Mat1b valid(a.size()), whole;
    std::transform(a.begin(), a.end(), b.begin(), valid.begin(),
                   [](float p, float q) { return std::isfinite(p) && std::isfinite(q) ? uchar(255) : uchar(0); });
    cv::erode(valid, whole, cv::Mat1b::ones(window, window), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    return whole;
}

/// Mean of the member over the images where it is known.
double mean_of(const std::vector<Difference>& images, double Difference::*member) {
    double sum = 0, count = 0;
    for (const Difference& image : images)
        if (std::isfinite(image.*member))
            sum += image.*member, ++count;
    return count > 0 ? sum / count : unknown;
}

double root_mean_square_of(const std::vector<Difference>& images, double Difference::*member) {
    double sum = 0, count = 0;
    for (const Difference& image : images)
        if (std::isfinite(image.*member))
            sum += image.*member * (image.*member), ++count;
    return count > 0 ? std::sqrt(sum / count) : unknown;
}

} // namespace

double ToneCurve::operator()(double visibility) const {
    if (k > 0)
        visibility = std::exp(-k * (1 - visibility));
    return std::pow(std::clamp(1 - strength * (1 - visibility), 0.0, 1.0), power);
}

void PairSums::add(float ours, float truth) {
    const double v = std::clamp(static_cast<double>(ours), 0.0, 1.0), t = truth;
    Bin& bin = bins_[static_cast<std::size_t>(std::min(static_cast<int>(v * bins), bins - 1))];
    bin.n += 1;
    bin.ours += v;
    bin.truth += t;
    bin.truth_squared += t * t;
    ++count_;
}

void PairSums::add(const PairSums& other) {
    for (std::size_t i = 0; i < bins_.size(); ++i) {
        Bin& bin = bins_[i];
        const Bin& more = other.bins_[i];
        bin = {bin.n + more.n, bin.ours + more.ours, bin.truth + more.truth, bin.truth_squared + more.truth_squared};
    }
    count_ += other.count_;
}

double PairSums::rms(const ToneCurve& curve) const {
    double sum = 0;
    for (const Bin& bin : bins_) {
        if (bin.n == 0)
            continue;
        const double shown = curve(bin.ours / bin.n);
        sum += bin.n * shown * shown - 2 * shown * bin.truth + bin.truth_squared;
    }
    return count_ > 0 ? std::sqrt(std::max(sum, 0.0) / static_cast<double>(count_)) : unknown;
}

double PairSums::bias(const ToneCurve& curve) const {
    double sum = 0;
    for (const Bin& bin : bins_)
        if (bin.n > 0)
            sum += bin.n * curve(bin.ours / bin.n) - bin.truth;
    return count_ > 0 ? sum / static_cast<double>(count_) : unknown;
}

ToneCurve PairSums::best_curve(const ToneCurve& least, const ToneCurve& most) const {
    ToneCurve best;
    if (count_ == 0)
        return best;
    std::vector<BinMeans> means;
    for (const Bin& bin : bins_)
        if (bin.n > 0)
            means.push_back({std::sqrt(bin.n), bin.ours / bin.n, bin.truth / bin.n});
    BinResiduals residuals(std::move(means));
    for (ToneCurve curve : starts) {
        curve = {std::clamp(curve.strength, least.strength, most.strength),
                 std::clamp(curve.power, least.power, most.power)};
        ceres::Problem::Options borrowed;
        borrowed.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
        ceres::Problem problem(borrowed);
        problem.AddResidualBlock(&residuals, nullptr, &curve.strength, &curve.power);
        problem.SetParameterLowerBound(&curve.strength, 0, least.strength);
        problem.SetParameterUpperBound(&curve.strength, 0, most.strength);
        problem.SetParameterLowerBound(&curve.power, 0, least.power);
        problem.SetParameterUpperBound(&curve.power, 0, most.power);
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::DENSE_QR;
        options.logging_type = ceres::SILENT;
        ceres::Solver::Summary summary;
        ceres::Solve(options, &problem, &summary);
        if (rms(curve) < rms(best))
            best = curve;
    }
    return best;
}

PairSums pair_sums(const cv::Mat1f& a, const cv::Mat1f& b) {
    check_sizes(a, b);
    PairSums sums;
    each_pair(a, b, [&](float ours, float truth) { sums.add(ours, truth); });
    return sums;
}

Difference compare(const cv::Mat1f& a, const cv::Mat1f& b) {
    check_sizes(a, b);
    Difference d;
    std::vector<double> apart;
    double sum = 0, square = 0, sum_a = 0, sum_b = 0;
    each_pair(a, b, [&](double p, double q) {
        apart.push_back(std::abs(p - q));
        sum += apart.back();
        square += (p - q) * (p - q);
        sum_a += p;
        sum_b += q;
    });
    d.pixels = apart.size();
    d.only_a = known(a) - d.pixels;
    d.only_b = known(b) - d.pixels;
    if (apart.empty()) {
        d.mae = d.rms = d.bias = d.percentile_95 = d.worst = d.ssim = d.correlation = d.calibrated_rms = unknown;
        return d;
    }
    const auto n = static_cast<double>(apart.size());
    d.mae = sum / n;
    d.rms = std::sqrt(square / n);
    d.bias = (sum_a - sum_b) / n;
    const auto rank = static_cast<std::ptrdiff_t>(std::ceil(0.95 * n)) - 1;
    std::nth_element(apart.begin(), apart.begin() + rank, apart.end());
    d.percentile_95 = apart[static_cast<std::size_t>(rank)];
    d.worst = *std::max_element(apart.begin() + rank, apart.end());

    double spread_a = 0, spread_b = 0, together = 0;
    const double mean_a = sum_a / n, mean_b = sum_b / n;
    each_pair(a, b, [&](double p, double q) {
        spread_a += (p - mean_a) * (p - mean_a);
        spread_b += (q - mean_b) * (q - mean_b);
        together += (p - mean_a) * (q - mean_b);
    });
    d.correlation = spread_a > 0 && spread_b > 0 ? together / std::sqrt(spread_a * spread_b) : unknown;
    d.ssim = structural_similarity(a, b);
    const PairSums pairs = pair_sums(a, b);
    d.curve = pairs.best_curve();
    d.calibrated_rms = pairs.rms(d.curve);
    return d;
}

Difference total(const std::vector<Difference>& images, const PairSums& pairs) {
    Difference all;
    all.worst = unknown;
    for (const Difference& image : images) {
        all.pixels += image.pixels;
        all.only_a += image.only_a;
        all.only_b += image.only_b;
        all.worst = std::fmax(all.worst, image.worst);
    }
    all.mae = mean_of(images, &Difference::mae);
    all.rms = root_mean_square_of(images, &Difference::rms);
    all.bias = mean_of(images, &Difference::bias);
    all.percentile_95 = mean_of(images, &Difference::percentile_95);
    all.ssim = mean_of(images, &Difference::ssim);
    all.correlation = mean_of(images, &Difference::correlation);
    all.curve = pairs.best_curve();
    all.calibrated_rms = pairs.rms(all.curve);
    return all;
}

double structural_similarity(const cv::Mat1f& a, const cv::Mat1f& b) {
    check_sizes(a, b);
    constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    const cv::Mat1d p = filled(a), q = filled(b);
    const cv::Mat1b counted = whole_windows(a, b);
    const cv::Mat1d mean_p = blurred(p), mean_q = blurred(q);
    const cv::Mat1d mean_pp = blurred_product(p, p), mean_qq = blurred_product(q, q), mean_pq = blurred_product(p, q);
    double sum = 0, windows = 0;
    for (int y = 0; y < p.rows; ++y)
        for (int x = 0; x < p.cols; ++x) {
            if (counted(y, x) == 0)
                continue;
            const double m = mean_p(y, x), n = mean_q(y, x);
            const double variances = mean_pp(y, x) - m * m + mean_qq(y, x) - n * n;
            const double covariance = mean_pq(y, x) - m * n;
            sum += (2 * m * n + c1) * (2 * covariance + c2) / ((m * m + n * n + c1) * (variances + c2));
            ++windows;
        }
    return windows > 0 ? sum / windows : unknown;
}

} // namespace scanshade
