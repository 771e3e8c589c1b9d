// Depth preparation for noisy sensors: flying pixels dropped, then each pixel's depth and normal from a robust plane
// through its surroundings, on the device. Clean depth does not need it: DepthNoise says.
#pragma once

#include "ao/base/method.h"
#include "ao/gpu/program.h"
#include "projection/sensor/noise.h"
#include "shaders/shared/fit_plane.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace scanshade {

/// Depth and normals of the same size as the input; holes stay holes, but for those that other frames fill. Normals are
/// (0, 0, 0) where no plane fits, and empty where none were asked for.
struct FittedDepth {
    DepthImage depth;
    NormalImage normals;
};

struct FitPlaneOptions {
    bool drop_flying = true; ///< pixels between two surfaces that belong to neither become holes
    double smoothing = 1;    ///< of the window's radius; 0 leaves depth as it is, and normals to the method
    double largest_radius_px = 12;
    bool fill_holes = true; ///< in compute_on_device(): what lies behind narrow holes occludes

    bool operator==(const FitPlaneOptions&) const = default;
};

/// The same, left on the device, with what methods are to see.
struct FittedOnDevice {
    Surfaces surfaces;                           ///< narrow holes filled; as `z_m` and `normals` elsewhere
    std::shared_ptr<const gpu::DeviceBytes> z_m; ///< holes stay holes
    std::vector<std::uint32_t> filled; ///< a bit for each pixel that had no depth; empty = none has been filled
};
/// NaN where a hole has been filled: what is not seen has no visibility.
void take_out_filled(const FittedOnDevice& fitted, cv::Mat1f& visibility);

/// What another frame of the recording saw, flying pixels dropped: metres, 0 = hole; of the same image size.
struct OtherDepth {
    Pinhole camera;
    std::shared_ptr<const gpu::DeviceBytes> z_m;
    Eigen::Isometry3d here_from_there;
};

/// What the passes are compiled and chosen for. Frames are fused or holes filled, not both.
struct FitPlaneVariant {
    cv::Size size;
    bool planes = false;      ///< fitted; else flying pixels are all that is looked for
    bool fused = false;       ///< with what other frames saw
    bool waves = false;       ///< values err alike over windows of pixels, as disparity does
    bool independent = false; ///< each pixel errs by itself
    bool filled = false;      ///< narrow holes are

    bool operator==(const FitPlaneVariant&) const = default;
};

/// Not thread-safe: one frame at a time.
class FitPlane {
  public:
    /// `noise.needs_preparation()` must hold. Flying pixels are dropped where `noise` expects them. The window's radius
    /// grows with the root of sigma(z), and with the correlation length.
    FitPlane(gpu::Device& device, const DepthNoise& noise, const FitPlaneOptions& options = {});

    /// With others, each pixel's depth is first averaged with what they saw of its surface, and the windows shrink with
    /// what that leaves of sigma. Holes that they saw into are filled: such pixels occlude, but have no value of their
    /// own.
    [[nodiscard]] FittedDepth compute(const DepthImage& depth, std::span<const OtherDepth> others = {});
    /// The same of one frame, left on the device; planes() must hold.
    [[nodiscard]] FittedOnDevice compute_on_device(const DepthImage& depth);
    /// Whether depth and normals come from planes, and not depth alone, without flying pixels.
    [[nodiscard]] bool planes() const { return options_.smoothing > 0 && noise_.any(); }
    [[nodiscard]] const DepthNoise& noise() const { return noise_; }
    /// From now on depth has that noise; throws Error where it is none.
    void set_noise(const DepthNoise& noise);
    /// Where the time of the last compute() went.
    [[nodiscard]] const Timings& timings() const { return timings_; }

  private:
    /// Uploads what is to be fitted.
    void prepare(const DepthImage& depth, std::span<const OtherDepth> others, bool fill);

    gpu::Device& device_;
    gpu::DeviceBytesPool pool_;
    DepthNoise noise_;
    FitPlaneOptions options_;
    FitPlaneVariant variant_; ///< as the program has it
    shared::FitPlaneConstants constants_ = {};
    std::unique_ptr<gpu::Program> program_;
    Timings timings_;
};

} // namespace scanshade
