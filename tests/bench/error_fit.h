// Fits tables of expected errors to pixels whose true error is known.
#pragma once

#include "projection/sensor/expected_error.h"

#include <array>
#include <span>
#include <utility>
#include <vector>

namespace scanshade {

/// A pixel: what it shows, and the square of how far its visibility is off.
struct ErrorSample {
    ErrorWeights signs;
    float square = 0;
    int scene = 0; ///< pixels of one scene are left out together
    int frame = 0; ///< of all captures
};

/// The table whose expected squares have the samples' sums over every knot (Bailey's minimum bias, which is maximum
/// likelihood of a gamma distribution's mean with logarithmic link), drawn to neighbouring knots where samples are few.
/// Errors never rise with the share seen nor with the distance from jumps and holes, nor fall with noise. Samples of
/// the scene `without` are left out. Nothing but zeros where there are none.
[[nodiscard]] shared::ErrorTable fitted_errors(std::span<const ErrorSample> samples, int without = -1);

/// The binary logarithm of true squares / expected ones; 0 where there are no samples. Those of the scene `without` are
/// left out.
[[nodiscard]] float factor_of(std::span<const ErrorSample> samples, const shared::ErrorTable& table, int without = -1);

/// Expected against found errors, in eight bins of equally many pixels by the expected one.
class Calibration {
  public:
    static constexpr std::size_t bins = 8;
    struct Bin {
        double expected = 0, found = 0; ///< RMS
    };

    void add(float expected, float square) { all_.emplace_back(expected, square); }
    [[nodiscard]] std::array<Bin, bins> in_bins();
    [[nodiscard]] Bin whole() const { return of(all_); }

  private:
    using Pair = std::pair<float, float>;
    [[nodiscard]] static Bin of(std::span<const Pair> some);
    std::vector<Pair> all_;
};

/// "0.012/0.014": expected/found.
[[nodiscard]] std::string text_of(const Calibration::Bin& bin);
/// The same of all bins.
[[nodiscard]] std::string text_of_bins(Calibration& calibration);

} // namespace scanshade
