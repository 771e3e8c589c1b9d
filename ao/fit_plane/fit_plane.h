// Depth preparation for noisy sensors: each pixel's depth and normal from a robust plane through its surroundings, on the
// device. Clean depth does not need it: DepthNoise says.
#pragma once

#include "ao/gpu/program.h"
#include "ao/method.h"
#include "projection/noise.h"

#include <memory>

namespace scanshade {

/// Depth and normals of the same size as the input; holes stay holes. Normals are (0, 0, 0) where no plane fits.
struct FittedDepth {
    DepthImage depth;
    NormalImage normals;
};

/// Not thread-safe: one frame at a time.
class FitPlane {
  public:
    /// `noise.any()` must hold. The window grows with sigma(z) up to `largest_radius_px`.
    FitPlane(gpu::Device& device, const DepthNoise& noise, double largest_radius_px = 12);

    [[nodiscard]] FittedDepth compute(const DepthImage& depth);
    /// Where the time of the last compute() went.
    [[nodiscard]] const Timings& timings() const { return timings_; }

  private:
    gpu::Device& device_;
    DepthNoise noise_;
    double largest_radius_px_;
    cv::Size size_;
    std::unique_ptr<gpu::Program> program_;
    Timings timings_;
};

/// A method that looks at fitted depth and normals in place of the recorded ones.
class OnFittedDepth final : public Method {
  public:
    OnFittedDepth(gpu::Device& device, const DepthNoise& noise, Method& method) : fit_(device, noise), noise_(noise), method_(method) {}

    AoMap compute(const View& view) override;
    [[nodiscard]] const Timings& timings() const override { return timings_; }
    [[nodiscard]] std::vector<Intermediate> intermediates() override { return method_.intermediates(); }

  private:
    FitPlane fit_;
    DepthNoise noise_;
    Method& method_;
    Timings timings_;
};

} // namespace scanshade
