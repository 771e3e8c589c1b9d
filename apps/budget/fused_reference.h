// The reference for captures without truth: rays against the cloud that all posed frames of a capture make together.
#pragma once

#include "ao/fit_plane/fit_plane.h"
#include "ao/raycast/ray_hemisphere.h"
#include "apps/budget/trial.h"

#include <optional>

namespace scanshade {

/// Not the truth: it holds surfaces that only other frames saw, but also their noise and the poses' errors.
class FusedReference {
  public:
    static constexpr int rays = 256;
    static constexpr std::size_t most_frames = 60;

    /// Fuses up to `most_frames` posed frames of the capture into voxels of a 25th of the radius. Noisy depth and its
    /// normals come from plane fits. Each voxel becomes a disc with the mean point and normal of its points, no smaller
    /// than their pixels. Depths whose sigma is above a tenth of the radius are left out. Throws Error where fewer than
    /// two frames have poses.
    FusedReference(gpu::Device& device, const std::filesystem::path& path, const TrialCapture& capture,
                   const CaptureOptions& options);

    /// Visibility of the frame's recorded pixels by `rays` rays each, within the capture's radius. They start where the
    /// pixel's own ray first hits the fused surface. NaN where that is not near the pixel's depth, and everywhere in a
    /// frame without a pose.
    [[nodiscard]] cv::Mat1f visibility(const TrialFrame& frame) const;

    /// "ray casting against the cloud fused of 40 posed frames (1234567 discs)".
    [[nodiscard]] const std::string& description() const { return description_; }

  private:
    struct Surface {
        DepthImage depth;
        NormalImage normals;
    };
    [[nodiscard]] Surface surface_of(const DepthImage& depth);
    /// Positions are in the world; `sigma_m` is of the depth there.
    [[nodiscard]] std::optional<RayStart> start(const Eigen::Vector3d& eye, const Eigen::Vector3d& seen,
                                                double sigma_m) const;

    DepthNoise noise_;
    double radius_m_, voxel_m_;
    std::optional<FitPlane> fit_;
    std::vector<Disc> discs_;
    std::optional<RaySurface> surface_; ///< of discs_, in their order
    CosineDirections directions_;
    std::string description_;
};

} // namespace scanshade
