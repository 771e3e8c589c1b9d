// One bundle adjustment of planes: a residual for each cell, on camera, depth correction, pose and plane.
#pragma once

#include "projection/calibration/recording/plane_cells.h"
#include "projection/calibration/solve.h"

namespace scanshade::calibration {

/// Residuals on the numbers of a Fit, which must outlive it. Its nuisance numbers are the poses, then the planes.
class PlaneAdjustment {
  public:
    PlaneAdjustment(const PlaneObservations& observations, Fit& fit) : observations_(observations), fit_(fit) {}

    void add(std::size_t plane, const PlaneCell& cell, bool plane_is_known = false,
             ceres::LossFunction* loss = nullptr);
    /// Keeps poses near the recorded ones; where frames are not linked, at the origin.
    void add_pose_priors();
    void add_covariance(const Free& free);

    [[nodiscard]] double* pose(int frame) { return &fit_.nuisance[static_cast<std::size_t>(frame) * pose_unknowns]; }
    [[nodiscard]] double* plane(std::size_t index) {
        return &fit_.nuisance[observations_.frames.size() * pose_unknowns + index * point_unknowns];
    }

    ceres::Problem problem;

  private:
    const PlaneObservations& observations_;
    Fit& fit_;
};

} // namespace scanshade::calibration
