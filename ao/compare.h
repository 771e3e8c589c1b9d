// The differences between two visibility maps of one view, for `compare` and `bench`.
#pragma once

#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

namespace scanshade {

/// The tone curve applied to visibility for presentation: V' = clamp(1 - strength (1 - V), 0, 1)^power, of
/// exp(-k (1 - V)) in place of V where k is above 0.
struct ToneCurve {
    double strength = 1, power = 1, k = 0;
    [[nodiscard]] double operator()(double visibility) const;
};

/// Pairs of values (ours, truth) collected in `bins` equal steps of ours over 0 .. 1: enough to fit a tone curve to any
/// number of images. Sums of images add up.
class PairSums {
  public:
    static constexpr int bins = 256;

    /// `ours` outside 0 .. 1 counts as its nearest end.
    void add(float ours, float truth);
    void add(const PairSums& other);
    [[nodiscard]] std::size_t count() const { return count_; }
    /// RMSE of curve(ours) to truth, with the mean of its bin for `ours` (an error below 1/512 in each value). NaN
    /// without pairs.
    [[nodiscard]] double rms(const ToneCurve& curve) const;
    /// Mean of curve(ours) - truth, likewise.
    [[nodiscard]] double bias(const ToneCurve& curve) const;
    /// The curve of least rms between two bounds: Ceres' least squares over the bins from several starts, the identity
    /// among them. The identity where there are no pairs.
    [[nodiscard]] ToneCurve best_curve(const ToneCurve& least = {0, 0.1}, const ToneCurve& most = {5, 10}) const;

  private:
    struct Bin {
        double n = 0, ours = 0, truth = 0, truth_squared = 0;
    };
    std::array<Bin, bins> bins_{};
    std::size_t count_ = 0;
};

/// How map A differs from map B. Every figure is over the pixels that have a value in both; NaN where there are none.
struct Difference {
    std::size_t pixels = 0;             ///< with a value in both
    std::size_t only_a = 0, only_b = 0; ///< with a value in only one
    double mae = 0, rms = 0;            ///< of a - b
    double bias = 0;                    ///< mean of a - b: positive = A is brighter
    double percentile_95 = 0;           ///< of |a - b| (nearest rank)
    double worst = 0;                   ///< largest |a - b|
    double ssim = 0;                    ///< mean over windows valid in both maps; NaN where there is no such window
    double correlation = 0;             ///< Pearson's; NaN where either map is constant
    double calibrated_rms = 0;          ///< rms with `curve`, the best one for A, applied to A
    ToneCurve curve;
};

/// Throws Error where the sizes differ.
[[nodiscard]] Difference compare(const cv::Mat1f& a, const cv::Mat1f& b);

/// The pairs that compare() counts, to fit one tone curve to many images.
[[nodiscard]] PairSums pair_sums(const cv::Mat1f& a, const cv::Mat1f& b);

/// Many images as one row: root mean square over images of the root mean squares, means of the other means, the largest
/// `worst`, sums of the counts; `calibrated_rms` with the one curve that is best for all images. Images without a
/// common pixel count only in the sums.
[[nodiscard]] Difference total(const std::vector<Difference>& images, const PairSums& pairs);

/// Structural similarity (Wang, Bovik, Sheikh and Simoncelli 2004): Gaussian window of 11x11, sigma 1.5, K1 0.01, K2
/// 0.03, range 1; the mean over the windows that hold no hole of either map and lie inside the image. NaN without such
/// a window.
[[nodiscard]] double structural_similarity(const cv::Mat1f& a, const cv::Mat1f& b);

} // namespace scanshade
